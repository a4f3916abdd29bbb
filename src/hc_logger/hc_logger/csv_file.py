"""CSV recordings (columns time_s, displacement_mm, force_N), block by block, with clear errors.

NaN rows and times that repeat or go back are data, not errors: the estimator rejects such samples
one by one. Text where a number belongs is an error that names its line.
"""

from __future__ import annotations

import csv
import os
from collections.abc import Iterable, Iterator
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hc_logger.errors import BagError
from hc_logger.new_file import write_new_text

COLUMNS = ("time_s", "displacement_mm", "force_N")
BLOCK_ROWS = 65536


def read_csv(path: str | os.PathLike[str]) -> Iterator[NDArray[np.float64]]:
    """Yield the rows of a CSV recording in blocks (rows, 3): s, mm, N.

    Columns are found by name; others are ignored. An empty cell is NaN.

    Raises:
        BagError: if the file cannot be read, lacks a column or holds text; names line and column.
    """
    path = Path(path)
    try:
        with open(path, encoding="utf-8-sig", newline="") as stream:
            names = [name.strip() for name in stream.readline().rstrip("\r\n").split(",")]
            missing = [name for name in COLUMNS if name not in names]
            if missing:
                raise BagError(
                    f"{path}: column {', '.join(missing)} is missing; the first line must name "
                    f"the columns {','.join(COLUMNS)} and is {','.join(names)[:80]!r}"
                )
            indices = [names.index(name) for name in COLUMNS]
            line = 2
            while lines := list(islice(stream, BLOCK_ROWS)):
                yield _parse(path, lines, indices, line)
                line += len(lines)
    except OSError as error:
        raise BagError(f"cannot read {path}: {error.strerror}") from error
    except UnicodeDecodeError:
        raise BagError(f"{path} is not a text file") from None


def _parse(path: Path, lines: list[str], indices: list[int], first: int) -> NDArray[np.float64]:
    if all(line.isspace() for line in lines):
        return np.empty((0, len(COLUMNS)))
    try:
        return np.loadtxt(lines, delimiter=",", usecols=indices, comments=None, ndmin=2)
    except ValueError:
        return _parse_slowly(path, lines, indices, first)


def _parse_slowly(
    path: Path, lines: list[str], indices: list[int], first: int
) -> NDArray[np.float64]:
    """Convert row by row: for blocks with empty cells, and to name the line of an error."""
    rows = []
    for number, cells in enumerate(csv.reader(lines), start=first):
        if not cells:
            continue
        values = []
        for name, index in zip(COLUMNS, indices, strict=True):
            if index >= len(cells):
                raise BagError(
                    f"{path}, line {number}: {len(cells)} columns, {name} is number {index + 1}"
                )
            cell = cells[index].strip()
            try:
                values.append(float(cell) if cell else np.nan)
            except ValueError:
                raise BagError(
                    f"{path}, line {number}: {name} is {cell[:40]!r} instead of a number"
                ) from None
        rows.append(values)
    return np.array(rows, float).reshape(-1, len(COLUMNS))


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
