"""Velocity of a place that is read with noise: a fading-memory polynomial filter.

Least squares of a parabola, past readings discounted exponentially (Morrison, Introduction to
Sequential Smoothing and Prediction, 1969; the critically damped g-h-k filter of Brookner, Tracking
and Kalman Filtering Made Easy, 1998, section 1.3). No lag where the acceleration is constant.
"""

from __future__ import annotations

import math

MEMORY_S = 0.015
"""After so long a reading counts by a factor e less."""
LONGEST_STEP_S = 0.5
"""After a longer one it begins anew."""
_NS = 1e-9


class FadingMemory:
    """Follows place, velocity and acceleration of readings at any stamps."""

    def __init__(self) -> None:
        self._stamp_ns: int | None = None
        self._place_mm = self._velocity = self._acceleration = 0.0

    def take(self, stamp_ns: int, place_mm: float) -> None:
        """Take in a reading.

        Args:
            stamp_ns: when it was measured; one that is not later than the last begins anew.
            place_mm: a finite place [mm].
        """
        before, self._stamp_ns = self._stamp_ns, stamp_ns
        step_s = 0.0 if before is None else (stamp_ns - before) * _NS
        if not 0.0 < step_s < LONGEST_STEP_S:
            self._place_mm, self._velocity, self._acceleration = place_mm, 0.0, 0.0
            return
        kept = math.exp(-step_s / MEMORY_S)
        velocity = self._velocity + self._acceleration * step_s
        foreseen_mm = self._place_mm + 0.5 * step_s * (self._velocity + velocity)
        innovation_mm = place_mm - foreseen_mm
        lost = 1.0 - kept
        self._place_mm = foreseen_mm + (1.0 - kept**3) * innovation_mm
        self._velocity = velocity + 1.5 * (1.0 - kept**2) * lost * innovation_mm / step_s
        self._acceleration += lost**3 * innovation_mm / step_s**2

    def velocity_at(self, stamp_ns: int) -> float:
        """Return the velocity [mm/s], foreseen with the acceleration; 0 before any reading."""
        if self._stamp_ns is None:
            return 0.0
        return self._velocity + self._acceleration * (stamp_ns - self._stamp_ns) * _NS
