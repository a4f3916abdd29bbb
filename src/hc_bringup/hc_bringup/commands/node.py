"""hc node list, info: what ros2cli would print, which the wheels lack."""

from __future__ import annotations

import argparse
import sys
from typing import Any

HELP = "list the running nodes, and what one publishes and offers"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    commands = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    listing = commands.add_parser("list", help="names of all running nodes")
    listing.add_argument("-a", "--all", action="store_true", help="hidden nodes too")
    listing.add_argument("-c", "--count-nodes", action="store_true", help="print the number only")
    info = commands.add_parser("info", help="topics and services of a node")
    info.add_argument("node", metavar="NODE")


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    from hc_bringup.graph import Graph
    from hc_bringup.stopped_processes import stopped_note

    with Graph() as graph:
        if arguments.action == "info":
            return _info(graph, arguments.node)
        graph.settle()
        names = graph.node_names(hidden=arguments.all)
    print(len(names) if arguments.count_nodes else "\n".join(names) or "no node is running")
    note = stopped_note()
    if note:
        print(f"hc node: {note}", file=sys.stderr)
    return 0


def _info(graph: Any, wanted: str) -> int:
    full = graph.require_node(wanted)
    graph.settle()
    namespace, _, name = full.rpartition("/")
    where = (name, namespace or "/")
    print(full)
    for title, found in (
        ("Subscribers", graph.node.get_subscriber_names_and_types_by_node(*where)),
        ("Publishers", graph.node.get_publisher_names_and_types_by_node(*where)),
        ("Service Servers", graph.node.get_service_names_and_types_by_node(*where)),
        ("Service Clients", graph.node.get_client_names_and_types_by_node(*where)),
    ):
        print(f"  {title}:")
        for topic, types in sorted(found):
            print(f"    {topic}: {', '.join(types)}")
    return 0
