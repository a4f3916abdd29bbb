"""What a contact law is to the estimators: its force, its gradient, and what it lacks."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Any

from hc_estimator.specification import ParameterSpecification

ESTIMATED = math.nan
"""In `ContactLaw.fixed`: the law has this parameter, and it is estimated."""


@dataclasses.dataclass(frozen=True)
class ContactLaw:
    """A law F(d, v; K, B, n, p).

    Both functions are compiled (hc_estimator.compilation.compiled) and take displacement d [mm],
    velocity v [mm/s], stiffness K, damping B, displacement exponent n and velocity exponent p, all
    as numbers. Every finite argument must give a finite result. n comes within 0.5 to 4 and p
    within 0.25 to 3, whatever the state says.

    Attributes:
        force: returns the force [N]; 0 for d <= 0. What is negative counts as 0 (the tool has left
            the tissue), unless `may_pull`.
        summary: the formula, in one line.
        gradient: (d, v, K, B, n, p, gradient) writes the derivatives with respect to the six
            arguments into an array of zeros, shape (6,), and returns the force [N]; None takes
            central differences of the force.
        fixed: what is reported for K, B, n, p that the law lacks; `ESTIMATED` for what it has.
        may_pull: True if the force may be negative.
        lagged_velocity: True if p's place in the state is taken by a velocity that lags with the
            setting `relaxation_time`; `force` gets it in the place of p.
        specifications: parameters that only this law has.
    """

    force: Callable[..., float]
    summary: str
    gradient: Callable[..., float] | None = None
    fixed: tuple[float, float, float, float] = (ESTIMATED,) * 4
    may_pull: bool = False
    lagged_velocity: bool = False
    specifications: tuple[ParameterSpecification, ...] = ()

    def __post_init__(self) -> None:
        """Refuse what cannot work.

        Raises:
            ValueError: a function that is not compiled, or other than four fixed values.
        """
        functions: list[tuple[str, Any]] = [("force", self.force)]
        if self.gradient is not None:
            functions.append(("gradient", self.gradient))
        for name, function in functions:
            if not hasattr(function, "py_func"):
                raise ValueError(f"the {name} of a contact law is to be compiled: @compiled")
        if len(self.fixed) != 4:
            raise ValueError("fixed has four values: of K, B, n and p")
