"""hc dashboard: a live page in a browser about whatever of the suite is running."""

from __future__ import annotations

import argparse
import importlib.util
import json
import os

from hc_bringup.errors import UserError
from hc_bringup.options import namespace, origin, port_number

HELP = "live page in a browser: what is felt, how sure, and what happens"
HOW_TO_INSTALL = "the live page needs aiohttp: pip install hc-suite[dashboard]"


def is_installed() -> bool:
    """Whether the live page can be served here."""
    return importlib.util.find_spec("aiohttp") is not None


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    add_options(parser)
    parser.add_argument(
        "--namespace",
        type=namespace,
        metavar="NAME",
        help="show the estimator of this namespace (left: that of /left/estimator)",
    )
    parser.add_argument(
        "--port", type=port_number, metavar="N", help="port (default 8765; 0 takes a free one)"
    )
    parser.add_argument(
        "--listen",
        default="127.0.0.1",
        metavar="ADDRESS",
        help="address to listen on; another one than 127.0.0.1 lets other machines look",
    )
    parser.add_argument(
        "--name",
        dest="names",
        action="append",
        default=[],
        metavar="HOST",
        help="host name by which other machines open the page, with --listen",
    )
    parser.add_argument(
        "--bags", default="bags", metavar="DIR", help="folder for recordings made from the page"
    )
    parser.add_argument(
        "--tip", default="", metavar="TOPIC", help="position of the tip (default: indenter/tip)"
    )
    parser.add_argument(
        "--tip-axes",
        default="xy",
        choices=("xy", "xz", "yx", "yz", "zx", "zy"),
        help="its components that are sideways (default: xy)",
    )


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare what hc run has too."""
    parser.add_argument(
        "--control", action="store_true", help="let the page change things; else it only looks"
    )
    parser.add_argument(
        "--allow-origin",
        action="append",
        type=origin,
        default=[],
        metavar="ORIGIN",
        help="let a Foxglove or Lichtblick in a browser of that origin connect with the token",
    )


def run(arguments: argparse.Namespace) -> int:
    """Run the command.

    Raises:
        UserError: if the server's library is not installed, or ROS_DOMAIN_ID is no domain.
    """
    if not is_installed():
        raise UserError(HOW_TO_INSTALL)
    from hc_bringup.dashboard.node import DashboardNode
    from hc_bringup.dashboard.security import TOKEN_VARIABLE, new_token
    from hc_bringup.domain_lock import domain_id
    from hc_msgs_py.node_main import run_node

    domain_id()
    os.environ.setdefault(TOKEN_VARIABLE, new_token())
    parameters = node_parameters(arguments)
    if arguments.port is not None:
        parameters |= {"port": arguments.port, "any_port": False}
    parameters |= {
        "listen": arguments.listen,
        "names": [*arguments.names] or [""],
        "bags": arguments.bags,
        "tip.topic": arguments.tip,
        "tip.axes": arguments.tip_axes,
    }

    def make() -> DashboardNode:
        node = DashboardNode()
        for line in node.welcome():
            print(line, flush=True)
        return node

    words = ["--ros-args"]
    if arguments.namespace is not None:
        words += ["-r", f"__ns:=/{arguments.namespace}"]
    for name, value in parameters.items():
        # YAML reads JSON; a text must not be taken for a number.
        words += ["-p", f"{name}:={json.dumps(value)}"]
    return run_node(make, words)


def node_parameters(arguments: argparse.Namespace) -> dict[str, object]:
    """Return the node's parameters for the options that hc run has too."""
    return {
        "any_port": True,
        "control": arguments.control,
        "allow_origin": [*arguments.allow_origin] or [""],
    }
