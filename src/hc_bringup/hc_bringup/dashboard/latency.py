"""Histogram of latencies over the last ten seconds, in steps of equal ratio."""

from __future__ import annotations

from collections import deque
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

EDGES_S: Final = np.logspace(-5.0, 0.0, 26)
"""10 us to 1 s, five steps a decade; what lies beyond counts at the ends."""
SECONDS: Final = 10


class LatencyWindow:
    """Counts of the last ten seconds."""

    def __init__(self) -> None:
        self._past: deque[NDArray[np.int64]] = deque(maxlen=SECONDS)
        self._now = np.zeros(len(EDGES_S) + 1, np.int64)
        self._second = -1

    def add(self, latencies_s: NDArray[Any], now_s: float) -> None:
        """Count latencies that arrived now.

        Args:
            latencies_s: (n,) s; what is not finite is left out.
            now_s: any steady clock.
        """
        self._turn(now_s)
        finite = latencies_s[np.isfinite(latencies_s)]
        places = np.searchsorted(EDGES_S, finite)
        self._now += np.bincount(places, minlength=len(self._now))

    def counts(self, now_s: float) -> list[int]:
        """Return the counts below the first edge, between the edges and above the last one."""
        self._turn(now_s)
        total: NDArray[np.int64] = np.sum([*self._past, self._now], axis=0)
        return [int(number) for number in total]

    def _turn(self, now_s: float) -> None:
        """Begin a new second where one is over; seconds without any count empty the past."""
        second = int(now_s)
        if self._second < 0:
            self._second = second
        for _ in range(min(second - self._second, SECONDS + 1)):
            self._past.append(self._now)
            self._now = np.zeros_like(self._now)
        self._second = second
