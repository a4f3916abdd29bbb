"""CSV recordings, block by block, with clear errors.

Ours have the columns time_s, displacement_mm, force_N; csv_layout.py finds out about others. NaN
rows and times that repeat or go back are data, not errors: the estimator rejects such samples one
by one. Text where a number belongs is an error that names its line.
"""

from __future__ import annotations

import csv
import os
from collections.abc import Iterable, Iterator
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hc_logger.csv_layout import COLUMNS, CsvLayout, find_layout
from hc_logger.csv_text import is_cut_off, limited_lines, number
from hc_logger.errors import BagError
from hc_logger.new_file import write_new_text

__all__ = ["COLUMNS", "read_csv", "write_csv"]

BLOCK_ROWS = 65536


def read_csv(
    path: str | os.PathLike[str], layout: CsvLayout | None = None
) -> Iterator[NDArray[np.float64]]:
    """Yield the rows of a CSV recording in blocks (rows, 3): s, mm, N.

    An empty cell is NaN.

    Args:
        path: the file.
        layout: how it is written; None finds out.

    Raises:
        BagError: if the file cannot be read, lacks a column or holds text; names line and column.
    """
    path = Path(path)
    layout = layout or find_layout(path)
    stream = limited_lines(path, layout.encoding)
    for _ in islice(stream, layout.header_lines):
        pass
    line = layout.header_lines + 1
    factors = np.array(layout.factors)
    while lines := list(islice(stream, BLOCK_ROWS)):
        if is_cut_off(lines[-1], layout.separator, layout.indices):
            lines.pop()  # the layout's notes say so
        rows = _parse(path, lines, layout, line)
        yield rows if (factors == 1.0).all() else rows * factors
        line += len(lines)


def _parse(path: Path, lines: list[str], layout: CsvLayout, first: int) -> NDArray[np.float64]:
    if all(map(str.isspace, lines)):
        return np.empty((0, len(COLUMNS)))
    plain = [line.replace(",", ".") for line in lines] if layout.decimal == "," else lines
    try:
        return np.loadtxt(
            plain,
            delimiter=None if layout.separator == " " else layout.separator,
            usecols=layout.indices,
            comments=None,
            ndmin=2,
        )
    except ValueError:
        return _parse_slowly(path, lines, layout, first)


def _parse_slowly(
    path: Path, lines: list[str], layout: CsvLayout, first: int
) -> NDArray[np.float64]:
    """Convert row by row: for blocks with empty cells, and to name the line of an error."""
    rows = []
    for where, cells in _rows(path, lines, layout, first):
        values = []
        for name, index in zip(layout.names, layout.indices, strict=True):
            if index >= len(cells):
                raise BagError(
                    f"{path}, line {where}: {len(cells)} columns, {name} is number {index + 1}"
                )
            value = number(cells[index], layout.decimal)
            if value is None:
                shown = "".join(c if c.isprintable() else " " for c in cells[index][:40])
                raise BagError(f"{path}, line {where}: {name} is {shown!r} instead of a number")
            values.append(value)
        rows.append(values)
    return np.array(rows, float).reshape(-1, len(COLUMNS))


def _rows(
    path: Path, lines: list[str], layout: CsvLayout, first: int
) -> Iterator[tuple[int, list[str]]]:
    """Yield the cells of each line that has some, with its number."""
    if layout.separator == " ":
        for where, line in enumerate(lines, start=first):
            if not line.isspace():
                yield where, line.split()
        return
    reader = csv.reader(lines, delimiter=layout.separator)
    while True:
        try:
            cells = next(reader, None)
        except csv.Error as error:
            where = first + max(reader.line_num - 1, 0)
            raise BagError(f"{path}, line {where} cannot be read: {error}") from None
        if cells is None:
            return
        if any(cell.strip() for cell in cells):
            yield first + reader.line_num - 1, cells


def write_csv(
    path: str | os.PathLike[str], blocks: Iterable[NDArray[np.float64]], *, overwrite: bool = False
) -> int:
    """Write blocks (rows, 3) of s, mm, N as a CSV recording and return the number of rows.

    Times get nine decimals, the other numbers as many as it takes to read back the same value.

    Raises:
        BagExistsError: if the file exists and overwrite is not set.
        BagError: if it cannot be written; nothing is left of it then.
    """
    count = 0

    def lines() -> Iterator[str]:
        nonlocal count
        yield ",".join(COLUMNS) + "\n"
        for block in blocks:
            count += len(block)
            yield "".join(f"{t:.9f},{d!r},{f!r}\n" for t, d, f in block.tolist())

    write_new_text(path, lines(), overwrite=overwrite)
    return count
