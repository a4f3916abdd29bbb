"""hc service list, type, call: what ros2cli would offer, which the wheels lack."""

from __future__ import annotations

import argparse
from typing import Any

from hc_bringup.errors import FAILURE, WRONG_USE, UserError
from hc_bringup.options import positive
from hc_msgs_py.plain_yaml import PlainYamlError, load_plain_yaml

HELP = "list services and call one"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    commands = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    listing = commands.add_parser("list", help="names of all services")
    listing.add_argument("-t", "--show-types", action="store_true", help="types too")
    listing.add_argument("-c", "--count-services", action="store_true", help="the number only")
    listing.add_argument("--include-hidden-services", action="store_true", help="hidden ones too")
    kind = commands.add_parser("type", help="type of a service")
    kind.add_argument("service", metavar="SERVICE")
    call = commands.add_parser("call", help="call a service and print its answer")
    call.add_argument("service", metavar="SERVICE")
    call.add_argument(
        "words",
        nargs="*",
        metavar="[TYPE] [VALUES]",
        help="type of the service, if it is not to be looked up; fields of the request as YAML, "
        'for example "{data: true}"',
    )
    call.add_argument(
        "--timeout", type=positive, default=10.0, metavar="S", help="wait no longer (default: 10)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    from hc_bringup.graph import Graph

    action = {"list": _list, "type": _type, "call": _call}
    with Graph() as graph:
        return action[arguments.action](graph, arguments)


def _list(graph: Any, arguments: argparse.Namespace) -> int:
    from hc_bringup.service_calls import services

    graph.settle()
    found = services(graph, hidden=arguments.include_hidden_services)
    if arguments.count_services:
        print(len(found))
        return 0
    for name, types in found:
        print(f"{name} [{', '.join(types)}]" if arguments.show_types else name)
    return 0


def _type(graph: Any, arguments: argparse.Namespace) -> int:
    from hc_bringup.service_calls import require_service

    print(require_service(graph, arguments.service)[1])
    return 0


def _call(graph: Any, arguments: argparse.Namespace) -> int:
    """Print the answer; status 1 where it says that the service did not succeed."""
    from hc_bringup.message_text import as_yaml
    from hc_bringup.message_values import fill
    from hc_bringup.service_calls import Client, require_service
    from hc_msgs_py.interface_class import interface_class

    type_name, values = _split(arguments.words)
    name, found = require_service(graph, arguments.service)
    if type_name is not None and interface_class(type_name, "srv") is not interface_class(
        found, "srv"
    ):
        raise UserError(f"{name} is a {found}, not a {type_name}", WRONG_USE)
    kind = interface_class(found, "srv")
    request = kind.Request()
    fill(request, values)
    answer = Client(graph, kind, name).call(request, arguments.timeout)
    print(as_yaml(answer), end="")
    return FAILURE if getattr(answer, "success", True) is False else 0


def _split(words: list[str]) -> tuple[str | None, dict[str, Any]]:
    """Return type and values; both may be left away."""
    if len(words) > 2:
        raise UserError("give a type and one text of values in quotes at most", WRONG_USE)
    words = list(words)
    type_name = words.pop(0) if words and "/" in words[0] and ":" not in words[0] else None
    if type_name is not None and type_name.startswith("{"):
        raise UserError(f"{type_name} is not a service type", WRONG_USE)
    text = words[0] if words else "{}"
    try:
        values = load_plain_yaml(text)
    except PlainYamlError as error:
        raise UserError(f"{text} is not YAML: {error}", WRONG_USE) from error
    if values is None:
        values = {}
    if not isinstance(values, dict):
        raise UserError(f"{text} is no fields with values like {{data: true}}", WRONG_USE)
    return type_name, values
