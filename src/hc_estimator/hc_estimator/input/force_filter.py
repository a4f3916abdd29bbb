"""What all filters share that make a contact force of a tool's position and its motor's effort."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

LONGEST_GAP_S = 0.1
"""After a longer gap in the readings a filter begins anew."""


class ForceFilter(ABC):
    """Makes displacement and force of position and effort.

    Shared: stamps are looked at, gaps begin anew, `run` is `step` for each.
    """

    def __init__(self) -> None:
        """Begin without a reading."""
        self._time = -math.inf
        self._effort = 0.0

    def reset(self) -> None:
        """Forget all readings."""
        self._time = -math.inf

    def step(self, time_s: float, position_mm: float, effort_n: float) -> tuple[float, float]:
        """Use one reading.

        Args:
            time_s: stamp [s].
            position_mm: of the tool, positive into the tissue [mm].
            effort_n: force of the motor from this stamp on, positive into the tissue [N].

        Returns:
            Displacement [mm] and force [N]. NaN, NaN for a reading that is not finite or not later
            than the last one: it is not used.
        """
        elapsed = time_s - self._time
        if not (math.isfinite(time_s + position_mm + effort_n) and elapsed > 0.0):
            return math.nan, math.nan
        before, self._time, self._effort = self._effort, time_s, effort_n
        if elapsed > LONGEST_GAP_S:
            return self._begin(position_mm)
        return self._follow(elapsed, position_mm, before)

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
        """Use the first reading after a gap; its effort is in `_effort`."""

    @abstractmethod
    def _follow(self, elapsed: float, position_mm: float, effort_n: float) -> tuple[float, float]:
        """Use a reading `elapsed` seconds after the last, with the effort held since then."""
