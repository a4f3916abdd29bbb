"""hc node list: what `ros2 node list` would print."""

from __future__ import annotations

import argparse

HELP = "list the running nodes"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    commands = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    listing = commands.add_parser("list", help="names of all running nodes")
    listing.add_argument("-a", "--all", action="store_true", help="hidden nodes too")
    listing.add_argument("-c", "--count-nodes", action="store_true", help="print the number only")


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    from hc_bringup.graph import Graph

    with Graph() as graph:
        graph.settle()
        names = graph.node_names(hidden=arguments.all)
    print(len(names) if arguments.count_nodes else "\n".join(names) or "no node is running")
    return 0
