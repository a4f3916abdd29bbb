"""Where the rows of numbers of a CSV file are, cut into cells, or why there are none.

Testing machines write their own results above the table of readings (Instron's Bluehill).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

from hc_logger.csv_number import MISSING, number, time_of_day
from hc_logger.csv_text import split_line
from hc_logger.csv_vocabulary import NAMES, QUANTITIES, split_name

SEPARATORS: Final = {",": "comma", ";": "semicolon", "\t": "tab", "|": "bar", " ": "space"}
_NUMERIC_SHARE: Final = 0.9
LARGEST_SUMMARY: Final = 20
"""Rows; as many numbers above another header, or below the readings, are results, no readings."""
_CLOCK: Final = re.compile(r"\d{1,2}:\d{2}:\d{2}")
_WITH_UNIT: Final = re.compile(r"^\s*[-+]?\d+(?:[.,]\d+)?\s*(?P<unit>[^\W\d_]+)\s*$")


class Table(NamedTuple):
    """One way to cut the first lines into cells."""

    separator: str
    decimal: str
    first: int  # line of the first row of numbers
    width: int  # cells in a row
    numeric: tuple[int, ...]  # columns that hold numbers
    clocks: tuple[int, ...]  # columns that hold times of day


def cut(
    lines: list[str],
    separator: str,
    decimal: str,
    first: int | None,
    least: int = len(QUANTITIES),
    decimal_is_sure: bool = False,
) -> Table | None:
    """Cut lines into cells.

    Args:
        lines: the first ones of the file.
        separator: between cells.
        decimal: sign in numbers.
        first: line of the first row of numbers; None finds out.
        least: columns of numbers (or times of day) that there must be.
        decimal_is_sure: that the user said what the decimal sign is.

    Returns:
        The table, None if that gives no rows of so many numbers.
    """
    rows = [split_line(line, separator) if line.strip() else [] for line in lines]

    def is_number(cell: str) -> bool:
        return number(cell, decimal, decimal_is_sure=decimal_is_sure) is not None

    if first is None:
        first = _first_row(rows, is_number, least)
    body = [row for row in rows[first:] if row] if first is not None else []
    for _ in range(min(LARGEST_SUMMARY, len(body) - 1)):
        if sum(map(is_number, body[-1])) + any(map(_is_time_of_day, body[-1])) >= least:
            break
        body.pop()  # below the readings
    if first is None or not body:
        return None
    width = max(set(map(len, body)), key=[len(row) for row in body].count)
    same = [row for row in body if len(row) == width]
    numeric, clocks = (
        tuple(
            i
            for i in range(width)
            if sum(map(test, (row[i] for row in same))) >= _NUMERIC_SHARE * len(same)
            and any(row[i].strip().lower() not in MISSING for row in same)
        )
        for test in (is_number, _is_time_of_day)
    )
    enough = len(numeric) + bool(clocks) >= least
    if not enough or len(same) < _NUMERIC_SHARE * len(body):
        return None
    return Table(separator, decimal, first, width, numeric, clocks)


def _is_time_of_day(cell: str) -> bool:
    return time_of_day(cell) is not None


def _first_row(rows: list[list[str]], is_number: Callable[[str], bool], least: int) -> int | None:
    """Return the first line that is a row: so many numbers, as many cells as the last ones.

    A few such rows above a line that names the quantities are a summary of the test, no readings.
    Rows above it in which a reading is missing, and all else are numbers, belong to it. Where no
    row has all of them (topics that were joined by their times), such rows are all there are.
    """
    widths = [len(row) for row in rows if row][-20:]
    usual = max(set(widths), key=widths.count)
    first = None
    count = 0
    for line, row in enumerate(rows):
        given = [cell for cell in row if cell.strip().lower() not in MISSING]
        numbers = sum(map(is_number, given)) + any(map(_is_time_of_day, given))
        if len(row) == usual and numbers >= least:
            first = line if first is None else first
            count += 1
        elif count <= LARGEST_SUMMARY and not numbers and names_quantities(row):
            first, count = None, 0
    if first is None and usual >= least:
        lacking = (n for n, row in enumerate(rows) if _lacks_a_reading(row, usual, is_number))
        return next(lacking, None)
    while first is not None and first > 0 and _lacks_a_reading(rows[first - 1], usual, is_number):
        first -= 1
    return first


def _lacks_a_reading(row: list[str], usual: int, is_number: Callable[[str], bool]) -> bool:
    """Whether a row that is no first row is one of numbers but for readings that are missing."""
    filled = [cell for cell in row if cell.strip().lower() not in MISSING]
    numbers = sum(map(is_number, filled))
    return len(row) == usual and numbers == len(filled) > 1


def names_quantities(row: Sequence[str]) -> bool:
    """Whether a row names two of the quantities at least: it stands above a table."""
    words = [cell for cell in row if cell.upper() != cell.lower()]  # those with a letter in them
    if not words:
        return False
    named = sum(
        any(split_name(cell, quantity)[0] in NAMES[quantity] for cell in words)
        for quantity in QUANTITIES
    )
    return named >= len(QUANTITIES) - 1


def why_no_rows(lines: list[str]) -> str:
    """Return why there are no rows of three numbers and what to do, nothing if it is not plain."""
    last = next(line for line in reversed(lines) if line.strip()).strip()
    if last[0] in "{[":
        return (
            "it is written as JSON, with brackets: write its three columns as a table with the "
            "header time_s,displacement_mm,force_N"
        )
    clock = _CLOCK.search(last)
    if clock is not None:
        return (
            f"the time is written as on a clock ({clock[0]}), in a way that is not known: write it "
            "as seconds from the start"
        )
    for separator in SEPARATORS:
        matches = [_WITH_UNIT.match(cell) for cell in split_line(last, separator)]
        units = [found["unit"] for found in matches if found is not None]
        if separator != " " and len(units) >= len(QUANTITIES) - 1:
            return (
                f"numbers have their unit behind them ({', '.join(units)}): export them without "
                "it, and with the units in the names of the columns"
            )
    for separator in SEPARATORS:
        for decimal in ".,":
            table = cut(lines, separator, decimal, None, least=2) if separator != decimal else None
            if table is not None and len(table.numeric) == 2:
                return _two_columns(lines, table)
    return ""


def _two_columns(lines: list[str], table: Table) -> str:
    """Return what a table of two columns lacks, and what to do."""
    above = split_line(lines[table.first - 1], separator=table.separator) if table.first else []
    named = [
        quantity
        for quantity in QUANTITIES
        if any(split_name(cell, quantity)[0] in NAMES[quantity] for cell in above)
    ]
    has = "it has two columns of numbers, and three are needed"
    if "time" in named and len(named) == len(QUANTITIES) - 1:
        missing = next(quantity for quantity in QUANTITIES if quantity not in named)
        return f"{has}: the {missing} is missing; export it together with the others"
    return (
        f"{has}: export time, displacement and force, or say how many rows a second: "
        f"--rate {_rate(lines)}"
    )


def _rate(lines: list[str]) -> str:
    """Return the rate that a file of LabVIEW without a column of time tells, else three points."""
    for line in lines:
        name, *steps = line.split("\t")
        step = number(steps[0], "," if "," in steps[0] else ".") if steps else None
        if name == "Delta_X" and step:
            return f"{1.0 / step:g}"
    return "..."
