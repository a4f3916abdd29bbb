"""Force with the displacement at its stamp, for what needs both: zeros, the surface, a fit.

Samples of two sensors with rates of their own hold one reading each (merger.py). The estimators
take them as they are; whatever compares a force with a depth interpolates here.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hc_estimator.stream.readings import FloatArray

LONGEST_GAP_NS = 500_000_000
"""Between displacements further apart than this nothing is interpolated."""
MOST_WAITING = 10_000


class Together:
    """A stream of samples, some without one of the readings, as forces with displacements.

    A sample with both readings comes out as it is, at once. A force alone comes out with the next
    displacement, interpolated between that and the one before.
    """

    def __init__(self) -> None:
        self._waiting: list[tuple[int, float]] = []
        self._last: tuple[int, float] | None = None

    def forget(self) -> None:
        """Samples to come are of other sensors, or read otherwise."""
        self._waiting.clear()
        self._last = None

    def add(
        self, stamp_ns: int, displacement_mm: float, force_n: float
    ) -> Sequence[tuple[float, float]]:
        """Take in a sample; return displacements [mm] and forces [N] that belong together."""
        if displacement_mm != displacement_mm:  # no reading
            if force_n == force_n and self._last is not None and len(self._waiting) < MOST_WAITING:
                self._waiting.append((stamp_ns, force_n))
            return ()
        own = ((displacement_mm, force_n),) if force_n == force_n else ()
        last, self._last = self._last, (stamp_ns, displacement_mm)
        if not self._waiting:
            return own
        waiting, self._waiting = self._waiting, []
        if last is None or not 0 < stamp_ns - last[0] <= LONGEST_GAP_NS:
            return own
        slope = (displacement_mm - last[1]) / (stamp_ns - last[0])
        return [*((last[1] + slope * (at - last[0]), force) for at, force in waiting), *own]


def together(
    time_s: FloatArray, displacement_mm: FloatArray, force_n: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return a recording at the stamps of its forces, displacement interpolated where it lacks.

    Args:
        time_s: stamps [s], shape (n,).
        displacement_mm: penetration [mm], shape (n,); NaN where there is no reading.
        force_n: contact force [N], shape (n,); NaN where there is no reading.

    Returns:
        The three, unchanged if no sample holds one reading alone; otherwise only those rows that
        have a force, from the first displacement to the last.
    """
    columns = (np.asarray(time_s), np.asarray(displacement_mm), np.asarray(force_n))
    time, displacement, force = columns
    lacks, silent = np.isnan(displacement), np.isnan(force)
    if not (lacks ^ silent).any():
        return columns
    known = np.flatnonzero(np.isfinite(displacement) & np.isfinite(time))
    if len(known) < 2:
        kept = ~silent & ~lacks
        return time[kept], displacement[kept], force[kept]
    known = known[np.argsort(time[known], kind="stable")]
    kept = ~silent & np.isfinite(time)
    kept &= (time >= time[known[0]]) & (time <= time[known[-1]])
    filled = displacement.copy()
    wanted = kept & lacks
    filled[wanted] = np.interp(time[wanted], time[known], displacement[known])
    # Not across a time in which there was none.
    after = np.clip(np.searchsorted(time[known], time[wanted]), 1, len(known) - 1)
    gap = time[known[after]] - time[known[after - 1]]
    kept[np.flatnonzero(wanted)[gap > LONGEST_GAP_NS * 1e-9]] = False
    return time[kept], filled[kept], force[kept]


def of_two_readings(nis: FloatArray, innovation: FloatArray) -> FloatArray:
    """Return the normalised innovation squared as that of samples with both readings.

    A sample with one reading has a mean of 1 in a consistent filter, one with both of 2.

    Args:
        nis: as the estimator gives it, shape (n,).
        innovation: of displacement and force, NaN for a reading that was missing, shape (n, 2).

    Returns:
        Mean 2 in a consistent filter, shape (n,); NaN where no reading was used.
    """
    readings = np.isfinite(innovation).sum(axis=1)
    return np.where(readings == 1, 2.0 * nis, nis)
