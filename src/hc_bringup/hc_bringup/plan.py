"""What a run consists of: nodes, their parameters and order, read from one YAML and checked.

The source of samples comes first: it is started last and stopped first, so that nothing is lost
at either end.
"""

from __future__ import annotations

import difflib
import os
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from hc_bringup.errors import WRONG_USE, UserError
from hc_bringup.file_preset import KEYS
from hc_bringup.parameter_file import check_parameter_file, read_yaml
from hc_msgs_py.topics import NODE_DASHBOARD, NODE_ESTIMATOR, NODE_RECORDER

_RUN_KEYS = ("duration_s", "nodes")
_NODE_KEYS = ("name", "namespace", "module", "parameter_files", "parameters", "source", "respawn")
PARAMETERS = "ros__parameters"
_OF_ALL = (NODE_RECORDER, NODE_DASHBOARD)
_ESTIMATOR_MODULE = "hc_estimator.node"


@dataclass(frozen=True)
class NodePlan:
    """One node of a run.

    Attributes:
        name: ROS name of the node, with its namespace if it has one: left/estimator.
        module: Python module that is run with `python -m`.
        parameter_files: ROS parameter files, in the order in which they are applied.
        parameters: parameters that win over the files.
        source: True for the node that publishes the samples; its ~/run service starts them.
        respawn: True if the node is started again when it dies.
        terminal: True if the node reads keys from the terminal.
    """

    name: str
    module: str
    parameter_files: tuple[Path, ...] = ()
    parameters: Mapping[str, Any] = field(default_factory=dict)
    source: bool = False
    respawn: bool = False
    terminal: bool = False

    @property
    def namespace(self) -> str:
        """Where its topics are, without the first slash; empty for most nodes."""
        return self.name.rpartition("/")[0]

    @property
    def kind(self) -> str:
        """Its name without the namespace."""
        return self.name.rpartition("/")[2]


@dataclass(frozen=True)
class RunPlan:
    """All nodes of a run and how long it lasts (0: until a signal or the source ends)."""

    nodes: tuple[NodePlan, ...]
    duration_s: float = 0.0

    def node(self, name: str) -> NodePlan | None:
        """Return the node of that name, or None."""
        return next((n for n in self.nodes if n.name == name), None)

    def of_kind(self, kind: str) -> tuple[NodePlan, ...]:
        """Return the nodes of that name in whatever namespace."""
        return tuple(node for node in self.nodes if node.kind == kind)


def load_plan(path: Path) -> RunPlan:
    """Read and check a run configuration.

    Raises:
        UserError: with the file, the key and what is allowed, for whatever is wrong in it.
    """
    data = read_yaml(path)
    if not isinstance(data, dict):
        raise UserError(f"{path} must have the keys {', '.join(_RUN_KEYS)}", WRONG_USE)
    if "nodes" not in data and data.keys() & set(KEYS):
        raise UserError(
            f"{path} is of files, not of a robot: hc estimate FILE --preset {path.stem}", WRONG_USE
        )
    if any(isinstance(node, dict) and PARAMETERS in node for node in data.values()):
        run = path.with_name(f"{path.stem}_run{path.suffix}")
        do = f"hc run {run}" if run.is_file() else "config/robot_run.yaml shows such a run"
        raise UserError(
            f"{path} holds parameters of nodes; a run names it among the parameter_files of its "
            f"nodes: {do}",
            WRONG_USE,
        )
    _check_keys(data, _RUN_KEYS, str(path))
    duration = data.get("duration_s", 0.0)
    if isinstance(duration, bool) or not (
        isinstance(duration, (int, float)) and 0 <= duration <= sys.float_info.max
    ):
        raise UserError(f"{path}: duration_s is {duration!r:.40}; give seconds >= 0", WRONG_USE)
    entries = data.get("nodes")
    if not isinstance(entries, list) or not entries:
        raise UserError(f"{path}: nodes must list at least one node", WRONG_USE)
    nodes = tuple(_node(entry, path, i) for i, entry in enumerate(entries, 1))
    names = [node.name for node in nodes]
    if len(set(names)) != len(names):
        raise UserError(f"{path}: two nodes have the same name among {', '.join(names)}", WRONG_USE)
    return RunPlan(nodes, float(duration))


def _node(entry: Any, path: Path, number: int) -> NodePlan:
    where = f"{path}: node {number}"
    if not isinstance(entry, dict):
        raise UserError(f"{where} must have the keys {', '.join(_NODE_KEYS)}", WRONG_USE)
    _check_keys(entry, _NODE_KEYS, where)
    for key in ("name", "module"):
        value = entry.get(key)
        if not isinstance(value, str) or not value.replace(".", "_").isidentifier():
            raise UserError(f"{where}: {key} is {value!r}; give a name", WRONG_USE)
    name = _full_name(entry, where)
    files = entry.get("parameter_files", [])
    if not isinstance(files, list) or not all(isinstance(f, str) for f in files):
        raise UserError(f"{where}: parameter_files must be a list of files", WRONG_USE)
    if any("\0" in f for f in files):
        raise UserError(f"{where}: a name in parameter_files is no file name", WRONG_USE)
    resolved = tuple(Path(os.path.realpath(path.parent / f)) for f in files)  # a loop is no file
    for file in resolved:
        if not file.is_file():
            raise UserError(f"{where}: there is no parameter file {file}", WRONG_USE)
        check_parameter_file(file, name)
    parameters = entry.get("parameters", {})
    if not isinstance(parameters, dict) or not all(isinstance(k, str) for k in parameters):
        raise UserError(f"{where}: parameters must be names with values", WRONG_USE)
    for key in ("source", "respawn"):
        if not isinstance(entry.get(key, False), bool):
            raise UserError(f"{where}: {key} is {entry[key]!r}; give true or false", WRONG_USE)
    return NodePlan(
        name=name,
        module=entry["module"],
        parameter_files=resolved,
        parameters=parameters,
        source=entry.get("source", False),
        respawn=entry.get("respawn", False),
    )


def _full_name(entry: Mapping[str, Any], where: str) -> str:
    """Return the name of a node with its namespace."""
    name, space = entry["name"], entry.get("namespace", "")
    parts = space.strip("/").split("/") if isinstance(space, str) else [""]
    if entry["module"] == _ESTIMATOR_MODULE and name != NODE_ESTIMATOR:
        raise UserError(
            f"{where}: an estimator is called {NODE_ESTIMATOR}, not {name}, for by that name it is "
            "followed; a second one has a namespace of its own, where its topics are: "
            f"name: {NODE_ESTIMATOR}, namespace: {name.replace('.', '_')}",
            WRONG_USE,
        )
    if space == "":
        return str(name)
    if not all(part.isidentifier() and part.isascii() for part in parts):
        raise UserError(f"{where}: namespace is {space!r:.40}; give a name, like left", WRONG_USE)
    if name in _OF_ALL:
        raise UserError(
            f"{where}: a {name} is for the topics of all namespaces: leave namespace away",
            WRONG_USE,
        )
    return "/".join((*parts, name))


def _check_keys(data: Mapping[str, Any], allowed: tuple[str, ...], where: str) -> None:
    for key in data:
        if key not in allowed:
            close = difflib.get_close_matches(str(key), allowed, n=1)
            hint = f"did you mean {close[0]}?" if close else f"allowed: {', '.join(allowed)}"
            raise UserError(f"{where}: unknown key {key!r}; {hint}", WRONG_USE)
