"""YAML as ROS's own reader of parameter files takes it.

It follows YAML 1.1 to the letter, where y, n, on and off are booleans, and takes 1e5 for a number;
PyYAML writes such texts without quotation marks. An axis that was written as y came back as true.
"""

from __future__ import annotations

import re
from typing import Any, Final

import yaml

_PLAIN: Final = re.compile(r"[A-Za-z_/][A-Za-z0-9_/.-]*")
_WORDS: Final = frozenset(
    ("y", "n", "yes", "no", "on", "off", "true", "false", "null", "inf", "infinity", "nan")
)


class _Dumper(yaml.SafeDumper):
    """Puts every text in quotation marks that could be read as anything else."""


def _represent(dumper: yaml.SafeDumper, text: str) -> yaml.ScalarNode:
    style = None if _is_plain(text) else '"'
    return dumper.represent_scalar("tag:yaml.org,2002:str", text, style=style)


_Dumper.add_representer(str, _represent)


def _is_plain(text: str) -> bool:
    return _PLAIN.fullmatch(text) is not None and text.lower() not in _WORDS


def dump_for_ros(tree: Any) -> str:
    """Return plain data as YAML, dictionaries in their order."""
    text: str = yaml.dump(tree, Dumper=_Dumper, default_flow_style=False, sort_keys=False)
    return text


def scalar_for_ros(text: str) -> str:
    """Return a text as it is to stand behind a key."""
    if _is_plain(text):
        return text
    return dump_for_ros({"": text}).partition(": ")[2].rstrip("\n")


def text_of_boolean(value: bool, choices: tuple[str, ...]) -> str | None:
    """Return the choice that stood in a file where ROS read a boolean, None if there is none."""
    word = "y" if value else "n"
    return word if word in choices else None
