"""The column of a table with times as on a clock: read once each, a block of rows at a time."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from hc_logger.csv_clock import Stopwatch
from hc_logger.csv_layout import NO_COLUMN, CsvLayout
from hc_logger.csv_number import (
    CLOCK,
    DATE,
    HOUR_S,
    MINUTES,
    DateAndTime,
    clock_time,
    date_and_time,
    zone_s,
)

_DATE: Final = re.compile(DATE)
_MOST_LENGTHS: Final = 4
"""Ways of writing a time in one block: without the fraction where it is zero, for example."""
_ZERO: Final = ord("0")
_NUMBERS: Final = ("hour", "minute", "second", "part", "ms")
_AROUND: Final = ("date", "ahead", "zone_h", "zone_min")
"""What has to be the same in all cells of a block."""
_LARGEST: Final = {"hour": 23, "minute": 59, "second": 60}
"""MINUTES has no hour, and its minutes go on to 9999."""


def date_column(cells: Callable[[int], list[str]], index: int, width: int) -> int:
    """Return the column with the dates of a clock that shows none: before or behind it.

    Args:
        cells: gives the texts of a column, in rows that were read already.
        index: of the clock.
        width: columns that there are.

    Returns:
        Its index; NO_COLUMN if there is none.
    """
    times = map(date_and_time, cells(index))
    if any(found is not None and found.date for found in times):
        return NO_COLUMN
    for beside in (index - 1, index + 1):
        if 0 <= beside < width and any(_DATE.fullmatch(cell.strip()) for cell in cells(beside)):
            return beside
    return NO_COLUMN


class ClockColumn:
    """Reads the times of a table that is written as on a clock, and counts them on.

    Attributes:
        notes: what was taken for the beginning or end of summer time, one line each.
    """

    def __init__(self, layout: CsvLayout) -> None:
        self._index, self._date = layout.indices[0], layout.date
        self._watch = Stopwatch(layout.clock_period_s)
        self.notes = self._watch.notes

    def read(self, cells: Sequence[str]) -> DateAndTime | None:
        """Return the time of a row, with its date; None if there is none."""
        found = clock_time(cells[self._index]) if self._index < len(cells) else None
        if found is None or not -1 < self._date < len(cells):
            return found
        date = cells[self._date].strip()
        return found._replace(date=date) if _DATE.fullmatch(date) else found

    def elapsed(self, found: DateAndTime) -> float:
        """Return the seconds from the first row that was counted to this one; counts it."""
        return self._watch.elapsed(found)

    def elapsed_of(self, rows: list[list[str]]) -> NDArray[np.float64] | None:
        """Return the seconds of many rows at once, and count them.

        Args:
            rows: their cells, at least one row.

        Returns:
            Seconds (rows,), to the bit those of `read` and `elapsed`; None, and none was counted,
            where the times are written in too many ways, are of several days or do not go on.
        """
        found = _times_s([row[self._index].strip() for row in rows])
        first = self.read(rows[0])
        if found is None or first is None:
            return None
        if self._date != NO_COLUMN and {row[self._date].strip() for row in rows} != {first.date}:
            return None
        return self._watch.elapsed_of_one_day(found, first)


def _times_s(texts: list[str]) -> NDArray[np.float64] | None:
    """Return the times of cells that differ in the digits of the time alone [s], else None."""
    lengths = np.fromiter(map(len, texts), int, len(texts))
    different = np.unique(lengths)
    if len(different) > _MOST_LENGTHS:
        return None
    times_s = np.empty(len(texts))
    around = set[tuple[str | None, ...]]()
    for length in different:
        places = np.flatnonzero(lengths == length)
        some = texts if len(different) == 1 else [texts[place] for place in places]
        found = CLOCK.fullmatch(some[0]) or MINUTES.fullmatch(some[0])
        text = "".join(some)
        if found is None or not text.isascii():
            return None
        numbers = _numbers(np.frombuffer(text.encode(), np.uint8).reshape(-1, length), found)
        if numbers is None:
            return None
        around.add(tuple(found.groupdict().get(name) for name in _AROUND))
        times_s[places] = _seconds(numbers, found)
    return times_s if len(around) == 1 else None


def _numbers(
    characters: NDArray[np.uint8], found: re.Match[str]
) -> dict[str, NDArray[np.int64]] | None:
    """Return the numbers at the places of the first row's, None where a row differs beside them.

    Args:
        characters: one row for each cell.
        found: what the first one says.
    """
    numbers = {}
    is_fixed = np.ones(characters.shape[1], bool)
    for name in _NUMBERS:
        begin, end = found.span(name) if found.groupdict().get(name) else (0, 0)
        is_fixed[begin:end] = False
        digits = characters[:, begin:end] - np.uint8(_ZERO)
        if (digits > 9).any():
            return None
        numbers[name] = digits.astype(np.int64) @ 10 ** np.arange(end - begin)[::-1]
        most = _LARGEST.get(name) if "hour" in found.groupdict() or name == "second" else None
        if most is not None and (numbers[name] > most).any():
            return None
    if found.groupdict().get("half") and ((numbers["hour"] < 1) | (numbers["hour"] > 12)).any():
        return None
    same = characters[:, is_fixed] == characters[0, is_fixed]
    return numbers if same.all() else None


def _seconds(numbers: dict[str, NDArray[np.int64]], found: re.Match[str]) -> NDArray[np.float64]:
    """Return the seconds of hours, minutes, ... with the roundings of csv_number [s]."""
    groups = found.groupdict()
    scale = float(10 ** len(groups["part"] or ""))
    minutes_s = 60.0 * numbers["minute"]
    if "hour" not in groups:
        return np.asarray(minutes_s + (numbers["second"] * scale + numbers["part"]) / scale)
    part_s = numbers["part"] / scale if groups["part"] else numbers["ms"] * 1e-3
    hours = numbers["hour"]
    if groups["half"]:
        hours = hours % 12 + (12 if groups["half"] in "Pp" else 0)
    since_s = HOUR_S * hours + minutes_s + numbers["second"] + part_s
    return np.asarray(since_s - zone_s(found))
