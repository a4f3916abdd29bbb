"""Tissues of the rig from other packages, by entry point.

Each is a `TissueEntry` in the group `hc.tissues`. They are compiled into the rig's kernels
like those of this package, and a scenario names them by `kind`.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from hc_msgs_py.compilation import by_code, inlined
from hc_msgs_py.entry_points import add_those_of_others

ENTRY_POINTS: Final = "hc.tissues"
PARAMETERS: Final = ("stiffness", "damping", "displacement_exponent", "velocity_exponent")


@dataclasses.dataclass(frozen=True)
class TissueEntry:
    """A tissue of another package.

    Attributes:
        force: compiled function (d, v, K, B, n, p, inner, rates) that returns the force on the tip
            [N] at penetration d [mm] and velocity v [mm/s], with the tissue's values of now. inner
            (4,) is the state that the tissue has inside, zero at the beginning, and rates (4,)
            takes its derivatives; both may be left alone. It is called for d <= 0 as well, so that
            a tissue can recover. Every finite argument must give a finite result.
        summary: the formula, in one line.
        parameters: those of PARAMETERS that it has; a scenario may leave out the others, they
            cannot be set, and the truth has NaN for them.
        may_pull: True if the force may be negative; otherwise what is negative counts as 0.
    """

    force: Callable[..., float]
    summary: str
    parameters: tuple[str, ...] = PARAMETERS
    may_pull: bool = False

    def __post_init__(self) -> None:
        """Refuse what cannot work.

        Raises:
            ValueError: a function that is not compiled, or a parameter that no tissue has.
        """
        if not hasattr(self.force, "py_func"):
            raise ValueError("the force of a tissue is to be compiled: @compiled")
        unknown = [name for name in self.parameters if name not in PARAMETERS]
        if unknown:
            raise ValueError(f"{unknown[0]!r} is none of {', '.join(PARAMETERS)}")


OURS: Final = ("none", "hunt_crossley", "adhesive", "kelvin_voigt", "viscoelastic", "layered")
_known: dict[str, Any] = dict.fromkeys(OURS)
PROBLEMS = add_those_of_others(_known, ENTRY_POINTS, TissueEntry, "a tissue")
"""Tissues of other packages that cannot be used, and why."""
OTHERS: Final[dict[str, TissueEntry]] = {
    name: entry for name, entry in _known.items() if name not in OURS
}
"""By name; the position is the code that the kernels know them by, after FIRST_OF_OTHERS."""


@inlined
def _none(
    _d: float, _v: float, _k: float, _b: float, _n: float, _p: float, _inner: Any, _rates: Any
) -> float:
    """Stands where no other package has brought a tissue."""
    return 0.0


force_of_other = by_code([entry.force for entry in OTHERS.values()] or [_none])
"""(code, d, v, K, B, n, p, inner, rates) -> force [N]."""
MAY_PULL: NDArray[np.bool_] = np.array(
    [entry.may_pull for entry in OTHERS.values()] or [False], np.bool_
)
HAS: NDArray[np.bool_] = np.array(
    [[name in entry.parameters for name in PARAMETERS] for entry in OTHERS.values()]
    or [[False] * len(PARAMETERS)],
    np.bool_,
)
"""(tissues, 4): whether each has K, B, n, p."""
