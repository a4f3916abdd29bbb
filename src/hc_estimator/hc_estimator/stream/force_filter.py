"""What all filters share that make a contact force of a tool's position and its motor's effort."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

LONGEST_GAP_S = 0.1
"""A longer step is a gap, however long a step usually is."""
LOST_STEPS = 4.0
"""A step longer than so many usual ones is a gap: the effort meanwhile is not known."""
USUAL_STEP_WEIGHT = 0.05
USUAL_STEP_GROWTH = 1.5
"""Of the usual step at each gap, so that a stream that became slow is a stream again soon."""


class ForceFilter(ABC):
    """Makes displacement and force of position and effort.

    Shared: stamps are looked at, `run` is `step` for each, and what a gap leaves unknown. Motion
    went on in the gap and the effort that caused it was not read: used as if it had been held, it
    would be a force of newtons that nobody felt. So the velocity is taken anew from the two
    readings after the gap, and none is answered until the filter knows the force again.
    """

    def __init__(self) -> None:
        """Begin without a reading."""
        self._effort = 0.0
        self._forget()

    def reset(self) -> None:
        """Forget all readings."""
        self._forget()

    def _forget(self) -> None:
        self._time = -math.inf
        self._usual_s = 0.0
        self._after_gap_mm: float | None = None  # the first position after a gap
        self._resumed_s = math.nan  # stamp of the second one, until the force is known

    def step(self, time_s: float, position_mm: float, effort_n: float) -> tuple[float, float]:
        """Use one reading.

        Args:
            time_s: stamp [s].
            position_mm: of the tool, positive into the tissue [mm].
            effort_n: force of the motor from this stamp on, positive into the tissue [N].

        Returns:
            Displacement [mm] and force [N]. NaN, NaN for a reading that is not finite or not later
            than the last one, which is not used, and while a gap leaves the force unknown.
        """
        elapsed = time_s - self._time
        if not (math.isfinite(time_s + position_mm + effort_n) and elapsed > 0.0):
            return math.nan, math.nan
        before, self._time, self._effort = self._effort, time_s, effort_n
        if not math.isfinite(elapsed):
            return self._begin(position_mm)
        if self._is_gap(elapsed):
            self._after_gap_mm = position_mm
            return math.nan, math.nan
        if self._after_gap_mm is not None:
            velocity = (position_mm - self._after_gap_mm) / elapsed
            self._after_gap_mm = None
            self._resume(elapsed, position_mm, velocity)
            self._resumed_s = time_s
            return math.nan, math.nan
        found = self._follow(elapsed, position_mm, before)
        if not math.isnan(self._resumed_s):
            if not self._is_known(time_s - self._resumed_s):
                return math.nan, math.nan
            self._resumed_s = math.nan
        return found

    def _is_gap(self, elapsed: float) -> bool:
        """Whether readings were lost before this one; learns how long a step usually is."""
        if self._usual_s == 0.0:
            self._usual_s = elapsed
        gap = elapsed > min(LOST_STEPS * self._usual_s, LONGEST_GAP_S)
        if gap:
            self._usual_s = min(USUAL_STEP_GROWTH * self._usual_s, elapsed)
        else:
            self._usual_s += USUAL_STEP_WEIGHT * (elapsed - self._usual_s)
        return gap

    def run(
        self, time_s: FloatArray, position_mm: FloatArray, effort_n: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Use many readings; the same as `step` for each.

        Args:
            time_s: stamps [s], shape (samples,).
            position_mm: positions [mm], the same shape.
            effort_n: efforts [N], the same shape.

        Returns:
            Displacements and forces, shape (samples,) each.
        """
        found = np.empty((len(time_s), 2))
        readings = zip(time_s.tolist(), position_mm.tolist(), effort_n.tolist(), strict=True)
        for k, reading in enumerate(readings):
            found[k] = self.step(*reading)
        return found[:, 0], found[:, 1]

    @abstractmethod
    def _begin(self, position_mm: float) -> tuple[float, float]:
        """Use the first reading of all; its effort is in `_effort`."""

    @abstractmethod
    def _resume(self, elapsed: float, position_mm: float, velocity_mm_s: float) -> None:
        """Go on after a gap: position and velocity are of two readings `elapsed` seconds apart."""

    @abstractmethod
    def _follow(self, elapsed: float, position_mm: float, effort_n: float) -> tuple[float, float]:
        """Use a reading `elapsed` seconds after the last, with the effort held since then."""

    @abstractmethod
    def _is_known(self, since_s: float) -> bool:
        """Whether the force is known again, so long after `_resume`."""
