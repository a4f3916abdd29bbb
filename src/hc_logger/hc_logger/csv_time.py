"""Which columns of a CSV file tell the time, and in which unit a time without one is.

A message's stamp is two columns, seconds and nanoseconds. A time since 1970 says its unit by its
size; any other is taken for seconds where its steps are short. Testing machines that repeat a cycle
begin to count anew with each.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

LONGEST_SECONDS: Final = 0.5
"""Median step of a time without a unit: below it, it is taken for seconds."""
EPOCH_UNITS: Final = (("s", 1e9), ("ms", 1e12), ("us", 1e15), ("ns", 1e18))
"""What a time since 1970 is in, by its size from 2001 on; four times as much is 2096."""
_DAYS: Final = (
    ((36_526.0, 73_051.0), "the days that a spreadsheet counts"),
    ((730_000.0, 780_000.0), "the days that MATLAB's datenum counts"),
    ((2_450_000.0, 2_490_000.0), "days of the Julian date"),
)
"""First and last of about 2000 to 2100, by who counts so; hardly a machine runs so many seconds."""
_SHORTEST_SECONDS: Final = 5e-6
"""Median step: nobody measures a force more often, in seconds; in days it is 0.4 s."""
BETWEEN_S: Final = 1.0
"""Put between two cycles: what was there is not known, and the motion is to begin anew."""
_FEWEST_ROWS: Final = 20
"""Of a cycle, about: a time that goes back by less is no new count."""
_STAMP: Final = re.compile(r"(?P<stamp>(?:^|.*[./_])stamp[./_])(?P<part>n?)(?:ano)?secs?$")


def stamps(names: Sequence[str], numeric: Sequence[int]) -> list[tuple[int, int]]:
    """Return the columns of seconds and nanoseconds of each stamp of a message.

    Args:
        names: of all columns.
        numeric: the columns that hold numbers.
    """
    parts = {
        part: i for i in numeric if i < len(names) and (part := _stamp_part(names[i])) is not None
    }
    return [
        (seconds, parts[stamp, True])
        for (stamp, is_nano), seconds in parts.items()
        if not is_nano and (stamp, True) in parts
    ]


def unit_of_times(numbers: Sequence[float]) -> tuple[str | None, str]:
    """Return the unit that times without one can only be in, and what is assumed.

    None where that is not clear.
    """
    if numbers:
        for unit, low in EPOCH_UNITS:
            if low < min(numbers) <= max(numbers) < 4.0 * low:
                return unit, f"taken for the time since 1970 in {unit}"
    steps = sorted(abs(b - a) for a, b in itertools.pairwise(numbers))
    if steps and 0.0 < steps[len(steps) // 2] < _SHORTEST_SECONDS:
        for (first, last), what in _DAYS:
            if first <= min(numbers) <= max(numbers) < last:
                return "d", f"taken for {what}"
    if steps and 0.0 < steps[len(steps) // 2] < LONGEST_SECONDS:
        return "s", "taken for seconds"
    return None, ""


def _stamp_part(cell: str) -> tuple[str, bool] | None:
    """Return which stamp of a message a column is a part of, and whether it is its nanoseconds.

    None for a column that is no part of a stamp.
    """
    found = _STAMP.match(cell.strip().lower())
    return (found["stamp"], found["part"] == "n") if found else None


class Cycles:
    """Puts the cycles of a test one behind the other, each of which counts its time anew.

    Attributes:
        again: how many times the time began anew.
    """

    def __init__(self) -> None:
        """Begin with the first row of a file."""
        self.again = 0
        self._first = self._last = math.nan
        self._step = self._offset = 0.0

    def one_behind_the_other(self, time_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the times of the next rows as those of one test.

        A time begins anew where it falls back to that of the first row; any other that goes back
        is left as it is.

        Args:
            time_s: as they are counted [s], shape (rows,); those that are not finite stay.
        """
        known = np.flatnonzero(np.isfinite(time_s))
        if not len(known):
            return time_s
        times = time_s[known]
        if math.isnan(self._first):
            self._first = float(times[0])
            steps = np.diff(times)
            self._step = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else math.inf
        before = np.append(self._last, times[:-1])
        anew = before - times > _FEWEST_ROWS * self._step
        anew &= np.abs(times - self._first) <= 2.0 * self._step
        shift = self._offset + np.cumsum(np.where(anew, before - times + BETWEEN_S, 0.0))
        self.again += int(np.count_nonzero(anew))
        self._last, self._offset = float(times[-1]), float(shift[-1])
        if not shift.any():
            return time_s
        result = time_s.copy()
        result[known] = times + shift
        return result
