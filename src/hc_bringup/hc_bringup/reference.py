"""Writes docs/reference/: commands, topics, parameters, Python, files, as the programs know them.

`python -m hc_bringup.reference docs/reference` writes the pages and the JSON schemas by which an
editor checks a parameter file or a scenario; test/suite/test_reference.py fails when one of them
is older than what it describes.
"""

from __future__ import annotations

import argparse
import dataclasses
import functools
import json
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final

from hc_bringup.cli import COMMANDS, command_parser
from hc_bringup.reference_api import api_page
from hc_bringup.reference_files import files_page
from hc_msgs_py.specification import ParameterSpecification

MESSAGES: Final = (
    "IndenterSample",
    "IndenterSamples",
    "HuntCrossleyEstimate",
    "HuntCrossleyEstimates",
    "EstimatorConfiguration",
    "EstimatorEvent",
    "ContactSummary",
    "IndenterTruth",
    "TactileSample",
    "TactileEstimate",
)
_WRITTEN: Final = "*Written by `python -m hc_bringup.reference docs/reference`; do not edit.*"


def _table(head: tuple[str, ...], rows: list[tuple[str, ...]]) -> list[str]:
    """A Markdown table with an empty line behind it; nothing where there are no rows."""
    if not rows:
        return []
    lines = ["| " + " | ".join(head) + " |", "|---" * len(head) + "|"]
    for row in rows:
        cells = [" ".join(cell.split()).replace("|", "\\|") for cell in row]
        lines.append("| " + " | ".join(cells) + " |")
    return [*lines, ""]


def commands_page() -> str:
    """Every command with its arguments and options."""
    lines = ["# Commands", "", _WRITTEN, ""]
    lines += [
        "`hc --version` tells version and commit. `hc COMMAND --help` tells what stands here."
    ]
    lines += [""]
    for name in COMMANDS:
        for words, parser in _commands(f"hc {name}", command_parser(name)):
            lines += [f"## {words}" if words.count(" ") == 1 else f"### {words}", ""]
            if parser.description:
                lines += [parser.description[:1].upper() + parser.description[1:] + ".", ""]
            lines += _table(("argument", "what it is"), _arguments(parser))
    return "\n".join(lines).rstrip() + "\n"


def _commands(
    words: str, parser: argparse.ArgumentParser, about: str = ""
) -> Iterator[tuple[str, argparse.ArgumentParser]]:
    """A command and its subcommands, each with what was said of it."""
    parser.description = parser.description or about
    yield words, parser
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            abouts = {a.dest: a.help or "" for a in action._choices_actions}
            for name, sub in action.choices.items():
                yield from _commands(f"{words} {name}", sub, abouts.get(name, ""))


def _arguments(parser: argparse.ArgumentParser) -> list[tuple[str, ...]]:
    formatter = parser._get_formatter()
    rows: list[tuple[str, ...]] = []
    for action in parser._actions:
        if isinstance(action, (argparse._HelpAction, argparse._SubParsersAction)):
            continue
        value = ""
        if action.nargs != 0:
            plain = action.option_strings == [] or action.choices is None
            name = action.metavar or (action.dest.upper() if plain else "|".join(_words(action)))
            value = name if isinstance(name, str) else " ".join(name)
        shown = ", ".join(action.option_strings)
        text = formatter._expand_help(action) if action.help else ""
        rows.append((f"`{f'{shown} {value}'.strip()}`", text))
    return rows


def _words(action: argparse.Action) -> list[str]:
    return [str(choice) for choice in action.choices or ()]


def topics_page() -> str:
    """Every message of the suite, field by field."""
    from hc_logger.definitions import SEPARATOR, installed_definition

    lines = ["# Topics", "", _WRITTEN, ""]
    lines += ["Which node publishes what: [design.md](../design.md#nodes-and-topics)."]
    lines += ["How an estimate and its configuration belong together: [node.md](../node.md).", ""]
    for name in MESSAGES:
        text = installed_definition(f"hc_msgs/msg/{name}").text.split(SEPARATOR)[0]
        lines += [f"## hc_msgs/msg/{name}", "", *_message(text)]
    return "\n".join(lines).rstrip() + "\n"


