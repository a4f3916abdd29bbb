"""How a CSV file is written: what csv_finder.py finds out and csv_rows.py reads by."""

from __future__ import annotations

from typing import Final, NamedTuple

from hc_msgs_py.units import DAY_S

COLUMNS: Final = ("time_s", "displacement_mm", "force_N")
NO_COLUMN: Final = -1
"""In the place of the column of a time that is counted."""


class CsvLayout(NamedTuple):
    """How a file is written.

    Attributes:
        encoding: as Python names it.
        separator: one character; a space stands for any white space.
        decimal: "." or ",".
        header_lines: lines before the first row of numbers.
        indices: column of time, displacement, force, from 0.
        names: their names, for messages.
        factors: what makes s, mm, N of them.
        width: cells in a row.
        header: the cells of the line of names, none if there is none.
        clock: whether the time is written as on a clock.
        date: column of the dates beside a clock, NO_COLUMN if there is none.
        clock_period_s: after which it begins anew [s]: a day, or an hour if it shows no hours.
        nanoseconds: column of what is to be added to the time, NO_COLUMN if there is none.
        rate_hz: rows in a second; 0 if the file tells the time.
        decimal_is_sure: whether the user said what the decimal sign is.
        decimal_is_open: whether no number that was looked at has a sign that must be decimal.
        is_chosen: whether the user said where the rows begin.
        status: column of the sensor's status words, NO_COLUMN if there is none.
        notes: what was assumed, one line each; none for a file of our own.
    """

    encoding: str
    separator: str
    decimal: str
    header_lines: int
    indices: tuple[int, int, int]
    names: tuple[str, str, str]
    factors: tuple[float, float, float]
    width: int
    header: tuple[str, ...] = ()
    clock: bool = False
    date: int = NO_COLUMN
    clock_period_s: float = DAY_S
    nanoseconds: int = NO_COLUMN
    rate_hz: float = 0.0
    decimal_is_sure: bool = False
    decimal_is_open: bool = False
    is_chosen: bool = False
    status: int = NO_COLUMN
    notes: tuple[str, ...] = ()
