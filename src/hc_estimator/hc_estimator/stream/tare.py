"""Takes force zero and contact position from the readings of a tool that rests at the surface."""

from __future__ import annotations

import math
from typing import NamedTuple

BLOCKS = 10
"""Parts of a tare whose means are compared: those of a tool at rest differ by noise alone."""
LEAST_IN_BLOCK = 5
REST_MM = 0.1
REST_N = 0.1
"""The means of a tool at rest may differ by so much: a hum, breathing, a sensor that warms up."""
CLEAR = 5.0
"""Differences of block means below so many of their standard errors are noise, however large."""


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
        self.wanted = samples
        self.count = 0
        self._means = [0.0, 0.0]
        self._squares = [0.0, 0.0]
        self._sums = [[0.0, 0.0] for _ in range(BLOCKS)]
        self._counts = [0] * BLOCKS

    def add(self, displacement_mm: float, force_n: float) -> TareResult | None:
        """Take in a sample; return the result with the last one that was wanted.

        Readings that are not finite are passed over.
        """
        if not (math.isfinite(displacement_mm) and math.isfinite(force_n)):
            return None
        block = min(self.count * BLOCKS // self.wanted, BLOCKS - 1)
        self._counts[block] += 1
        self.count += 1
        for i, value in enumerate((displacement_mm, force_n)):
            before = value - self._means[i]
            self._means[i] += before / self.count
            self._squares[i] += before * (value - self._means[i])
            self._sums[block][i] += value
        if self.count < self.wanted:
            return None
        deviations = [math.sqrt(s / max(self.count - 1, 1)) for s in self._squares]
        return TareResult(self._means[0], deviations[0], self._means[1], deviations[1], self.count)

    @property
    def feels(self) -> str:
        """How far it has come, in words."""
        return f"{self.count} of {self.wanted} samples"

    @property
    def unrest(self) -> str:
        """Why the tool did not rest while its readings were taken; nothing if it did.

        A few samples do not say.
        """
        if self.count < LEAST_IN_BLOCK * BLOCKS:
            return ""
        for i, (limit, unit, what) in enumerate(
            ((REST_MM, "mm", "the tool moved"), (REST_N, "N", "the force changed"))
        ):
            means = [s[i] / n for s, n in zip(self._sums, self._counts, strict=True)]
            spread = max(means) - min(means)
            if spread > limit and spread > CLEAR * self._standard_error(i, means):
                return f"{what} by {spread:.3g} {unit} meanwhile"
        return ""

    def _standard_error(self, i: int, means: list[float]) -> float:
        """Return the standard error of a block's mean, from the spread within the blocks."""
        overall = self._means[i]
        between = sum(
            n * (mean - overall) ** 2 for n, mean in zip(self._counts, means, strict=True)
        )
        within = max(self._squares[i] - between, 0.0)
        return math.sqrt(within / (self.count - BLOCKS) * BLOCKS / self.count)
