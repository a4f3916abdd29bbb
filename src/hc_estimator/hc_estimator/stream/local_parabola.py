"""Velocity and acceleration of a place at a stamp: the parabola through the readings around it.

Savitzky and Golay, Analytical Chemistry 36 (1964) 1627, for stamps that need not be even: least
squares, by polynomials that are orthogonal over the readings (Forsythe, J. SIAM 5 (1957) 74).
"""

from __future__ import annotations

import math

import numpy as np

HALF_NS = 20_000_000
"""Half of the time that the parabola is of. Of a motion of 5 Hz it misses 3 % of the acceleration;
white noise of 3 um at 1 kHz becomes 8 mm/s^2."""
LEAST = 3
"""Readings on either side, however seldom they come."""
LONGEST_NS = 400_000_000
"""Of a longer time no parabola is known."""
_ROWS = 8192
_HALF_S = 1e-9 * HALF_NS
UNKNOWN = (math.nan, math.nan)


class LocalParabola:
    """The newest readings of a place, in memory that was there from the start."""

    def __init__(self) -> None:
        self._stamps = np.zeros(_ROWS, np.int64)
        self._places = np.zeros(_ROWS)
        self._first = self._end = 0

    def clear(self) -> None:
        """Forget all readings."""
        self._first = self._end = 0

    def add(self, stamp_ns: int, place_mm: float) -> None:
        """Take in a finite place [mm]; one that is not later than the last says nothing new."""
        if self._end > self._first and stamp_ns <= self._stamps[self._end - 1]:
            return
        if self._end == _ROWS:  # the newer half is as long as any window
            kept = min(_ROWS // 2, self._end - self._first)
            for column in (self._stamps, self._places):
                column[:kept] = column[self._end - kept : self._end]
            self._first, self._end = 0, kept
        self._stamps[self._end] = stamp_ns
        self._places[self._end] = place_mm
        self._end += 1

    def reaches(self, stamp_ns: int) -> bool:
        """Whether the readings after a stamp are there."""
        last = self._end - LEAST
        return (
            last >= self._first
            and bool(self._stamps[last] > stamp_ns)
            and bool(self._stamps[self._end - 1] >= stamp_ns + HALF_NS)
        )

    def motion_at(self, stamp_ns: int) -> tuple[float, float]:
        """Return velocity [mm/s] and acceleration [mm/s^2]; NaN if readings around it are few."""
        stamps = self._stamps[self._first : self._end]
        near = (stamp_ns - HALF_NS, stamp_ns, stamp_ns + HALF_NS)
        first, now, end = np.searchsorted(stamps, near, "right").tolist()
        first, end = min(first, now - LEAST), max(end, now + LEAST)
        if first < 0 or end > len(stamps) or stamps[end - 1] - stamps[first] > LONGEST_NS:
            return UNKNOWN
        time = (stamps[first:end] - stamp_ns) / HALF_NS
        place = self._places[self._first + first : self._first + end]
        middle = float(time.mean())
        away = time - middle
        square = away * away
        spread = float(square.mean())
        skew = float(square @ away) / (spread * len(away))
        bend = square - skew * away - spread
        slope = float(away @ place) / (spread * len(away))
        curve = float(bend @ place) / float(bend @ bend)
        velocity = slope - curve * (2.0 * middle + skew)
        return velocity / _HALF_S, 2.0 * curve / _HALF_S**2
