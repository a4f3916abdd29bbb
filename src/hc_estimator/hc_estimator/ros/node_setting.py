"""One setting of the estimator node: its default, what it means, and what it may be."""

from __future__ import annotations

import dataclasses
import math
from typing import Any


@dataclasses.dataclass(frozen=True)
class NodeSetting:
    """One setting of the node; its type is that of the default."""

    name: str
    default: Any
    description: str
    minimum: float | None = None
    maximum: float | None = None
    choices: tuple[str, ...] = ()
    unit: str = ""
    read_only: bool = False

    def check(self, value: Any) -> None:
        """Refuse a word that is no choice and a number that is not finite or out of range.

        Raises:
            ValueError: names the parameter, its value and what is allowed.
        """
        if self.choices and value not in self.choices:
            raise ValueError(
                f"parameter {self.name} = {value!r} is not one of {', '.join(self.choices)}"
            )
        if isinstance(self.default, (int, float)) and not isinstance(self.default, bool):
            low = -math.inf if self.minimum is None else self.minimum
            high = math.inf if self.maximum is None else self.maximum
            if not (math.isfinite(value) and low <= value <= high):
                unit = f" {self.unit}" if self.unit else ""
                raise ValueError(
                    f"parameter {self.name} = {value!r} is not a number from {low:g} to "
                    f"{high:g}{unit}"
                )
