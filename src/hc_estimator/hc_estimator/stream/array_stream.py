"""Samples of a tactile array that never end: one EstimatorArray, started afresh where it must be.

Free of ROS. A sample is one message with the readings of all taxels; what is lost is counted by
their numbers, and a jump of the stamps starts the estimators afresh.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hc_estimator.array import EstimatorArray
from hc_estimator.estimate import EstimateSeries

LATE_NS = 100_000_000
"""Stamps that lie back by less are late or repeated samples, which are left out."""


class Fresh(NamedTuple):
    """Why the estimators were started afresh."""

    reason: str


class ArrayStream:
    """Feeds an array of estimators.

    Attributes:
        received: samples given to it.
        used: samples of which there are estimates.
        lost: samples that the numbers say never came.
        late: samples that came after a younger one, or with its stamp; they are left out, unless
            the estimators put them in their place (`reorder_window`).
        strays: samples alone at stamps that jumped, or the first of those that stay there; so are
            they.
        restarts: times that the estimators were started afresh.
        fresh: why that was the last time, until somebody has told it; None otherwise.
    """

    def __init__(self, make: Callable[[int], EstimatorArray], *, maximum_gap_s: float) -> None:
        """Prepare; the estimators are made with the first sample.

        Args:
            make: makes the estimators for a number of taxels.
            maximum_gap_s: stamps further ahead than this are a jump [s].
        """
        self._make = make
        self._maximum_gap_ns = round(maximum_gap_s * 1e9)
        self._array: EstimatorArray | None = None
        self._origin_ns = self._last_ns = self._window_ns = 0
        self._last_sequence = 0
        self._left_out = 0  # on purpose, since the last sample
        self._jumped_ns: int | None = None  # the last stamp, if it jumped
        self.received = self.used = self.lost = self.late = self.strays = self.restarts = 0
        self.fresh: Fresh | None = None

    @property
    def taxels(self) -> int:
        """How many the newest sample had; 0 before the first."""
        return 0 if self._array is None else self._array.channels

    def expect_gap(self, samples: int) -> None:
        """Hear that samples were left out on purpose: they are not lost."""
        self._left_out += samples

    def reset(self) -> None:
        """Forget all samples."""
        if self._array is not None:
            self._array.reset()
            self._origin_ns = self._last_ns + 1
            self.restarts += 1

    def take(
        self,
        stamp_ns: int,
        sequence: int,
        displacements_mm: NDArray[np.float64],
        forces_n: NDArray[np.float64],
    ) -> EstimateSeries | None:
        """Use a sample; returns the estimates of all taxels, None if it was left out.

        Args:
            stamp_ns: stamp [ns].
            sequence: its number.
            displacements_mm: penetration of each taxel [mm].
            forces_n: force of each taxel [N], as many.
        """
        self.received += 1
        count = len(displacements_mm)
        if self._array is None or self._array.channels != count:
            if self._array is not None:
                self._start_afresh(f"{count} taxels instead of {self._array.channels}")
            self._array = self._make(count)
            self._origin_ns = stamp_ns
            settings = self._array.configuration
            window_s = settings["missing_readings"] and settings["reorder_window"]
            self._window_ns = round(float(window_s) * 1e9)
        else:
            elapsed_ns = stamp_ns - self._last_ns
            if -self._window_ns <= elapsed_ns < 0:
                self.used += 1
                return self._step(stamp_ns, displacements_mm, forces_n)
            if -LATE_NS < elapsed_ns <= 0:
                self.late += 1
                return None
            if elapsed_ns < 0 or elapsed_ns > self._maximum_gap_ns:
                before_ns, self._jumped_ns = self._jumped_ns, stamp_ns
                if before_ns is None or not 0 < stamp_ns - before_ns <= self._maximum_gap_ns:
                    self.strays += 1  # one stamp that is wrong is no jump of the clock
                    return None
                self._start_afresh(f"the stamps jumped by {elapsed_ns * 1e-9:+.3f} s")
                self._array.reset()
                self._origin_ns = stamp_ns
            elif sequence > self._last_sequence:
                gone = sequence - self._last_sequence - 1
                self.lost += max(0, gone - self._left_out)
        self._left_out = 0
        self._last_ns, self._last_sequence, self._jumped_ns = stamp_ns, sequence, None
        self.used += 1
        return self._step(stamp_ns, displacements_mm, forces_n)

    def _step(
        self, stamp_ns: int, displacements_mm: NDArray[np.float64], forces_n: NDArray[np.float64]
    ) -> EstimateSeries:
        assert self._array is not None
        time_s = (stamp_ns - self._origin_ns) * 1e-9
        return self._array.step(time_s, displacements_mm, forces_n)

    def _start_afresh(self, reason: str) -> None:
        self.restarts += 1
        self.fresh = Fresh(reason)
