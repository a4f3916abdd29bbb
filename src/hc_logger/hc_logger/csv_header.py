"""What stands above the rows of a CSV file: the names of the columns and their units.

Most have one line of names, with the units in it or in a line below; LabVIEW has two headers, with
the units between them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

from hc_logger.csv_table import Table, names_quantities
from hc_logger.csv_text import split_line
from hc_logger.csv_vocabulary import QUANTITIES, UNITS, unit_of

COMMENT_SIGNS: Final = "#% "
"""Before a header, as numpy and MATLAB write them."""
_LABVIEW: Final = "LabVIEW Measurement"
"""First cell of a file of LabVIEW (.lvm)."""


class Header(NamedTuple):
    """What is told of the columns; each is empty if it is not there.

    Attributes:
        names: of the columns.
        units: from a line of their own.
        line: the cells of the line of names as they stand in the file.
    """

    names: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    line: tuple[str, ...] = ()


def find_header(lines: Sequence[str], table: Table) -> Header:
    """Return what the lines above the rows tell of the columns.

    Args:
        lines: the first ones of the file.
        table: where its rows are.
    """
    above = [
        row_of_header(split_line(line.lstrip(COMMENT_SIGNS), table.separator))
        for line in lines[: table.first]
        if any(map(str.isalnum, line))  # else it is drawn
    ]
    if above and above[0][0] == _LABVIEW:
        names, units = _of_labview(above, table.width)
        return Header(tuple(names), tuple(units), tuple(above[-1]))
    rows = [row for row in above if len(row) == table.width]
    below = rows.pop() if len(rows) > 1 and is_of_units(rows[-1]) else []
    last = tuple(rows[-1]) if rows else ()
    return Header(last, tuple(below), last)


def row_of_header(cells: Sequence[str]) -> list[str]:
    """Return the cells of a line without the space around them."""
    return [cell.strip() for cell in cells]


def _of_labview(above: list[list[str]], width: int) -> tuple[list[str], list[str]]:
    """Return names and units of the columns of a file of LabVIEW, each empty if there are none."""
    by_name = {row[0]: row for row in above}
    units = [*by_name.get("Y_Unit_Label", []), *[""] * width][:width]
    names = [*by_name.get("X_Value", []), *[""] * width][:width]
    if "Time" in by_name.get("X_Dimension", ["Time"]):
        names = ["Time" if name == "X_Value" else name for name in names]
        units[0] = "s"
    return (names if any(names) else []), (units if any(units) else [])


def is_of_units(row: Sequence[str]) -> bool:
    """Whether a line below the names tells their units; some of them may be others than ours."""
    units = [unit_of(cell) for cell in row]
    quantities = {q for q in QUANTITIES for unit in units if unit in UNITS[q]}
    others = [cell for cell, unit in zip(row, units, strict=True) if cell and unit is None]
    drawn = all(cell.strip("[](){}<>- ") == "" for cell in others)
    return bool(quantities) and (drawn or (len(quantities) > 1 and not names_quantities(row)))
