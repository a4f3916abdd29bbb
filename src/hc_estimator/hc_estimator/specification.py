"""What a parameter is: name, type, default, range, unit, meaning; and the check of given values.

The modules of the package declare their parameters as `ParameterSpecification`; the ROS node
declares its ROS parameters from them and the documentation is generated from them.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Mapping
from typing import Any, Literal

ParameterValue = bool | int | float | str
Kind = Literal["bool", "int", "float", "str", "auto"]
AUTO = "auto"


@dataclasses.dataclass(frozen=True)
class ParameterSpecification:
    """One parameter of an estimator, as plain data.

    Attributes:
        name: unique within the package.
        kind: "bool", "int", "float", "str", or "auto" for a number or the text 'auto'.
        default: value when none is given.
        minimum: smallest allowed number (numbers only).
        maximum: largest allowed number (numbers only).
        choices: allowed texts (kind "str" only).
        unit: unit of a number, "1" where it has none.
        description: what it does, in one or two sentences.
        runtime: True if `Estimator.reconfigure` may change it while the estimator runs.
    """

    name: str
    kind: Kind
    default: ParameterValue
    description: str
    minimum: float | None = None
    maximum: float | None = None
    choices: tuple[str, ...] = ()
    unit: str = "1"
    runtime: bool = True

    @property
    def allowed(self) -> str:
        """The allowed range in words."""
        if self.kind == "bool":
            return "true or false"
        if self.kind == "str":
            return "one of " + ", ".join(self.choices)
        unit = "" if self.unit == "1" else f" {self.unit}"
        if self.kind == "auto":
            return f"'auto' or a number from {self.minimum:g} to {self.maximum:g}{unit}"
        word = "an integer" if self.kind == "int" else "a number"
        return f"{word} from {self.minimum:g} to {self.maximum:g}{unit}"

    def checked(self, value: object) -> ParameterValue:
        """The value in the parameter's own type.

        Args:
            value: given value; an int is taken for a float, a whole float for an int.

        Returns:
            The value as bool, int, float or str.

        Raises:
            ValueError: wrong type or out of range; names parameter, value and allowed range.
        """
        result: ParameterValue | None = None
        if self.kind == "bool":
            if isinstance(value, bool) or type(value).__name__ == "bool":  # numpy's bool too
                result = bool(value)
        elif self.kind == "str":
            if isinstance(value, str) and value in self.choices:
                result = value
        elif self.kind == "auto" and isinstance(value, str):
            result = _auto_or_number(value)
            if isinstance(result, float):
                result = self._checked_number(result)
        elif isinstance(value, (int, float)) or hasattr(value, "__float__"):
            result = self._checked_number(value)
        if result is None:
            raise ValueError(f"parameter {self.name} = {value!r} is not {self.allowed}")
        return result

    def _checked_number(self, value: Any) -> float | int | None:
        if isinstance(value, bool) or type(value).__name__ == "bool":
            return None
        try:
            number = float(value)
        except (TypeError, ValueError, OverflowError):
            return None
        assert self.minimum is not None
        assert self.maximum is not None
        if not (math.isfinite(number) and self.minimum <= number <= self.maximum):
            return None
        if self.kind == "int":
            return int(number) if number == int(number) else None
        return number

    def encoded(self, value: ParameterValue) -> float | int:
        """The number that stands for a checked value in the settings record."""
        if self.kind == "auto":
            return math.nan if value == AUTO else float(value)
        if isinstance(value, str):
            return self.choices.index(value)
        return value if self.kind == "float" else int(value)


def _auto_or_number(text: str) -> float | str | None:
    """The text 'auto', the number that a text holds, or nothing."""
    if text == AUTO:
        return text
    try:
        return float(text)
    except ValueError:
        return None


def with_defaults(
    specifications: Iterable[ParameterSpecification], defaults: Mapping[str, ParameterValue]
) -> tuple[ParameterSpecification, ...]:
    """The same specifications with some defaults replaced.

    Args:
        specifications: the specifications.
        defaults: default by name; names that do not occur are ignored, so that a filter can give
            defaults for parameters of whichever state space it is combined with.

    Returns:
        Specifications in the same order.
    """
    return tuple(
        dataclasses.replace(s, default=s.checked(defaults[s.name])) if s.name in defaults else s
        for s in specifications
    )


def checked_values(
    specifications: Iterable[ParameterSpecification],
    given: Mapping[str, object],
    *,
    runtime_only: bool = False,
) -> dict[str, ParameterValue]:
    """Check a set of values before any of them is used.

    Args:
        specifications: what is allowed.
        given: values by name.
        runtime_only: refuse parameters that are fixed once the estimator exists.

    Returns:
        The given values, each in its parameter's type.

    Raises:
        ValueError: unknown name, wrong type, out of range, or fixed while running.
    """
    by_name = {s.name: s for s in specifications}
    result = {}
    for name, value in given.items():
        if name not in by_name:
            raise ValueError(
                f"parameter {name} = {value!r} is unknown here; known: {', '.join(sorted(by_name))}"
            )
        specification = by_name[name]
        result[name] = specification.checked(value)
        if runtime_only and not specification.runtime:
            raise ValueError(
                f"parameter {name} = {value!r} cannot change while the estimator runs: "
                f"create a new estimator with it ({specification.allowed})"
            )
    return result
