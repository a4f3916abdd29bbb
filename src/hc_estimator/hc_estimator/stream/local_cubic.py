"""Velocity and acceleration of a place at a stamp: the cubic through the readings around it.

Savitzky and Golay, Analytical Chemistry 36 (1964) 1627, for stamps that need not be even: least
squares, by polynomials that are orthogonal over the readings (Forsythe, J. SIAM 5 (1957) 74).
"""

from __future__ import annotations

import math

import numpy as np

from hc_estimator.stream.readings import FloatArray

HALF_NS = 20_000_000
"""Half of the time that the cubic is of. Of a motion of 5 Hz it misses 3 % of the acceleration;
white noise of 3 um at 1 kHz becomes 8 mm/s^2."""
LEAST = 2
"""Readings on either side, however seldom they come."""
LONGEST_NS = 400_000_000
"""Of a longer time no motion is known."""
SPIKE = 20.0
"""Times what a reading usually is off the line between its neighbours: one that says another place
for an instant."""
SHOW_SPIKE = 2
"""Readings after one, which show it."""
FEWEST = 10
"""Readings, before which nobody knows what is usual."""
_WEIGHT = 0.02
"""Of a reading, in the mean of how far they usually are off."""
_ROWS = 8192
_HALF_S = 1e-9 * HALF_NS
UNKNOWN = (math.nan, math.nan)


class LocalCubic:
    """The newest readings of a place, in memory that was there from the start."""

    def __init__(self) -> None:
        self._stamps = np.zeros(_ROWS, np.int64)
        self._places = np.zeros(_ROWS)
        self.clear()

    def clear(self) -> None:
        """Forget all readings."""
        self._first = self._end = 0
        self._usual_mm, self._taken = 0.0, 0
        self._off_mm = (0.0, 0.0)  # of the last reading but two, and but one

    def add(self, stamp_ns: int, place_mm: float) -> None:
        """Take in a finite place [mm]; one that is not later than the last says nothing new."""
        if self._end > self._first and stamp_ns <= self._stamps[self._end - 1]:
            return
        if self._end == _ROWS:  # the newer half is as long as any window
            kept = min(_ROWS // 2, self._end - self._first)
            for column in (self._stamps, self._places):
                column[:kept] = column[self._end - kept : self._end]
            self._first, self._end = 0, kept
        self._leave_spike_out(stamp_ns, place_mm)
        self._stamps[self._end] = stamp_ns
        self._places[self._end] = place_mm
        self._end += 1

    def _leave_spike_out(self, stamp_ns: int, place_mm: float) -> None:
        """Leave out the last reading but one if it is one, as those after it show."""
        off_mm = self._off_line(stamp_ns, place_mm)
        most_mm = SPIKE * self._usual_mm if self._taken >= FEWEST else math.inf
        before_mm, spike_mm = self._off_mm
        if 0.0 < most_mm < spike_mm and spike_mm >= max(before_mm, off_mm):
            last = self._end - 1
            for column in (self._stamps, self._places):
                column[last - 1] = column[last]
            self._end, spike_mm = last, 0.0
            off_mm = self._off_line(stamp_ns, place_mm)
        self._taken += 1
        weight = max(_WEIGHT, 1.0 / self._taken)
        self._usual_mm += weight * (min(off_mm, most_mm or off_mm) - self._usual_mm)
        self._off_mm = (spike_mm, off_mm)

    def _off_line(self, stamp_ns: int, place_mm: float) -> float:
        """Return how far the last reading is off the line between the one before and this one."""
        last = self._end - 1
        if last <= self._first:
            return 0.0
        before_ns, last_ns = self._stamps[last - 1 : last + 1].tolist()
        before_mm, last_mm = self._places[last - 1 : last + 1].tolist()
        share = (last_ns - before_ns) / (stamp_ns - before_ns)
        return float(abs(last_mm - before_mm - share * (place_mm - before_mm)))

    def reaches(self, stamp_ns: int) -> bool:
        """Whether the readings after a stamp are there, and it is known which are spikes."""
        last = self._end - 1 - SHOW_SPIKE
        enough = last - LEAST + 1
        return (
            enough >= self._first
            and bool(self._stamps[enough] > stamp_ns)
            and bool(self._stamps[last] >= stamp_ns + HALF_NS)
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
        velocity, acceleration = _derivatives(time, place)
        return velocity / _HALF_S, acceleration / _HALF_S**2


def _derivatives(time: FloatArray, place: FloatArray) -> tuple[float, float]:
    """Return both derivatives at time 0 of the cubic that fits best, shape (n,) each."""
    middle = float(time.mean())
    first = time - middle
    norm_1 = float(first @ first)
    shift_1, weight_1 = float((time * first) @ first) / norm_1, norm_1 / len(time)
    second = (time - shift_1) * first - weight_1
    norm_2 = float(second @ second)
    shift_2, weight_2 = float((time * second) @ second) / norm_2, norm_2 / norm_1
    third = (time - shift_2) * second - weight_2 * first
    part_1, part_2 = float(first @ place) / norm_1, float(second @ place) / norm_2
    part_3 = float(third @ place) / float(third @ third)
    # The polynomials and their slopes at 0, by the same recurrence; `first` has slope 1.
    slope_2 = -middle - shift_1
    slope_3 = shift_1 * middle - weight_1 - shift_2 * slope_2 - weight_2
    velocity = part_1 + part_2 * slope_2 + part_3 * slope_3
    return velocity, 2.0 * (part_2 + part_3 * (slope_2 - shift_2))


def less_spikes(time_s: FloatArray, places: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the readings of a whole recording without spikes, shape (n,) each."""
    share = (time_s[1:-1] - time_s[:-2]) / (time_s[2:] - time_s[:-2])
    line = places[:-2] + share * (places[2:] - places[:-2])
    off = np.zeros(len(places))
    off[1:-1] = np.abs(places[1:-1] - line)
    beside = np.maximum(np.append(off[1:], 0.0), np.append(0.0, off[:-1]))
    usual = float(np.median(off))
    kept = (off <= SPIKE * usual) | (off < beside) if usual else np.ones(len(off), np.bool_)
    return time_s[kept], places[kept]
