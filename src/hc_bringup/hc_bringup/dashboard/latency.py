"""Latencies of the last ten seconds, counted in steps of equal ratio."""

from __future__ import annotations

from collections import deque
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from hc_msgs_py.histogram import DurationHistogram

EDGES_S: Final = np.logspace(-5.0, 0.0, 26)
"""10 us to 1 s, five steps a decade; what lies beyond counts at the ends."""
SECONDS: Final = 10


class LatencyWindow:
    """Counts of the last ten seconds."""

    def __init__(self) -> None:
        self._past: deque[DurationHistogram] = deque(maxlen=SECONDS)
        self._now = DurationHistogram()
        self._second = -1

    def add(self, latencies_s: NDArray[Any], now_s: float) -> None:
        """Count latencies that arrived now.

        Args:
            latencies_s: (n,) s; what is not finite is left out.
            now_s: any steady clock.
        """
        self._turn(now_s)
        finite = latencies_s[np.isfinite(latencies_s)]
        self._now.add_many((1e9 * np.clip(finite, 0.0, 1e9)).astype(np.int64))

    def counts(self, now_s: float) -> list[int]:
        """Return the counts below the first edge, between the edges and above the last one."""
        self._turn(now_s)
        total = DurationHistogram()
        for second in (*self._past, self._now):
            total.merge(second)
        return [int(number) for number in total.between(1e9 * EDGES_S)]

    def _turn(self, now_s: float) -> None:
        """Begin a new second where one is over; seconds without any count empty the past."""
        second = int(now_s)
        if self._second < 0:
            self._second = second
        for _ in range(min(second - self._second, SECONDS + 1)):
            self._past.append(self._now)
            self._now = DurationHistogram()
        self._second = second