def _message(text: str) -> list[str]:
    """The paragraphs and fields of a .msg file as Markdown."""
    lines: list[str] = []
    rows: list[tuple[str, ...]] = []
    paragraph: list[str] = []
    head = ("field", "type", "meaning")
    for line in [*text.splitlines(), "#"]:
        if line.startswith("#"):
            lines += _table(head, rows)
            rows = []
            paragraph.append(line.removeprefix("#").strip())
        elif not line.strip():
            lines += [" ".join(paragraph), ""] if paragraph else _table(head, rows)
            rows, paragraph = [], []
        else:
            if paragraph:
                lines += [" ".join(paragraph), ""]
                paragraph = []
            code, _, comment = line.partition("#")
            kind, name = code.split(maxsplit=1)
            rows.append((f"`{name.strip()}`", kind, comment.strip()))
    return lines


def parameters_page() -> str:
    """Every parameter of every node, as the nodes declare them."""
    lines = ["# Parameters", "", _WRITTEN, ""]
    lines += [
        "What `hc param list NODE` names and `hc param set NODE NAME VALUE` changes. A parameter",
        "file sets them at the start (folder `config/`). What those of the filters do to an",
        "estimate stands in [estimators.md](../estimators.md), the node's own in",
        "[node.md](../node.md). The rig's settings are those of scenario `multisine`: each",
        "scenario brings those of its own tissue ([rig.md](../rig.md)).",
        "",
    ]
    head = ("parameter", "default", "allowed", "what it does")
    for node, specifications in _declared().items():
        rows: list[tuple[str, ...]] = [
            (f"`{s.name}`", _default(s.default), _allowed(s), _described(s)) for s in specifications
        ]
        lines += [f"## {node}", "", *_table(head, rows)]
    return "\n".join(lines).rstrip() + "\n"


def parameters_schema() -> str:
    """JSON schema of a ROS parameter file for the suite's nodes."""
    from hc_sim_rig.settings import SETTINGS

    nodes = {}
    for node, declared in _declared().items():
        specifications = {s.name: s for s in declared}
        if node == "indenter":  # whichever the scenario has
            specifications |= {n: s.specification for n, s in SETTINGS.items()}
        nodes[node] = {
            "type": "object",
            "required": ["ros__parameters"],
            "properties": {"ros__parameters": _nested(specifications)},
        }
    return _json({"title": "ROS parameters of the hc nodes", "properties": nodes})


def _nested(specifications: dict[str, ParameterSpecification]) -> dict[str, Any]:
    """Schema of one node's parameters: `input.force.zero` is one key, or three levels."""
    properties: dict[str, Any] = {}
    inner: dict[str, dict[str, ParameterSpecification]] = {}
    for name, specification in specifications.items():
        properties[name] = specification.json_schema()
        top, _, rest = name.partition(".")
        if rest:
            inner.setdefault(top, {})[rest] = specification
    for top, below in inner.items():
        properties[top] = _nested(below)
    return {
        "type": "object",
        "properties": dict(sorted(properties.items())),
        "patternProperties": {"^(use_sim_time|qos_overrides.*)$": {}},
        "additionalProperties": False,
    }


def scenario_schema() -> str:
    """JSON schema of a scenario of the rig."""
    from hc_sim_rig.scenario import Scenario
    from hc_sim_rig.schema import json_schema

    return _json({"title": "Scenario of the hc rig", **json_schema(Scenario)})


def _json(schema: dict[str, Any]) -> str:
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "type": "object"}
    return json.dumps(head | schema, indent=1, ensure_ascii=False) + "\n"


