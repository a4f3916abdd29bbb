"""Messages as YAML or CSV text, as `ros2 topic echo` prints them.

rosidl_runtime_py, which does this in a ROS installation, has no wheel.
"""

from __future__ import annotations

import array
from typing import Any

import numpy as np
import yaml

from hc_bringup.errors import WRONG_USE, UserError


def plain(value: Any, *, arrays: bool = True) -> Any:
    """Return a message (or a field of one) as dictionaries, lists, numbers and strings.

    Args:
        value: message or field.
        arrays: False replaces arrays by a note of their length.
    """
    if hasattr(value, "get_fields_and_field_types"):
        return {
            name: plain(getattr(value, name), arrays=arrays)
            for name in value.get_fields_and_field_types()
        }
    if isinstance(value, (np.ndarray, array.array, list, tuple)):
        if not arrays:
            return f"<array of {len(value)}>"
        return [plain(item) for item in (value.tolist() if hasattr(value, "tolist") else value)]
    if isinstance(value, (bytes, bytearray)):
        return list(value) if len(value) != 1 else value[0]
    return value.item() if isinstance(value, np.generic) else value


def as_yaml(value: Any, *, arrays: bool = True) -> str:
    """Return a message as a YAML document without its separator."""
    data = plain(value, arrays=arrays)
    text: str = yaml.safe_dump(data, sort_keys=False, default_flow_style=None, width=10_000)
    return text.removesuffix("...\n")


def as_csv(value: Any) -> str:
    """Return all scalars of a message as one line of comma-separated values."""
    return ",".join(_scalars(plain(value)))


def _scalars(value: Any) -> list[str]:
    if isinstance(value, dict):
        value = list(value.values())
    if isinstance(value, list):
        return [scalar for item in value for scalar in _scalars(item)]
    return [str(value)]


def field(message: Any, path: str) -> Any:
    """Return a field of a message by its dotted path, with [i] for elements of arrays.

    Raises:
        UserError: if there is no such field; the message lists those that there are.
    """
    value = message
    for part in path.replace("[", ".[").split("."):
        if part.startswith("[") and part.endswith("]"):
            try:
                value = value[int(part[1:-1])]
            except (ValueError, IndexError, TypeError) as error:
                raise UserError(f"no element {part} in {path!r}", WRONG_USE) from error
            continue
        names: dict[str, str] = getattr(value, "get_fields_and_field_types", dict)()
        if part not in names:
            known = ", ".join(names) or "none"
            kind = type(value)
            what = f"{kind.__module__.split('.')[0]}/{kind.__name__}" if names else path
            raise UserError(f"no field {part!r} in {what}; fields there: {known}", WRONG_USE)
        value = getattr(value, part)
    return value
