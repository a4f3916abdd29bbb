"""Where the rows of numbers of a CSV file are: cut into cells, below which header, or why not.

Testing machines write their own results above the table of readings (Instron's Bluehill), LabVIEW
two headers with the units between them.
"""

from __future__ import annotations

import re
from typing import Final, NamedTuple

from hc_logger.csv_text import MISSING, number, split_line
from hc_logger.csv_vocabulary import NAMES, QUANTITIES, split_name

SEPARATORS: Final = {",": "comma", ";": "semicolon", "\t": "tab", "|": "bar", " ": "space"}
LABVIEW: Final = "LabVIEW Measurement"
"""First cell of a file of LabVIEW (.lvm)."""
_NUMERIC_SHARE: Final = 0.9
_LARGEST_SUMMARY: Final = 20
"""Rows; as many numbers above another header are results, more are readings."""
_CLOCK: Final = re.compile(r"\d{1,2}:\d{2}:\d{2}")
_THOUSANDS: Final = re.compile(
    r"(?<![\d.,])[1-9]\d{0,2}(?:(?:\.\d{3})+,\d+|(?:,\d{3})+\.\d+|"
    r"(?:['\N{RIGHT SINGLE QUOTATION MARK}\N{NO-BREAK SPACE}\N{NARROW NO-BREAK SPACE}]\d{3})+"
    r"(?:[.,]\d+)?)(?![\d.,])"
)
_WITH_UNIT: Final = re.compile(r"^\s*[-+]?\d+(?:[.,]\d+)?\s*(?P<unit>[^\W\d_]+)\s*$")


class Table(NamedTuple):
    """One way to cut the first lines into cells."""

    separator: str
    decimal: str
    first: int  # line of the first row of numbers
    width: int  # cells in a row
    numeric: tuple[int, ...]  # columns that hold numbers


def cut(
    lines: list[str],
    separator: str,
    decimal: str,
    first: int | None,
    least: int = len(QUANTITIES),
) -> Table | None:
    """Cut lines into cells.

    Args:
        lines: the first ones of the file.
        separator: between cells.
        decimal: sign in numbers.
        first: line of the first row of numbers; None finds out.
        least: columns of numbers that there must be.

    Returns:
        The table, None if that gives no rows of so many numbers.
    """
    rows = [split_line(line, separator) if line.strip() else [] for line in lines]
    if first is None:
        first = _first_row(rows, decimal, least)
    body = [row for row in rows[first:] if row] if first is not None else []
    if first is None or not body:
        return None
    width = max(set(map(len, body)), key=[len(row) for row in body].count)
    same = [row for row in body if len(row) == width]
    numeric = tuple(
        i
        for i in range(width)
        if sum(number(row[i], decimal) is not None for row in same) >= _NUMERIC_SHARE * len(same)
        and any(row[i].strip().lower() not in MISSING for row in same)
    )
    if len(numeric) < least or len(same) < _NUMERIC_SHARE * len(body):
        return None
    return Table(separator, decimal, first, width, numeric)


def _first_row(rows: list[list[str]], decimal: str, least: int) -> int | None:
    """Return the first line that is a row: so many numbers, as many cells as the last ones.

    A few such rows above a line that names the quantities are a summary of the test, no readings.
    Rows above it in which a reading is missing, and all else are numbers, belong to it.
    """
    widths = [len(row) for row in rows if row][-20:]
    usual = max(set(widths), key=widths.count)
    first = None
    count = 0
    for line, row in enumerate(rows):
        given = [cell for cell in row if cell.strip().lower() not in MISSING]
        numbers = sum(number(cell, decimal) is not None for cell in given)
        if len(row) == usual and numbers >= least:
            first = line if first is None else first
            count += 1
        elif count <= _LARGEST_SUMMARY and not numbers and _named(row) >= len(QUANTITIES) - 1:
            first, count = None, 0
    while first is not None and first > 0 and _lacks_a_reading(rows[first - 1], usual, decimal):
        first -= 1
    return first


def _lacks_a_reading(row: list[str], usual: int, decimal: str) -> bool:
    """Whether a row that is no first row is one of numbers but for readings that are missing."""
    filled = [cell for cell in row if cell.strip().lower() not in MISSING]
    numbers = sum(number(cell, decimal) is not None for cell in filled)
    return len(row) == usual and numbers == len(filled) > 1


def _named(row: list[str]) -> int:
    """Return how many quantities a row names."""
    return sum(
        any(split_name(cell, quantity)[0] in NAMES[quantity] for cell in row)
        for quantity in QUANTITIES
    )


def labview_header(above: list[list[str]], width: int) -> tuple[list[str], list[str]]:
    """Return names and units of the columns of a file of LabVIEW, each empty if there are none.

    Args:
        above: the cells of the lines above the first row of numbers.
        width: cells in a row.
    """
    by_name = {row[0]: row for row in above}
    units = [*by_name.get("Y_Unit_Label", []), *[""] * width][:width]
    names = [*by_name.get("X_Value", []), *[""] * width][:width]
    if "Time" in by_name.get("X_Dimension", ["Time"]):
        names = ["Time" if name == "X_Value" else name for name in names]
        units[0] = "s"
    return (names if any(names) else []), (units if any(units) else [])


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
        return f"the time is written as on a clock ({clock[0]}): write it as seconds from the start"
    thousands = next((found for line in lines[-50:] if (found := _THOUSANDS.search(line))), None)
    if thousands is not None:
        return f"numbers have a sign between the thousands ({thousands[0]}): export them without it"
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
            if table is not None and len(table.numeric) == 2 == table.width:
                return (
                    "it has two columns of numbers, and three are needed: export time, "
                    "displacement and force"
                )
    return ""
