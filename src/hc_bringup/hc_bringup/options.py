"""Types of command-line options, with messages that say what is allowed."""

from __future__ import annotations

import argparse
import math
import re
from collections.abc import Iterable
from typing import Any, Final

from hc_bringup.errors import WRONG_USE, UserError
from hc_msgs_py.plain_yaml import PlainYamlError, load_plain_yaml

LARGEST_WHOLE: Final = 2**63 - 1
"""Of a parameter of ROS."""
OTHER_ENDINGS: Final = (
    *(".txt", ".tsv", ".dat", ".gz", ".bz2", ".xz", ".zst", ".zip"),
    *(".parquet", ".mat", ".xlsx", ".xls", ".json", ".db3", ".bag", ".html"),
)
"""Of files that are neither CSV nor a bag as it is written here (a folder with .mcap)."""
_ORIGIN = re.compile(r"[a-z][a-z0-9+.-]*://(\[[0-9a-f:]+\]|[a-z0-9._-]+)(:[0-9]{1,5})?")


def seconds(text: str) -> float:
    """Parse a duration: a finite number >= 0."""
    return _number(text, 0.0, "seconds >= 0")


def millimetres(text: str) -> float:
    """Parse a length: a finite number >= 0."""
    return _number(text, 0.0, "millimetres >= 0")


def newtons(text: str) -> float:
    """Parse a force: a finite number >= 0."""
    return _number(text, 0.0, "newtons >= 0")


def positive(text: str) -> float:
    """Parse a finite number > 0."""
    value = _number(text, 0.0, "a number > 0")
    if value == 0.0:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number > 0")
    return value


def natural(text: str) -> int:
    """Parse a whole number from 0 to that which a node takes at most."""
    value = _number(text, 0.0, "a whole number >= 0")
    if value != int(value):
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number >= 0")
    # Beyond 2^53 a float is another number than that which stands there.
    whole = int(text) if text.strip().lstrip("+").isdigit() else int(value)
    if whole > LARGEST_WHOLE:
        raise argparse.ArgumentTypeError(f"{text!r} is larger than {LARGEST_WHOLE}")
    return whole


def port_number(text: str) -> int:
    """Parse a port: a whole number from 0 to 65535."""
    value = _number(text, 0.0, "a port from 0 to 65535")
    if value != int(value) or value > 65535:
        raise argparse.ArgumentTypeError(f"{text!r} is not a port from 0 to 65535")
    return int(value)


def new_file_name(text: str) -> str:
    """Take the name of a file to write; standard output has the summary."""
    if text == "-":
        raise argparse.ArgumentTypeError("'-' is no file: name one, out.csv say")
    return text


def bag_folder_name(text: str) -> str:
    """Take the name of a bag's folder to write; one that says it is something else is refused."""
    _refuse_endings(text, (".csv", *OTHER_ENDINGS), "that of a bag's folder")
    return text


def bag_or_csv_name(text: str) -> str:
    """Take the name of a CSV file or of a bag's folder to write."""
    _refuse_endings(text, OTHER_ENDINGS, "one that ends in .csv, or that of a bag's folder")
    return text


def _refuse_endings(text: str, endings: tuple[str, ...], instead: str) -> None:
    if text.lower().endswith(endings):
        raise argparse.ArgumentTypeError(f"{text!r} is no name for what is written: give {instead}")


def namespace(text: str) -> str:
    """Parse a namespace of nodes: names with slashes between them."""
    parts = text.strip("/").split("/")
    if not all(part.isidentifier() and part.isascii() for part in parts):
        raise argparse.ArgumentTypeError(f"{text!r} is no namespace: give a name, like left")
    return "/".join(parts)


def origin(text: str) -> str:
    """Parse an origin as browsers send it: scheme, host and port, in small letters, no path."""
    if _ORIGIN.fullmatch(text) is None:
        raise argparse.ArgumentTypeError(
            f"{text!r} is not an origin: scheme://host or scheme://host:port in small letters, "
            "without a slash or path behind it"
        )
    return text


def assignment(text: str) -> tuple[str, Any]:
    """Parse name=value; the value is read as YAML, so numbers, words, lists and true work."""
    name, separator, value = text.partition("=")
    if not separator or not name:
        raise argparse.ArgumentTypeError(f"{text!r} is not of the form name=value")
    try:
        parsed = load_plain_yaml(value)
    except PlainYamlError:
        return name, value
    if isinstance(parsed, str) and not value.startswith(("'", '"')):
        try:
            number = float(parsed)  # to YAML 1e-3 is a text, for want of a point
        except ValueError:
            return name, parsed
        return name, number if math.isfinite(number) else parsed
    return name, parsed


def each_once(assignments: Iterable[tuple[str, Any]], option: str) -> dict[str, Any]:
    """Return assignments by their names.

    Args:
        assignments: names and values, as `assignment` returns them.
        option: that they were given with.

    Raises:
        UserError: if a name stands there twice: which of them was meant, nobody knows.
    """
    found: dict[str, Any] = {}
    for name, value in assignments:
        if name in found:
            raise UserError(f"{option} {name} is given twice", WRONG_USE)
        found[name] = value
    return found


def _number(text: str, minimum: float, what: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value >= minimum):
        raise argparse.ArgumentTypeError(f"{text!r} is not {what}")
    return value
