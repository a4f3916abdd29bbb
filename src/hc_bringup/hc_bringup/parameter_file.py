"""Looks into a ROS parameter file before a node gets it.

The middleware takes a file that is plain text, or one with parameters for a node of another name,
without a word, and the node then runs with its defaults.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from hc_bringup.errors import WRONG_USE, UserError
from hc_msgs_py.parameter_sections import PARAMETERS_KEY, is_for, section_names
from hc_msgs_py.plain_yaml import PlainYamlError, read_plain_yaml


def read_yaml(path: Path) -> Any:
    """Return what a YAML file holds.

    Raises:
        UserError: if it cannot be read or is not YAML; one line.
    """
    try:
        return read_plain_yaml(path)
    except OSError as error:
        raise UserError(f"cannot read {path}: {error.strerror}", WRONG_USE) from error
    except PlainYamlError as error:
        raise UserError(f"{path} is not valid YAML: {error}", WRONG_USE) from error


def check_parameter_file(path: Path, node_name: str) -> None:
    """See that a file has parameters for a node.

    Args:
        path: the file.
        node_name: with its namespace, without the first slash.

    Raises:
        UserError: if it has none; the message says what it has.
    """
    data = read_yaml(path)
    names = section_names(data) if isinstance(data, dict) else []
    if not names:
        raise UserError(
            f"{path} is no ROS parameter file: give {node_name}: {PARAMETERS_KEY}: with the "
            "parameters below",
            WRONG_USE,
        )
    if not any(is_for(name, f"/{node_name}") for name in names):
        others = ", ".join(name.removeprefix("/") for name in names)
        raise UserError(
            f"{path} has no parameters for node {node_name}, only for {others}: name it there, or "
            "write /**:",
            WRONG_USE,
        )
