"""Lines of a CSV file, changed before they are read: times in two cells, forces that are none."""

from __future__ import annotations

import csv
import io
from typing import Final

from hc_logger.csv_columns import tells_an_error
from hc_logger.csv_layout import NO_COLUMN, CsvLayout
from hc_logger.csv_number import number
from hc_logger.csv_text import split_line

_NANO_DIGITS: Final = 9


class LineRewriter:
    """Puts seconds and nanoseconds into one cell, and takes out what the sensor calls an error.

    Args:
        layout: how the file is written.
    """

    def __init__(self, layout: CsvLayout) -> None:
        self._layout = layout
        self._refused: list[tuple[int, str]] = []  # lines without a force, and the status there

    def rewritten(self, lines: list[str], first: int) -> list[str]:
        """Return lines as they are to be read.

        Args:
            lines: of the file.
            first: number of the first of them.
        """
        if self._layout.nanoseconds != NO_COLUMN:
            lines = [self._with_whole_time(text) for text in lines]
        if self._layout.status != NO_COLUMN:
            lines = [self._without_refused(text, at) for at, text in enumerate(lines, first)]
        return lines

    def notes(self) -> list[str]:
        """Return what was left out so far, one line each."""
        if not self._refused:
            return []
        rows = "1 row" if len(self._refused) == 1 else f"{len(self._refused)} rows"
        (where, word), *_ = self._refused
        return [
            f"the sensor's status tells an error in {rows} (the first in line {where}: "
            f"{word}): the forces of these are left out"
        ]

    def _with_whole_time(self, line: str) -> str:
        """Return a line with seconds and nanoseconds in one cell, another one as it is."""
        layout, cells = self._layout, split_line(line, self._layout.separator)
        if len(cells) <= max(layout.indices[0], layout.nanoseconds):
            return line
        seconds, nano = (cells[i].strip() for i in (layout.indices[0], layout.nanoseconds))
        if not (seconds.isdigit() and nano.isdigit() and len(nano) <= _NANO_DIGITS):
            return line
        cells[layout.indices[0]] = f"{seconds}{layout.decimal}{nano:0>{_NANO_DIGITS}}"
        return self._line_of(cells)

    def _without_refused(self, line: str, where: int) -> str:
        """Return a line without its force where the sensor says that this is none."""
        layout, cells = self._layout, split_line(line, self._layout.separator)
        if len(cells) <= max(layout.indices[2], layout.status):
            return line
        word = cells[layout.status].strip()
        if not tells_an_error(word):
            return line
        if number(cells[layout.indices[2]], layout.decimal) is None:
            return line
        self._refused.append((where, word))
        cells[layout.indices[2]] = "nan"
        return self._line_of(cells)

    def _line_of(self, cells: list[str]) -> str:
        """Return a line of these cells."""
        text = io.StringIO()
        separator = "\t" if self._layout.separator == " " else self._layout.separator
        csv.writer(text, delimiter=separator, lineterminator="\n").writerow(cells)
        return text.getvalue()
