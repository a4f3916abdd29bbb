"""Times that only go on, of the clock times of a table: days, midnights and summer time counted."""

from __future__ import annotations

import math
import re
from datetime import date
from typing import Final

import numpy as np
from numpy.typing import NDArray

from hc_logger.csv_number import HOUR_S, DateAndTime
from hc_msgs_py.units import DAY_S

_LAST_CHANGE_S: Final = 4.0 * HOUR_S
"""Local time at which summer time begins or ends at the latest, from 1 h on."""
_COARSE_CLOCK_S: Final = 1.0
"""Step of a clock that shows whole seconds."""
_MONTHS: Final = {
    name: number
    for number, names in enumerate(
        (
            *("jan", "feb fev", "mar mrz", "apr avr", "may mai", "jun juin", "jul juil"),
            *("aug aou", "sep", "oct okt", "nov", "dec dez"),
        ),
        1,
    )
    for name in names.split()
}
"""By the first letters of their names."""
_ORDERS: Final = ((0, 1, 2), (2, 1, 0), (2, 0, 1))
"""Where year, month and day stand: 2026-10-25, 25.10.2026, 10/25/2026."""


class Calendar:
    """Counts the days between dates, in whichever order they are written.

    Of orders that both make dates the one counts in which the days go on by the fewest: 01/02 and
    then 02/02 are one day apart, and so are 01/02 and 01/03.
    """

    def __init__(self) -> None:
        self._orders = list(_ORDERS)

    def days(self, before: str, after: str) -> int | None:
        """Return the days from one date to another, None if one of them is none."""
        counted = {}
        for order in self._orders:
            dates = [_date(text, order) for text in (before, after)]
            if dates[0] is not None and dates[1] is not None:
                counted[order] = (dates[1] - dates[0]).days
        if not counted:
            return None
        self._orders = list(counted)
        return min(counted.values(), key=lambda days: (days < 0, abs(days)))


def _date(text: str, order: tuple[int, int, int]) -> date | None:
    parts = re.split("[-./ ]", text)
    if len(parts) != 3:
        return None
    year, month, day = (parts[place] for place in order)
    number = _MONTHS.get(month[:4].lower()) or _MONTHS.get(month[:3].lower())
    if not (year.isdecimal() and day.isdecimal() and (number or month.isdecimal())):
        return None
    try:
        return date(int(year) + (2000 if int(year) < 100 else 0), number or int(month), int(day))
    except ValueError:
        return None


class Stopwatch:
    """Makes times that only go on of times of day: from the first one, midnights counted.

    Where there are dates, days are counted by them: a table may be gone on with a day later. A
    clock of local time is put forward or back by an hour in two nights of the year; it goes on.

    Args:
        period_s: after which the clock begins anew [s].

    Attributes:
        notes: what was taken for such a night, one line each.
    """

    def __init__(self, period_s: float = DAY_S) -> None:
        self.notes: list[str] = []
        self._period_s = period_s
        self._first: float | None = None
        self._added_s = 0.0  # midnights, and hours by which the clock was put back
        self._last = math.nan
        self._step_s = 0.0  # between the two rows before
        self._date = ""  # of the row before
        self._midnights = 0  # counted since the date changed: it may follow a row later
        self._calendar = Calendar()

    def elapsed(self, found: DateAndTime) -> float:
        """Return the seconds since the first time that was given; NaN for one of NaN."""
        if math.isnan(found.time_s):
            return found.time_s
        now_s = found.time_s if found.date else found.time_of_day_s
        days = None
        if found.date and self._date:
            days = 0 if found.date == self._date else self._calendar.days(self._date, found.date)
        self._date = found.date
        if self._first is None:
            self._first = self._last = now_s
        if days:
            self._added_s += (days - self._midnights) * DAY_S
            self._midnights = 0
        elif now_s < self._last - self._period_s / 2.0:
            self._added_s += self._period_s
            self._midnights += days == 0
        elif put_back_s := self._put_back(now_s):
            self._added_s += put_back_s
        else:
            self._step_s = now_s - self._last
        self._last = now_s
        return self._added_s + now_s - self._first

    def elapsed_of_one_day(
        self, times_s: NDArray[np.float64], first: DateAndTime
    ) -> NDArray[np.float64] | None:
        """Return the seconds of many times that only go on, as `elapsed` would of each.

        Args:
            times_s: finite, as `time_s` of `first`, all with its date [s].
            first: of them.

        Returns:
            Seconds (rows,); None, and nothing was counted, where the date is another than before,
            or the clock goes back or on by more than an hour: these are for `elapsed`.
        """
        if not first.date and first.has_zone:
            times_s = times_s % DAY_S
        start_s = float(times_s[0]) if self._first is None else self._first
        steps_s = np.diff(times_s, prepend=start_s if self._first is None else self._last)
        is_same_day = self._first is None or first.date == self._date
        if not is_same_day or steps_s.min() < 0.0 or steps_s.max() > HOUR_S:
            return None
        self._first, self._date = start_s, first.date
        self._last, self._step_s = float(times_s[-1]), float(steps_s[-1])
        elapsed_s: NDArray[np.float64] = self._added_s + times_s - start_s
        return elapsed_s

    def _put_back(self, now_s: float) -> float:
        """Return by how much the clock was put back for the end of summer time [s], else 0.

        3600, or -3600 where it begins: at a full hour of the night, with a step of rows between.
        """
        most_s = max(_COARSE_CLOCK_S, 2.0 * self._step_s)
        at_s = round(self._last / HOUR_S) * HOUR_S
        moved_s = HOUR_S if now_s < self._last else -HOUR_S
        is_at_night = HOUR_S <= at_s <= _LAST_CHANGE_S and self._last <= at_s <= now_s + moved_s
        is_coarse = self._step_s > HOUR_S / 2.0  # rows an hour apart show none
        if self._period_s <= HOUR_S or not is_at_night or is_coarse:
            return 0.0
        if not 0.0 < now_s + moved_s - self._last <= most_s:
            return 0.0
        which = "goes back by an hour, as summer time ends"
        if moved_s < 0.0:
            which = "leaves an hour out, as summer time begins"
        self.notes.append(
            f"the clock {which} ({_shown(self._last)}, then {_shown(now_s)}): the times go on there"
        )
        return moved_s


def _shown(time_of_day_s: float) -> str:
    """Return a time of day as on a clock, to the millisecond."""
    whole, ms = divmod(round(1000.0 * time_of_day_s), 1000)
    part = f".{ms:03d}" if ms else ""
    return f"{whole // 3600:02d}:{whole // 60 % 60:02d}:{whole % 60:02d}{part}"
