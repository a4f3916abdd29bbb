"""From what a sensor says to the estimator's displacement or force: axis, sign, scale, zero."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

AXES = ("x", "y", "z", "direction")


class Mapping(NamedTuple):
    """A direction in the sensor's frame with its scale, and the reading that counts as zero.

    Attributes:
        x: factor of the first component.
        y: factor of the second component.
        z: factor of the third component.
        zero: subtracted last, in the unit of the result.
    """

    x: float
    y: float
    z: float
    zero: float

    def of_vector(self, x: float, y: float, z: float) -> float:
        """Return the reading of a vector sensor along the direction."""
        return self.x * x + self.y * y + self.z * z - self.zero

    def of_scalar(self, value: float) -> float:
        """Return the reading of a sensor with one component (made with axis x)."""
        return self.x * value - self.zero


def make_mapping(
    axis: str, direction: Sequence[float], sign: int, scale: float, zero: float
) -> Mapping:
    """Make a mapping from settings.

    Args:
        axis: "x", "y", "z", or "direction" for any other.
        direction: direction in the sensor's frame, of any length; used for axis "direction", and
            three finite numbers for any.
        sign: 1 or -1; the result is to be positive into the tissue and in compression.
        scale: factor, for a sensor in other units (m of stroke per rad of a joint, say).
        zero: reading that counts as zero, after sign and scale.

    Raises:
        ValueError: if a setting is not allowed; names it and what is.
    """
    if axis not in AXES:
        raise ValueError(f"axis = {axis!r} is not one of {', '.join(AXES)}")
    if sign not in (1, -1):
        raise ValueError(f"sign = {sign!r} is not 1 or -1")
    length = math.hypot(*direction) if len(direction) == 3 else math.nan
    if not math.isfinite(length) or (axis == "direction" and length == 0.0):
        raise ValueError(
            f"direction = {list(direction)!r} is not three finite numbers, not all of them zero"
        )
    if axis == "direction":
        unit = [component / length for component in direction]
    else:
        unit = [float(axis == name) for name in "xyz"]
    factor = sign * scale
    return Mapping(factor * unit[0], factor * unit[1], factor * unit[2], zero)
