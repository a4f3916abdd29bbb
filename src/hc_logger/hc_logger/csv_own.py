"""CSV files of our own, which are known by the names of their columns and need no finding out."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from hc_logger.csv_columns import status_column
from hc_logger.csv_header import COMMENT_SIGNS, is_of_units, row_of_header
from hc_logger.csv_layout import COLUMNS, CsvLayout
from hc_logger.csv_text import split_line
from hc_logger.csv_vocabulary import QUANTITIES, unit_of
from hc_logger.errors import BagError

_UNITS: Final = ("s", "mm", "N")
"""Of COLUMNS."""


def own_layout(path: Path, lines: list[str], encoding: str) -> CsvLayout | None:
    """Return the layout of a file whose first line names our columns, None for another.

    Args:
        path: the file.
        lines: the first ones of it.
        encoding: of it.

    Raises:
        BagError: if a line of units follows that are others than those in the names.
    """
    first = lines[0].lstrip(COMMENT_SIGNS) if lines else ""
    for separator in (",", ";", "\t"):
        names = [name.strip() for name in split_line(first, separator)]
        if all(names.count(name) == 1 for name in COLUMNS):
            a, b, c = (names.index(name) for name in COLUMNS)
            decimal = "."
            if separator != ",":
                cells = [split_line(line, separator) for line in lines[1:]]
                decimal = "," if any("," in cell for row in cells for cell in row) else "."
            below = row_of_header(split_line(lines[1], separator)) if len(lines) > 1 else []
            has_units = len(below) == len(names) and is_of_units(below)
            if has_units:
                _check_units(path, [below[i] for i in (a, b, c)])
            factors = (1.0, 1.0, 1.0)
            width, header = len(names), tuple(names)
            return CsvLayout(
                encoding,
                separator,
                decimal,
                2 if has_units else 1,
                (a, b, c),
                COLUMNS,
                factors,
                width,
                header,
                status=status_column(names),
            )
    return None


def _check_units(path: Path, cells: list[str]) -> None:
    """See that a line of units says what the names above it say; it may leave one out."""
    for name, unit, quantity, cell in zip(COLUMNS, _UNITS, QUANTITIES, cells, strict=True):
        if any(map(str.isalnum, cell)) and unit_of(cell, quantity) != unit:
            raise BagError(
                f"{path}, line 2 says that {name} is in {cell}, and its name that it is in {unit}: "
                f"mend the wrong one ({quantity} is a name without a unit)"
            )