@functools.cache
def _declared() -> dict[str, list[ParameterSpecification]]:
    """The parameters of each node, by name."""
    from hc_bringup.dashboard.node import DEFAULT_PORT, DashboardNode
    from hc_estimator.node import EstimatorNode
    from hc_estimator.ros.array_node import ArrayEstimatorNode
    from hc_logger.player_node import PlayerNode
    from hc_logger.recorder_node import RecorderNode
    from hc_logger.writer import BagWriter
    from hc_sim_rig.master_node import MasterNode
    from hc_sim_rig.node import IndenterNode
    from hc_sim_rig.ros.side_options import PORTS
    from hc_sim_rig.slave_node import SlaveNode

    with tempfile.TemporaryDirectory() as folder:
        bag = Path(folder) / "bag"
        with BagWriter(bag) as writer:  # a player needs something to play
            writer.write(writer.add_topic("/empty", "std_msgs/msg/Empty"), 0, b"\0\1\0\0\0")
        waits = ("true", "false")  # a side that runs would look for the other one
        # What a node cannot do without here, and what the page says instead of that.
        nodes: dict[str, tuple[Callable[[], Any], dict[str, tuple[str, Any]]]] = {
            "indenter": (IndenterNode, {}),
            "estimator": (EstimatorNode, {}),
            "array_estimator": (ArrayEstimatorNode, {}),
            "recorder": (RecorderNode, {"output": (f"{bag}_new", "")}),
            "player": (PlayerNode, {"bag": (str(bag), "")}),
            "master": (
                MasterNode,
                {"start_paused": waits, "link.port": ("0", str(PORTS["master"]))},
            ),
            "slave": (SlaveNode, {"start_paused": waits, "link.port": ("0", str(PORTS["slave"]))}),
            "dashboard": (DashboardNode, {"port": ("0", DEFAULT_PORT)}),
        }
        # The two sides compile as they are made, the others in a thread that goes on: made first,
        # the sides do not wait until all filters are compiled.
        order = sorted(nodes, key=lambda name: name not in ("master", "slave"))
        found = {name: _of_node(*nodes[name]) for name in order}
        return {name: found[name] for name in nodes}


def _of_node(
    make: Callable[[], Any], needed: dict[str, tuple[str, Any]]
) -> list[ParameterSpecification]:
    """The parameters of one node, which is made, asked and ended again."""
    import rclpy

    from hc_msgs_py.parameters import declared

    words = ["--ros-args"]
    for name, (value, _) in needed.items():
        words += ["-p", f"{name}:={value}"]
    rclpy.init(args=words)
    try:
        node = make()
        found = []
        for name, specification in sorted(declared(node).items()):
            value = node.get_parameter(name).value
            default = needed[name][1] if name in needed else value
            if not isinstance(default, (bool, int, float, str)):
                default = list(default)
            found.append(dataclasses.replace(specification, default=default))
        close = getattr(node, "close", None)
        if close is not None:
            close()
        node.destroy_node()
        return found
    finally:
        rclpy.shutdown()


def _described(specification: ParameterSpecification) -> str:
    unit = specification.unit_text
    return specification.description + (f" [{unit}]" if unit else "")


def _default(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return f"{value:g}"
    if not isinstance(value, (str, int)):
        return str([*value]).replace("''", "")
    return str(value)


def _allowed(specification: ParameterSpecification) -> str:
    """What is allowed, in words; with a mark if it is fixed once the node runs."""
    words = []
    if specification.choices:
        words = ["one of: " + ", ".join(specification.choices)]
    elif specification.kind == "auto":
        words = [specification.allowed]
    else:
        if specification.above is not None:
            words.append(f"above {specification.above:g}")
        elif specification.minimum is not None:
            words.append(f"from {specification.minimum:g}")
        if specification.maximum is not None:
            words.append(f"to {specification.maximum:g}")
    text = " ".join(words)
    return f"{text}; fixed at the start".removeprefix("; ") if specification.read_only else text


PAGES: Final[dict[str, Callable[[], str]]] = {
    "commands.md": commands_page,
    "topics.md": topics_page,
    "parameters.md": parameters_page,
    "python.md": functools.partial(api_page, _WRITTEN),
    "files.md": functools.partial(files_page, _WRITTEN),
    "parameters.schema.json": parameters_schema,
    "scenario.schema.json": scenario_schema,
}


def main() -> None:
    """Write the pages into the folder named on the command line."""
    if len(sys.argv) != 2 or sys.argv[1].startswith("-"):
        sys.exit("usage: python -m hc_bringup.reference docs/reference")
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    for name, page in PAGES.items():
        (folder / name).write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    main()
