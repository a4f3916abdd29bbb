"""Texts and hashes of message types, taken from the installed message packages.

A bag must carry the definition of its messages to be readable elsewhere. The installed packages
have it: share/PACKAGE/msg/NAME.msg is the text, NAME.json the type description with the hashes
that ROS itself uses (other tools compute different hashes for some types).
"""

from __future__ import annotations

import functools
import json
import os
import sys
from pathlib import Path
from typing import NamedTuple

from hc_logger.errors import UnknownTypeError

SEPARATOR = "=" * 80


class TypeDefinition(NamedTuple):
    """A message type: name (pkg/msg/Name), ros2msg text with all dependencies, RIHS01 hash."""

    name: str
    text: str
    type_hash: str


def damaged_definition(definition: TypeDefinition) -> str:
    """Return the line for a definition that cannot be understood."""
    return f"the definition of {definition.name[:100]!r} in the bag cannot be understood"


def same_definition(one: TypeDefinition, other: TypeDefinition) -> bool:
    """Whether two definitions are of one type, so that the messages of both read alike.

    Comments, spaces and the order of the dependencies do not count, nor hashes that differ: some
    tools compute others than ROS.
    """
    if one.name != other.name:
        return False
    if one.type_hash and one.type_hash == other.type_hash:
        return True
    return _bare_parts(one.text) == _bare_parts(other.text)


def _bare_parts(text: str) -> list[list[str]]:
    """Return the lines of each part that say something: the type's own, then the dependencies'."""
    own, *dependencies = (
        [
            bare
            for line in part.replace("/msg/", "/").splitlines()
            if (bare := " ".join(line.partition("#")[0].split()))
        ]
        for part in text.split(SEPARATOR)
    )
    return [own, *sorted(dependencies)]


@functools.cache
def installed_definition(type_name: str) -> TypeDefinition:
    """Return the definition of an installed message type.

    Args:
        type_name: for example "hc_msgs/msg/IndenterSample".

    Raises:
        UnknownTypeError: if the type is not installed or not a message.
    """
    description = json.loads(_find(type_name, ".json").read_text(encoding="utf-8"))
    hashes = {entry["type_name"]: entry["hash_string"] for entry in description["type_hashes"]}
    dependencies = [
        entry["type_name"]
        for entry in description["type_description_msg"]["referenced_type_descriptions"]
    ]
    parts = [_text(type_name)]
    for dependency in dependencies:
        package, _, name = dependency.split("/")
        parts.append(f"{SEPARATOR}\nMSG: {package}/{name}\n{_text(dependency)}")
    return TypeDefinition(type_name, "\n".join(parts), hashes[type_name])


def _text(type_name: str) -> str:
    return _find(type_name, ".msg").read_text(encoding="utf-8")


def _find(type_name: str, suffix: str) -> Path:
    """Return the installed file of a type; an ament workspace goes before this environment."""
    parts = type_name.split("/")
    if len(parts) != 3 or parts[1] != "msg":
        raise UnknownTypeError(f"{type_name!r} is not a message type like std_msgs/msg/Header")
    prefixes = [p for p in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if p]
    for prefix in [*prefixes, sys.prefix]:
        path = Path(prefix, "share", parts[0], "msg", parts[2] + suffix)
        if path.is_file():
            return path
    raise UnknownTypeError(
        f"message type {type_name} is not installed here; install the package {parts[0]}"
    )
