"""Takes force zero and contact position from the readings of a tool that rests at the surface."""

from __future__ import annotations

import math
from typing import NamedTuple


class TareResult(NamedTuple):
    """Means and standard deviations of the readings that a tare used. Units mm and N."""

    displacement_mm: float
    displacement_std_mm: float
    force_n: float
    force_std_n: float
    samples: int


class Tare:
    """Collects a number of samples and gives their mean (Welford's recursion: exact and small)."""

    def __init__(self, samples: int) -> None:
        """Collect so many finite samples."""
        self._wanted = samples
        self._count = 0
        self._means = [0.0, 0.0]
        self._squares = [0.0, 0.0]

    def add(self, displacement_mm: float, force_n: float) -> TareResult | None:
        """Take in a sample; return the result with the last one that was wanted.

        Readings that are not finite are passed over.
        """
        if not (math.isfinite(displacement_mm) and math.isfinite(force_n)):
            return None
        self._count += 1
        for i, value in enumerate((displacement_mm, force_n)):
            before = value - self._means[i]
            self._means[i] += before / self._count
            self._squares[i] += before * (value - self._means[i])
        if self._count < self._wanted:
            return None
        deviations = [math.sqrt(s / max(self._count - 1, 1)) for s in self._squares]
        return TareResult(self._means[0], deviations[0], self._means[1], deviations[1], self._count)
