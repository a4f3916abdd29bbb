"""Whether the writing of a CSV file ended within its last line: its logger was killed.

A line without an end is complete in many a file. Where cells are missing it is none; and a number
that was cut has fewer digits behind its decimal sign than any other in its column (of a format of
its own each has as many, and of the shortest that say a value hardly one in a thousand has so few).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from hc_logger.csv_layout import NO_COLUMN, CsvLayout
from hc_logger.csv_number import number
from hc_logger.csv_text import split_line

FEWEST: Final = 8
"""Lines before the last one from which a column's way of writing is seen."""
LOOKED_AT: Final = 1000
"""So many of them are looked at, at most."""


def cut_off_note(last: str, before: Sequence[str], layout: CsvLayout) -> str:
    """Say that a last line was cut off, and is no row; empty where it seems to be complete.

    Args:
        last: line with its end, which may be the last of the file.
        before: lines before it, the latest last.
        layout: how the file is written.
    """
    if not last.strip() or last.endswith("\n"):
        return ""
    cells = [cell.strip() for cell in split_line(last, layout.separator)]
    least = layout.width if layout.separator == " " else max(layout.indices) + 1
    if len(cells) < least:
        return "the last line is cut off in its middle: it is left out"
    needed = {*layout.indices, layout.nanoseconds} - {NO_COLUMN}
    column = len(cells) - 1
    rows = [split_line(line, layout.separator) for line in before[-LOOKED_AT:]]
    fewer = bool(rows) and len(cells) < min(map(len, rows))  # not where cells are left out at will
    if column in needed and (fewer or _is_shorter(cells, rows, layout)):
        return (
            f"the last line has no end, and its number {cells[column]!r} less than the others in "
            "its column: it was cut off, and is left out"
        )
    return ""


def _is_shorter(cells: Sequence[str], rows: Sequence[Sequence[str]], layout: CsvLayout) -> bool:
    """Whether the last cell has fewer characters behind its decimal sign than all before it."""
    column = len(cells) - 1
    column_cells = [row[column].strip() for row in rows if len(row) > column]
    values = [number(cell, layout.decimal) for cell in column_cells]
    numbers = [
        cell
        for cell, value in zip(column_cells, values, strict=True)
        if value is not None and math.isfinite(value)
    ]
    if len(numbers) < FEWEST:
        return False
    least = min(_behind(cell, layout.decimal) for cell in numbers)
    return _behind(cells[column], layout.decimal) < least


def _behind(cell: str, decimal: str) -> int:
    """Return how many characters stand behind the decimal sign, -1 without one."""
    return len(cell) - cell.index(decimal) - 1 if decimal in cell else -1
