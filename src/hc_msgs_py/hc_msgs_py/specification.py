"""What a parameter is: name, type, default, range, unit, meaning; and the check of given values.

The suite's one description of a parameter, whoever has it: the filters' settings, those of the
nodes, the rig's scenarios. Nodes declare their ROS parameters from it, the reference pages and the
JSON schemas for editors are written from it. Free of ROS.
"""

from __future__ import annotations

import array
import dataclasses
import math
from collections.abc import Sequence
from typing import Any, Literal

ParameterValue = bool | int | float | str
Kind = Literal["bool", "int", "float", "str", "auto", "numbers", "texts"]
AUTO = "auto"
_LISTS = {"numbers": float, "texts": str}


@dataclasses.dataclass(frozen=True)
class ParameterSpecification:
    """One parameter, as plain data.

    Attributes:
        name: unique among those of its owner.
        kind: "bool", "int", "float", "str", "numbers" or "texts" (lists of any length), or "auto"
            for a number or the text 'auto'.
        default: value when none is given.
        minimum: smallest allowed number; None for no limit.
        maximum: largest allowed number; None for no limit.
        above: if given, a number must lie strictly above it.
        choices: allowed texts (kind "str"); none: any text.
        unit: unit of a number, "1" or "" where it has none.
        description: what it does, in one or two sentences.
        runtime: True if `Estimator.reconfigure` may change it while the estimator runs.
        read_only: True if a node takes it at its start only.
    """

    name: str
    kind: Kind
    default: Any
    description: str
    minimum: float | None = None
    maximum: float | None = None
    choices: tuple[str, ...] = ()
    unit: str = "1"
    runtime: bool = True
    read_only: bool = False
    above: float | None = None

    @property
    def unit_text(self) -> str:
        """The unit, nothing where there is none."""
        return "" if self.unit == "1" else self.unit

    @property
    def allowed(self) -> str:
        """The allowed range in words."""
        if self.kind == "bool":
            return "true or false"
        if self.kind == "str":
            return "one of " + ", ".join(self.choices) if self.choices else "a text"
        if self.kind in _LISTS:
            return "a list of numbers" if self.kind == "numbers" else "a list of texts"
        word = {"int": "an integer", "float": "a number", "auto": "'auto' or a number"}[self.kind]
        low = f" from {self.minimum:g}" if self.minimum is not None else ""
        if self.above is not None:
            low = f" above {self.above:g}"
        high = "" if self.maximum is None else f" to {self.maximum:g}"
        return f"{word}{low}{high}{' ' if self.unit_text else ''}{self.unit_text}"

    def checked(self, value: object) -> Any:
        """The value in the parameter's own type.

        Args:
            value: given value; an int is taken for a float, a whole float for an int.

        Returns:
            The value as bool, int, float, str or list of them.

        Raises:
            ValueError: wrong type or out of range; names parameter, value and allowed range.
        """
        result = self.accepted(value)
        if result is None:
            raise ValueError(f"parameter {self.name} = {value!r} is not {self.allowed}")
        return result

    def accepted(self, value: Any) -> Any:
        """The value in the parameter's own type; None if it is of another type or out of range."""
        if self.kind == "bool":
            return bool(value) if _is_bool(value) else None
        if self.kind == "str":
            good = isinstance(value, str) and (not self.choices or value in self.choices)
            return value if good else None
        if self.kind in _LISTS:
            return self._accepted_list(value)
        if self.kind == "auto" and isinstance(value, str):
            value = _auto_or_number(value)
            if value is None or value == AUTO:
                return value
        if isinstance(value, (int, float)) or hasattr(value, "__float__"):
            return self._accepted_number(value)
        return None

    def _accepted_list(self, value: Any) -> list[Any] | None:
        if not isinstance(value, (list, tuple, array.array)):
            return None
        kind = _LISTS[self.kind]
        if kind is str:
            return list(value) if all(isinstance(v, str) for v in value) else None
        if any(_is_bool(v) or not isinstance(v, (int, float)) for v in value):
            return None
        try:
            return [float(v) for v in value]
        except OverflowError:
            return None

    def _accepted_number(self, value: Any) -> float | int | None:
        if _is_bool(value):
            return None
        try:
            number = float(value)
        except (TypeError, ValueError, OverflowError):
            return None
        low = -math.inf if self.minimum is None else self.minimum
        high = math.inf if self.maximum is None else self.maximum
        exact = value if isinstance(value, int) else number  # a float64 has not every integer
        if not (math.isfinite(number) and low <= exact <= high):
            return None
        if self.above is not None and number <= self.above:
            return None
        if self.kind == "int":
            return int(value) if number == int(number) else None
        return number

    def encoded(self, value: ParameterValue) -> float | int:
        """The number that stands for a checked value in the settings record."""
        if self.kind == "auto":
            return math.nan if value == AUTO else float(value)
        if isinstance(value, str):
            return self.choices.index(value)
        return value if self.kind == "float" else int(value)

    def json_schema(self) -> dict[str, Any]:
        """What a value may be, as a JSON schema (draft 2020-12), for editors."""
        if self.kind in _LISTS:
            item = "number" if self.kind == "numbers" else "string"
            schema: dict[str, Any] = {"type": "array", "items": {"type": item}}
        else:
            schema = {"type": _JSON_TYPES.get(self.kind, "number")}
        if self.choices:
            schema["enum"] = list(self.choices)
        limits = {
            "minimum": self.minimum if self.above is None else None,
            "exclusiveMinimum": self.above,
            "maximum": self.maximum,
        }
        schema |= {name: limit for name, limit in limits.items() if limit is not None}
        if self.kind == "auto":
            schema = {"anyOf": [{"const": AUTO}, schema]}
        unit = f" [{self.unit_text}]" if self.unit_text else ""
        schema["description"] = f"{self.description}{unit}"
        if self.default is not None:
            schema["default"] = self.default
        return schema


_JSON_TYPES = {"bool": "boolean", "int": "integer", "str": "string"}


def setting(
    name: str,
    default: Any,
    description: str,
    *,
    minimum: float | None = None,
    maximum: float | None = None,
    choices: Sequence[str] = (),
    unit: str = "",
    read_only: bool = False,
) -> ParameterSpecification:
    """A specification whose kind is that of its default."""
    kind: Kind
    if isinstance(default, bool):
        kind = "bool"
    elif isinstance(default, int):
        kind = "int"
    elif isinstance(default, float):
        kind = "float"
    elif isinstance(default, str):
        kind = "str"
    else:
        kind = "numbers" if default and isinstance(default[0], (int, float)) else "texts"
    return ParameterSpecification(
        name,
        kind,
        default,
        description,
        minimum=minimum,
        maximum=maximum,
        choices=tuple(choices),
        unit=unit,
        read_only=read_only,
    )


def _is_bool(value: Any) -> bool:
    return isinstance(value, bool) or type(value).__name__ == "bool"  # numpy's too


def _auto_or_number(text: str) -> float | str | None:
    """The text 'auto', the number that a text holds, or nothing."""
    if text == AUTO:
        return text
    try:
        return float(text)
    except ValueError:
        return None
