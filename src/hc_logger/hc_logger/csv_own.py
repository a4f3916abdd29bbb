"""CSV files of our own, which are known by the names of their columns and need no finding out."""

from __future__ import annotations

from hc_logger.csv_columns import status_column
from hc_logger.csv_header import COMMENT_SIGNS
from hc_logger.csv_layout import COLUMNS, CsvLayout
from hc_logger.csv_text import split_line


def own_layout(lines: list[str], encoding: str) -> CsvLayout | None:
    """Return the layout of a file whose first line names our columns, None for another."""
    first = lines[0].lstrip(COMMENT_SIGNS) if lines else ""
    for separator in (",", ";", "\t"):
        names = [name.strip() for name in split_line(first, separator)]
        if all(names.count(name) == 1 for name in COLUMNS):
            a, b, c = (names.index(name) for name in COLUMNS)
            decimal = "."
            if separator != ",":
                cells = [split_line(line, separator) for line in lines[1:]]
                decimal = "," if any("," in cell for row in cells for cell in row) else "."
            factors = (1.0, 1.0, 1.0)
            width, header = len(names), tuple(names)
            return CsvLayout(
                encoding,
                separator,
                decimal,
                1,
                (a, b, c),
                COLUMNS,
                factors,
                width,
                header,
                status=status_column(names),
            )
    return None
