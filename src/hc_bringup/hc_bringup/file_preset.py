"""How a machine writes its files, kept in a YAML: what --preset takes.

The keys are the options themselves; what is given on the command line goes before them.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from hc_bringup.errors import WRONG_USE, UserError
from hc_bringup.paths import find_config
from hc_msgs_py.nearest import hint

OF_THE_FILE: dict[str, tuple[tuple[type, ...], str]] = {
    "separator": ((str,), "a word"),
    "decimal": ((str,), "a point or a comma"),
    "header_lines": ((int,), "a whole number >= 0"),
    "encoding": ((str,), "a word"),
    "rate": ((int, float), "a number > 0"),
}
_USABLE: dict[str, Callable[[Any], bool]] = {
    "decimal": lambda value: value in (".", ","),
    "header_lines": lambda value: value >= 0,
    "rate": lambda value: 0.0 < value <= sys.float_info.max,
}
"""Values of the right type that an option takes; of the others any that is not empty."""
CSV_OPTIONS = ("columns", "units", *OF_THE_FILE)
"""Options that say how a text file is written: whoever repeats a command line repeats them all."""
KEYS = (*CSV_OPTIONS, "input", "find_surface")


def apply(arguments: argparse.Namespace) -> None:
    """Take what the preset says into the options that were not given; it is then done with.

    Raises:
        UserError: if there is no such file, or it says what no option says.
    """
    name = getattr(arguments, "preset", None)
    if not name:
        return
    arguments.preset = None
    path = find_config(name)
    content = _read(path)
    for key in ("columns", "units"):
        if getattr(arguments, key) is None and key in content:
            parts = _mapping(path, key, content[key])
            setattr(arguments, key, ",".join(f"{k}={v}" for k, v in parts.items()))
    for key, (kinds, called) in OF_THE_FILE.items():
        value = content.get(key)
        if value is None:
            continue
        if not (type(value) in kinds and _USABLE.get(key, bool)(value)):
            raise UserError(f"--preset {path}: {key}: {value} is not {called}", WRONG_USE)
        if getattr(arguments, key) is None:
            setattr(arguments, key, value)
    given = {name for name, _ in arguments.sensors}
    sensors = _mapping(path, "input", content.get("input", {}))
    arguments.sensors = [
        *((name, value) for name, value in sensors.items() if name not in given),
        *arguments.sensors,
    ]
    finds = content.get("find_surface", False)
    if not isinstance(finds, bool):
        raise UserError(f"--preset {path}: find_surface: {finds} is not true or false", WRONG_USE)
    arguments.find_surface = arguments.find_surface or finds


def _read(path: Path) -> dict[str, Any]:
    from hc_bringup.parameter_file import read_yaml

    content = read_yaml(path)
    if isinstance(content, dict) and "nodes" in content:
        raise UserError(
            f"--preset {path} is of a robot, not of a file: start it with hc run", WRONG_USE
        )
    for key in _mapping(path, "the file", content):
        if key not in KEYS:
            known = hint(key, KEYS, "known")
            raise UserError(f"--preset {path}: no key {key!r}; {known}", WRONG_USE)
    return dict(content)


def _mapping(path: Path, what: str, value: Any) -> dict[str, Any]:
    if not isinstance(value, dict) or not all(isinstance(key, str) for key in value):
        raise UserError(f"--preset {path}: {what} is no mapping of names to values", WRONG_USE)
    return value
