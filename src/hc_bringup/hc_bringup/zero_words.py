"""What an estimate says of contact position and force zero, in words."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hc_msgs_py.units import METRE_IN_MM

if TYPE_CHECKING:
    from hc_estimator import Estimate


class Zeros(NamedTuple):
    """Where the contact begins [mm] and what the force reads without contact [N].

    Beyond those given, with standard deviations; NaN where nothing is known.
    """

    contact_position: float
    contact_position_std: float
    force_zero: float
    force_zero_std: float

    @classmethod
    def from_message(cls, field: Callable[[str], float]) -> Zeros:
        """Take them from where the fields of hc_msgs/HuntCrossleyEstimate stand, in metres."""
        position, position_std, force, force_std = (float(field(name)) for name in cls._fields)
        return cls(METRE_IN_MM * position, METRE_IN_MM * position_std, force, force_std)

    @classmethod
    def from_estimate(cls, estimate: Estimate) -> Zeros:
        """Take them from what an estimator says."""
        return cls(*(float(getattr(estimate, name)) for name in cls._fields))

    @classmethod
    def in_the_end(cls, contact: NDArray[np.bool_], zeros_of: Callable[[int], Zeros]) -> Zeros:
        """Return the last ones, with the contact position of the last contact.

        The parameters are of that, and not of the time in the air since.

        Args:
            contact: of each estimate, whether it is in contact, shape (n,), n > 0.
            zeros_of: of the estimate of a number.
        """
        last, touching = zeros_of(len(contact) - 1), np.flatnonzero(contact)
        return last.at(zeros_of(int(touching[-1]))) if len(touching) else last

    def at(self, touch: Zeros) -> Zeros:
        """Return these with the contact position of another moment."""
        return self._replace(
            contact_position=touch.contact_position, contact_position_std=touch.contact_position_std
        )

    def with_spread(self, deviations: float) -> Zeros:
        """Return these with so many standard deviations behind ±."""
        return self._replace(
            contact_position_std=deviations * self.contact_position_std,
            force_zero_std=deviations * self.force_zero_std,
        )

    @property
    def words(self) -> str:
        """What was found, or how well those given are known; empty where neither is said.

        What stands behind ± is one standard deviation.
        """
        parts = " and ".join(self._parts())
        if not parts:
            return ""
        if _is_off(self.contact_position) or _is_off(self.force_zero):
            return f"{parts} in the end; K, B, n and p count from there"
        return f"{parts}; K, B, n and p are as unsure as that makes them"

    def _parts(self) -> Iterator[str]:
        if _is_off(self.contact_position) or self.contact_position_std > 0.0:
            place = _with(self.contact_position, self.contact_position_std)
            yield f"contact begins at {place} mm"
        if _is_off(self.force_zero) or self.force_zero_std > 0.0:
            force = _with(1e3 * self.force_zero, 1e3 * self.force_zero_std)
            yield f"the force reads {force} mN without contact"


def _is_off(zero: float) -> bool:
    return zero != 0.0 and math.isfinite(zero)


def _with(value: float, deviation: float) -> str:
    """Return a value with its deviation, to two digits of that."""
    if not (deviation > 0.0 and math.isfinite(deviation)):
        return f"{value:.3g}"
    decimals = max(1 - math.floor(math.log10(deviation)), 0)
    return f"{value + 0.0:.{decimals}f} ± {deviation:.{decimals}f}"
