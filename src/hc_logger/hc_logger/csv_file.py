"""CSV recordings, block by block, with clear errors.

Ours have the columns time_s, displacement_mm, force_N; csv_finder.py finds out about others. NaN
rows and times that repeat or go back are data, not errors: the estimator rejects such samples one
by one. Text where a number belongs is an error that names its line.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hc_logger.csv_finder import find_layout
from hc_logger.csv_layout import COLUMNS
from hc_logger.csv_options import CsvOptions
from hc_logger.csv_rows import RowReader
from hc_logger.csv_time import BETWEEN_S, Cycles
from hc_logger.new_file import write_new_text


class CsvReader:
    """Reads one CSV recording, once."""

    def __init__(self, path: str | os.PathLike[str], options: CsvOptions | None = None) -> None:
        """Find out how the file is written.

        Args:
            path: the file.
            options: what is known of it.

        Raises:
            BagError: if it cannot be read, or it is not clear what it holds; says what to give.
        """
        path = Path(path)
        self._layout = find_layout(path, options)
        self._rows = RowReader(path, self._layout)
        self._cycles = Cycles()

    @property
    def notes(self) -> tuple[str, ...]:
        """What was assumed, passed over and left out; complete after the last block."""
        again = self._cycles.again
        times = "once" if again == 1 else f"{again} times"
        cycles = (
            f"the time begins anew {times}: cycles of one test, put one behind the other with "
            f"{BETWEEN_S:g} s between them"
        )
        return (*self._layout.notes, *self._rows.notes, *([cycles] if again else []))

    @property
    def characters(self) -> int:
        """How many were read so far below the header."""
        return self._rows.characters

    def blocks(self) -> Iterator[NDArray[np.float64]]:
        """Yield the rows in blocks (rows, 3): s, mm, N. An empty cell is NaN.

        Raises:
            BagError: if the file cannot be read, lacks a column or holds text; names line and
                column.
        """
        is_own = self._layout.names == COLUMNS and not self._layout.notes
        for rows in self._rows.blocks():
            if not is_own:
                rows[:, 0] = self._cycles.one_behind_the_other(rows[:, 0])
            yield rows


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
