"""hc param list, get, set, describe, dump, load: what ros2cli offers, which the wheels lack."""

from __future__ import annotations

import argparse
import difflib
import re
from pathlib import Path
from typing import Any

from hc_bringup.errors import FAILURE, WRONG_USE, UserError
from hc_bringup.options import assignment
from hc_bringup.parameter_file import read_yaml
from hc_msgs_py.ros_yaml import dump_for_ros

HELP = "list, read, change, save and load the parameters of a running node"
_KIND = r"'(?:Parameter\.)?Type\.(\w+)'"
_WRONG_TYPE = re.compile(f"Wrong parameter type, expected {_KIND} got {_KIND}")
_TYPES = {
    "BOOL": "true or false",
    "INTEGER": "a whole number",
    "DOUBLE": "a number",
    "STRING": "a text",
    "BYTE_ARRAY": "a list of bytes",
    "BOOL_ARRAY": "a list of true and false",
    "INTEGER_ARRAY": "a list of whole numbers",
    "DOUBLE_ARRAY": "a list of numbers",
    "STRING_ARRAY": "a list of texts",
}
"""What a user types for a type of rclpy."""
_READ_ONLY = re.compile(r"Trying to set a read-only parameter: .*")
_UNDECLARED = "Static parameter cannot be undeclared"
_RANGE = re.compile(r"Parameter \S+ out of range[.]? Min: (\S+), Max: (\S+), value: (\S+)")
MOST_NAMES = 20
"""Parameters of a node that are named where none is like the one that was asked for."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    commands = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    listing = commands.add_parser("list", help="names of the parameters of a node, or of all")
    listing.add_argument("node", nargs="?", metavar="NODE")
    listing.add_argument("--param-type", action="store_true", help="types too")
    get = commands.add_parser("get", help="print the value of a parameter")
    get.add_argument("node", metavar="NODE")
    get.add_argument("name", metavar="NAME")
    get.add_argument("--hide-type", action="store_true", help="the value only")
    change = commands.add_parser("set", help="change a parameter")
    change.add_argument("node", metavar="NODE")
    change.add_argument("name", metavar="NAME")
    change.add_argument("value", metavar="VALUE")
    describe = commands.add_parser("describe", help="type, meaning and range of parameters")
    describe.add_argument("node", metavar="NODE")
    describe.add_argument("names", nargs="+", metavar="NAME", help="names, or patterns with *")
    dump = commands.add_parser("dump", help="print all parameters of a node as a parameter file")
    dump.add_argument("node", metavar="NODE")
    load = commands.add_parser("load", help="set the parameters in a parameter file, all or none")
    load.add_argument("node", metavar="NODE")
    load.add_argument("file", metavar="FILE")


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    from hc_bringup.graph import Graph

    action = {
        "list": _list,
        "get": _get,
        "set": _set,
        "describe": _describe,
        "dump": _dump,
        "load": _load,
    }
    with Graph() as graph:
        return action[arguments.action](graph, arguments)


def _list(graph: Any, arguments: argparse.Namespace) -> int:
    if arguments.node is not None:
        names = [graph.require_node(arguments.node)]
    else:
        graph.settle()
        names = graph.node_names()
    for node_name in names:
        client = graph.parameter_client(node_name)
        parameters = sorted(_names(graph, client, node_name))
        if arguments.node is None:
            print(f"{node_name}:")
        types = (
            [_type_name(v) for v in _values(graph, client, parameters)]
            if arguments.param_type
            else []
        )
        for index, name in enumerate(parameters):
            print(f"  {name} (type: {types[index]})" if types else f"  {name}")
    return 0


def _get(graph: Any, arguments: argparse.Namespace) -> int:
    node_name, client = _connect(graph, arguments.node)
    message = _value(graph, client, node_name, arguments.name)
    value = _python(message)
    print(value if arguments.hide_type else f"{_type_name(message).capitalize()} value is: {value}")
    return 0


def _set(graph: Any, arguments: argparse.Namespace) -> int:
    from rclpy.parameter import Parameter, get_parameter_value, parameter_value_to_python

    node_name, client = _connect(graph, arguments.node)
    current = _python(_value(graph, client, node_name, arguments.name))
    given = parameter_value_to_python(get_parameter_value(arguments.value))
    if isinstance(given, str) and not isinstance(current, str):
        given = assignment(f"{arguments.name}={arguments.value}")[1]  # 1e-3, [0, 0, -9.81]
    parameter = Parameter(arguments.name, value=_like(current, given))
    _set_atomically(graph, client, [parameter])
    print("Set parameter successful")
    return 0


def _describe(graph: Any, arguments: argparse.Namespace) -> int:
    from fnmatch import fnmatchcase

    from rclpy.parameter import Parameter

    node_name, client = _connect(graph, arguments.node)
    names = sorted(_names(graph, client, node_name))
    chosen: list[str] = []
    for wanted in arguments.names:
        fitting = [n for n in names if fnmatchcase(n, wanted)]
        if not fitting:
            raise _no_parameter(node_name, wanted, names)
        chosen += [n for n in fitting if n not in chosen]
    answer = graph.call(lambda: client.describe_parameters(chosen), "description")
    for parameter in answer.descriptors:
        kind = str(Parameter.Type(parameter.type).name).lower().replace("_", " ")
        print(f"Parameter name: {parameter.name}")
        print(f"  Type: {'any' if parameter.dynamic_typing else kind}")
        if parameter.description:
            print(f"  Description: {parameter.description}")
        print("  Constraints:")
        print(f"    Read only: {str(parameter.read_only).lower()}")
        for limits in (*parameter.integer_range, *parameter.floating_point_range):
            print(f"    Min value: {limits.from_value}")
            print(f"    Max value: {limits.to_value}")
        if parameter.additional_constraints:
            print(f"    {parameter.additional_constraints}")
    return 0


def _no_parameter(node_name: str, name: str, names: list[str]) -> UserError:
    close = difflib.get_close_matches(name, names, n=3, cutoff=0.5)
    listed = f"it has: {', '.join(names)}"
    if len(names) > MOST_NAMES:
        listed = f"hc param list {node_name} lists its {len(names)}"
    hint = f"did you mean {' or '.join(close)}?" if close else listed
    return UserError(f"node {node_name} has no parameter {name}; {hint}", FAILURE)


def _dump(graph: Any, arguments: argparse.Namespace) -> int:
    node_name, client = _connect(graph, arguments.node)
    names = sorted(_names(graph, client, node_name))
    values = [_python(v) for v in _values(graph, client, names)]
    tree = {node_name: {"ros__parameters": dict(zip(names, values, strict=True))}}
    print(dump_for_ros(tree), end="")
    return 0


def _load(graph: Any, arguments: argparse.Namespace) -> int:
    from rclpy.parameter import Parameter

    wanted = _read_file(Path(arguments.file), arguments.node)
    node_name, client = _connect(graph, arguments.node)
    known = set(_names(graph, client, node_name))
    unknown = sorted(set(wanted) - known)
    if unknown:
        raise UserError(f"node {node_name} has no parameter {', '.join(unknown)}", FAILURE)
    names = list(wanted)
    current = dict(zip(names, map(_python, _values(graph, client, names)), strict=True))
    # What is as wanted already is left alone: a dump contains read-only parameters too.
    changes = [
        Parameter(name, value=_like(current[name], value))
        for name, value in wanted.items()
        if _like(current[name], value) != current[name]
    ]
    if changes:
        _set_atomically(graph, client, changes)
    print(f"{len(changes)} of {len(wanted)} parameters changed")
    return 0


def _read_file(path: Path, node: str) -> dict[str, Any]:
    """Return the parameters that a ROS parameter file has for a node, by their full names."""
    data = read_yaml(path)
    found: dict[str, Any] = {}
    if isinstance(data, dict):
        for key in ("/**", node.lstrip("/"), f"/{node.lstrip('/')}"):
            section = data.get(key)
            if isinstance(section, dict) and isinstance(section.get("ros__parameters"), dict):
                found.update(_flatten(section["ros__parameters"]))
    if not found:
        raise UserError(
            f"{path} has no section {node.lstrip('/')}: ros__parameters: with values", WRONG_USE
        )
    return found


def _flatten(tree: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for name, value in tree.items():
        if isinstance(value, dict):
            flat.update(_flatten(value, f"{prefix}{name}."))
        else:
            flat[f"{prefix}{name}"] = value
    return flat


def _connect(graph: Any, node: str) -> tuple[str, Any]:
    node_name = graph.require_node(node)
    return node_name, graph.parameter_client(node_name)


def _names(graph: Any, client: Any, node_name: str) -> list[str]:
    answer = graph.call(client.list_parameters, f"parameters of {node_name}")
    return list(answer.result.names)


def _values(graph: Any, client: Any, names: list[str]) -> list[Any]:
    return list(graph.call(lambda: client.get_parameters(names), "values").values)


def _value(graph: Any, client: Any, node_name: str, name: str) -> Any:
    values = _values(graph, client, [name])
    if not values or values[0].type == 0:
        raise _no_parameter(node_name, name, sorted(_names(graph, client, node_name)))
    return values[0]


def _python(message: Any) -> Any:
    from rclpy.parameter import parameter_value_to_python

    value = parameter_value_to_python(message)
    return list(value) if hasattr(value, "tolist") else value


def _type_name(message: Any) -> str:
    from rclpy.parameter import Parameter

    return str(Parameter.Type(message.type).name).lower().replace("_", " ")


def _like(current: Any, given: Any) -> Any:
    """Return whole numbers as floats where the parameter has those: `set window 5` shall work."""
    if isinstance(current, float) and isinstance(given, int) and not isinstance(given, bool):
        return float(given)
    if isinstance(current, list) and isinstance(given, list):
        of_floats = all(isinstance(item, float) for item in current) and current
        return [_like(0.0, item) for item in given] if of_floats else given
    return given


def _set_atomically(graph: Any, client: Any, parameters: list[Any]) -> None:
    answer = graph.call(lambda: client.set_parameters_atomically(parameters), "setting")
    if not answer.result.successful:
        raise UserError(_refused(parameters, answer.result.reason), FAILURE)


def _refused(parameters: list[Any], reason: str) -> str:
    """Return one line of why a node took none of these."""
    if any(reason.startswith(f"parameter {p.name} ") for p in parameters):  # a node of the suite
        return reason if len(parameters) == 1 else f"none was changed: {reason}"
    names = ", ".join(p.name for p in parameters)
    if len(parameters) == 1:
        names += f" to {parameters[0].value!r}"
    return f"setting {names} failed: {_plain(reason)}"


def _plain(reason: str) -> str:
    """Return why a node of others refused a value, without rclpy's names of types and such."""
    if _READ_ONLY.fullmatch(reason):
        return "it is read-only: give it when the node starts (hc run --param, or its file)"
    if reason == _UNDECLARED:
        return "it takes a value, and null is none"
    outside = _RANGE.fullmatch(reason)
    if outside is not None:
        low, high, value = (f"{float(number):g}" for number in outside.groups())
        return f"{value} is not a number from {low} to {high}"
    wrong = _WRONG_TYPE.fullmatch(reason)
    if wrong is None:
        return reason
    wanted, given = (_TYPES.get(name, name.lower()) for name in wrong.groups())
    return f"it takes {wanted}, not {given}"
