"""Says when a node was given a parameter file that holds nothing for it.

ROS takes a file with parameters for a node of another name, or of another namespace, without a
word, and the node then runs with its defaults: of two nodes of one program, the second one usually.
"""

from __future__ import annotations

import itertools
import re
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from hc_msgs_py.plain_yaml import PlainYamlError, read_plain_yaml

PARAMETERS_KEY = "ros__parameters"


def files_for_others(arguments: Sequence[str] | None, full_name: str) -> list[str]:
    """Return a line for each parameter file that has no section for a node.

    Args:
        arguments: command line with ROS arguments; None takes sys.argv.
        full_name: of the node, with its namespace.
    """
    words = list(sys.argv if arguments is None else arguments)
    lines = []
    for option, file in itertools.pairwise(words):
        if option != "--params-file":
            continue
        try:
            data = read_plain_yaml(Path(file))
        except (OSError, PlainYamlError) as error:  # ROS has read it, in its own way
            lines.append(f"{file}: {error}: whether it has parameters for {full_name} is not known")
            continue
        names = section_names(data) if isinstance(data, dict) else []
        if names and not any(is_for(name, full_name) for name in names):
            lines.append(
                f"{file} has no parameters for {full_name}, only for {', '.join(names)}: the "
                f"defaults hold (write {full_name}: or /**: there)"
            )
    return lines


def section_names(data: dict[Any, Any]) -> list[str]:
    """Return the full names of the nodes that have parameters."""
    return [name for name, _values in _sections(data, "")]


def sections_for(data: dict[Any, Any], full_name: str) -> list[Any]:
    """Return the parameters of a file that are for a node; what is for it alone comes last.

    Args:
        data: the file's.
        full_name: of the node, with its namespace.
    """
    found = [section for section in _sections(data, "") if is_for(section[0], full_name)]
    return [values for _name, values in sorted(found, key=lambda s: s[0] == full_name)]


def _sections(data: dict[Any, Any], prefix: str) -> Iterator[tuple[str, Any]]:
    """Yield the full name of each node that has parameters, and them."""
    for key, value in data.items():
        name = f"{prefix}/{str(key).strip('/')}"
        if isinstance(value, dict) and PARAMETERS_KEY in value:
            yield name, value[PARAMETERS_KEY]
        elif isinstance(value, dict):
            yield from _sections(value, name)


def is_for(section: str, full_name: str) -> bool:
    """Whether a section is for a node; `*` stands for one part of its name, `**` for any."""
    pattern = re.escape(section).replace(r"/\*\*", r"(/\w+)*").replace(r"/\*", r"/\w+")
    return re.fullmatch(pattern, full_name) is not None
