"""Knows whether the tool presses, as far as the zeros in force allow to say.

Before the first tare nothing is known: a position of 400 mm in the frame of a robot's base is no
depth. Zeros are believed once the tool was seen to move freely with them.
"""

from __future__ import annotations

import math

FREE_SAMPLES = 20
"""Samples at or outside the surface that make the zeros believable."""
CLEAR = 5.0
"""A force beyond so many deviations of that in free motion is a press."""
SHARE_OF_PEAK = 0.03
"""So is only a force beyond this share of the largest one since: sensors drift."""


class PressWatch:
    """Watches displacement and force; cheap enough for every sample."""

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """The zeros are others from now on."""
        self._free = 0
        self._mean = 0.0
        self._squares = 0.0
        self._peak = 0.0
        self._depth_mm = 0.0
        self._force_n = 0.0

    def add(self, displacement_mm: float, force_n: float) -> None:
        """Take in a sample; readings that are not finite are passed over."""
        if not (math.isfinite(displacement_mm) and math.isfinite(force_n)):
            return
        self._depth_mm, self._force_n = displacement_mm, force_n
        if displacement_mm <= 0.0:
            self._free += 1
            before = force_n - self._mean
            self._mean += before / self._free
            self._squares += before * (force_n - self._mean)
        elif self._free:
            self._peak = max(self._peak, force_n - self._mean)

    @property
    def pressing(self) -> str:
        """How hard and deep the tool presses, in words; nothing if it does not or nobody knows."""
        if self._free < FREE_SAMPLES or self._depth_mm <= 0.0:
            return ""
        deviation = math.sqrt(self._squares / (self._free - 1))
        excess = self._force_n - self._mean
        if excess <= max(CLEAR * deviation, SHARE_OF_PEAK * self._peak):
            return ""
        return f"the tool presses with {excess:.3g} N at a depth of {self._depth_mm:.3g} mm"
