"""Values from the command line (YAML) into messages and requests, as `ros2 topic pub` takes them.

rosidl_runtime_py, which does this in a ROS installation, has no wheel.
"""

from __future__ import annotations

import array
import importlib
from typing import Any

import numpy as np
from rosidl_parser.definition import (
    AbstractNestedType,
    Array,
    BasicType,
    BoundedSequence,
    BoundedString,
    NamespacedType,
)

from hc_bringup.errors import WRONG_USE, UserError

_INTEGERS = {
    f"{sign}int{bits}": (0 if sign else -(2 ** (bits - 1)), 2 ** (bits - (not sign)) - 1)
    for sign in ("", "u")
    for bits in (8, 16, 32, 64)
} | {"octet": (0, 255), "char": (0, 255)}


def fill(message: Any, values: dict[str, Any], path: str = "") -> None:
    """Write values by name into a message; fields that are not named stay as they are.

    Raises:
        UserError: for a field that the message does not have, or a value that does not fit it.
    """
    types = dict(zip(message.get_fields_and_field_types(), message.SLOT_TYPES, strict=True))
    for name, value in values.items():
        full = f"{path}.{name}" if path else str(name)
        if name not in types:
            known = ", ".join(types) or "none"
            field, colon, rest = str(name).partition(":")
            hint = f" (a space is missing: {field}: {rest})" if colon and field in types else ""
            raise UserError(f"there is no field {full}{hint}; fields there: {known}", WRONG_USE)
        try:
            setattr(message, name, _converted(types[name], getattr(message, name), value, full))
        except (AssertionError, TypeError, ValueError, OverflowError) as error:
            kind = message.get_fields_and_field_types()[name]
            raise UserError(f"{full}: {value!r} is no {kind}", WRONG_USE) from error


def _converted(kind: Any, current: Any, value: Any, path: str) -> Any:
    """Return a value as a field of a type takes it; raises TypeError or ValueError."""
    if isinstance(kind, AbstractNestedType):
        if not isinstance(value, (list, tuple)):
            raise TypeError("a list is wanted")
        if isinstance(kind, Array) and len(value) != kind.size:
            raise ValueError("another length is wanted")
        if isinstance(kind, BoundedSequence) and len(value) > kind.maximum_size:
            raise ValueError("too long")
        items = [
            _converted(kind.value_type, None, item, f"{path}[{i}]") for i, item in enumerate(value)
        ]
        if isinstance(current, np.ndarray):
            return np.array(items, current.dtype)
        return array.array(current.typecode, items) if isinstance(current, array.array) else items
    if isinstance(kind, NamespacedType):
        return _message(kind, value, path)
    if not isinstance(kind, BasicType):
        wanted: Any = str
    elif kind.typename == "boolean":
        wanted = bool
    elif kind.typename in _INTEGERS:
        wanted = int
        low, high = _INTEGERS[kind.typename]
        if isinstance(value, int) and not low <= value <= high:
            raise ValueError(f"from {low} to {high}")
    else:
        wanted = (int, float)
    if not isinstance(value, wanted) or (isinstance(value, bool) and wanted is not bool):
        raise TypeError("another type is wanted")
    if isinstance(kind, BoundedString) and len(value) > kind.maximum_size:
        raise ValueError("too long")
    if kind == BasicType("octet"):
        return bytes([value])
    return float(value) if wanted == (int, float) else value


def _message(kind: NamespacedType, value: Any, path: str) -> Any:
    if not isinstance(value, dict):
        raise TypeError("fields with values are wanted")
    module = importlib.import_module(".".join(kind.namespaces))
    message = getattr(module, kind.name)()
    fill(message, value, path)
    return message
