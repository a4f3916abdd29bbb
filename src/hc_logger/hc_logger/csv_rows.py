"""The rows of numbers of a CSV file, block by block, and what stands between and below them.

Machines write a header anew on every page or for every cycle, more than one table into a file, and
results below the readings. A header that comes again while the time goes on is passed over, a few
lines at the end are left out, and both are said; a second table is refused with the option that
chooses one. Text in the midst of the rows is an error that names its line.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Generator, Iterator
from itertools import islice
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from hc_logger.csv_clock_column import ClockColumn
from hc_logger.csv_ending import LOOKED_AT, cut_off_note
from hc_logger.csv_header import row_of_header
from hc_logger.csv_layout import NO_COLUMN, CsvLayout
from hc_logger.csv_number import (
    clock_time,
    number,
    pair_in_doubt,
    shows_decimal_sign,
    thousands_in_doubt,
)
from hc_logger.csv_rewriting import LineRewriter
from hc_logger.csv_table import LARGEST_SUMMARY, names_quantities
from hc_logger.csv_text import limited_lines, split_line
from hc_logger.errors import BagError

BLOCK_ROWS: Final = 65536
_QUANTITIES: Final = 3
_SHOWN: Final = 40
_REMARKS: Final = "remarks"
"""Lines that begin with #, as a person or a logger writes them between the rows."""


class _Interruption:
    """Lines within the rows that are none, and the few rows behind them."""

    def __init__(self, line: int, cell: str) -> None:
        self.line = line  # the first one
        self.cell = cell  # that stands where a time should
        self.last_line = line
        self.kind = ""  # "same" or "other" if a line of names is among them, or all are _REMARKS
        self.resumes = 0  # line of the first row behind it
        self.rows = 0  # behind it


class RowReader:
    """Reads the rows of one file, once.

    Attributes:
        notes: what was passed over or left out, one line each; complete after the last block.
        characters: how many were read.
    """

    def __init__(self, path: Path, layout: CsvLayout) -> None:
        """Begin.

        Args:
            path: the file.
            layout: how it is written.
        """
        self.notes: list[str] = []
        self.characters = 0
        self._path = path
        self._layout = layout
        self._indices = [i for i in layout.indices if i != NO_COLUMN]
        self._count = 0  # rows given
        self._time = -math.inf  # of the last row, as it is written
        self._clock = ClockColumn(layout) if layout.clock else None
        self._rewriter = LineRewriter(layout)
        self._interruption: _Interruption | None = None
        self._repeated: list[int] = []  # lines of headers that came again
        self._remarks: list[int] = []  # the first lines of remarks between rows
        self._has_ended = False
        self._is_open = layout.decimal_is_open

    def blocks(self) -> Iterator[NDArray[np.float64]]:
        """Yield the rows in blocks (rows, 3): s, mm, N.

        Raises:
            BagError: if the file cannot be read or holds other rows; names line and column.
        """
        layout = self._layout
        stream = limited_lines(self._path, layout.encoding)
        for _ in islice(stream, layout.header_lines):
            pass
        line, latest = layout.header_lines + 1, list[str]()  # of the block before
        factors = np.array(layout.factors)
        while not self._has_ended and (lines := list(islice(stream, BLOCK_ROWS))):
            self.characters += sum(map(len, lines))
            if note := cut_off_note(lines[-1], latest + lines[:-1], layout):
                lines.pop()
                self.notes.append(note)
            latest = lines[-LOOKED_AT:]
            rows = self._parse(self._rewriter.rewritten(lines, line), line)
            if self._is_open and any(layout.decimal in line for line in lines):
                self._check_thousands(lines)
            yield rows if (factors == 1.0).all() else rows * factors
            line += len(lines)
        self._end()

    def _parse(self, lines: list[str], first: int) -> NDArray[np.float64]:
        """Return the rows of some lines, times as they are written."""
        if all(map(str.isspace, lines)):
            return np.empty((0, _QUANTITIES))
        rows = self._parse_clock(lines) if self._clock is not None else self._parse_plain(lines)
        if rows is None:
            return self._parse_slowly(lines, first)
        times = rows[np.isfinite(rows[:, 0]), 0]
        self._time = float(times[-1]) if len(times) else self._time
        self._count += len(rows)
        return rows

    def _parse_plain(self, lines: list[str]) -> NDArray[np.float64] | None:
        """Return rows of numbers in one go; None where a line has something else."""
        if not self._is_plain(lines):
            return None
        rows = self._loaded(lines, self._indices)
        if rows is not None and self._layout.rate_hz:
            rows = np.column_stack([self._counted(len(rows)), rows])
        return rows

    def _parse_clock(self, lines: list[str]) -> NDArray[np.float64] | None:
        """Return rows with times as on a clock in one go; None where a line is another."""
        layout, separator = self._layout, self._layout.separator
        lines = [line for line in lines if not line.isspace()]
        rows = [line.split(None if separator == " " else separator) for line in lines]
        if self._clock is None or {len(row) for row in rows} != {layout.width}:
            return None
        _, a, b = layout.indices
        lines = [f"{row[a]}{separator}{row[b]}" for row in rows]
        if not self._is_plain(lines) or any('"' in line for line in lines):
            return None
        numbers = self._loaded(lines, [0, 1])
        if numbers is None or len(numbers) < len(rows):
            return None
        times_s = self._clock.elapsed_of(rows)
        return None if times_s is None else np.column_stack([times_s, numbers])

    def _loaded(self, lines: list[str], columns: list[int]) -> NDArray[np.float64] | None:
        """Return the numbers of some columns, None if there is something else in them."""
        comma, separator = self._layout.decimal == ",", self._layout.separator
        try:
            return np.loadtxt(
                [line.replace(",", ".") for line in lines] if comma else lines,
                delimiter=None if separator == " " else separator,
                usecols=columns,
                comments=None,
                ndmin=2,
            )
        except ValueError:
            return None

    def _is_plain(self, lines: list[str]) -> bool:
        """Whether the lines may be read all at once: cells are where they should be."""
        layout = self._layout
        if self._interruption is not None or layout.separator == layout.decimal:
            return False
        if layout.decimal == "," and any("." in line for line in lines):
            return False
        if layout.separator == " ":
            widths = {0, len(self._indices) - 1 if layout.clock else layout.width}
            return {len(line.split()) for line in lines} <= widths
        return max(line.count(layout.separator) for line in lines) < layout.width

    def _counted(self, count: int) -> NDArray[np.float64]:
        return (self._count + np.arange(count)) / self._layout.rate_hz

    def _parse_slowly(self, lines: list[str], first: int) -> NDArray[np.float64]:
        """Convert row by row: for blocks with something else than numbers in them."""
        rows: list[list[float]] = []
        for where, cells in self._rows_of_cells(lines, first):
            values = self._values(where, cells)
            if values is None:
                self._interrupt(where, cells)
            elif self._goes_on(where, values[0]):
                self._count += 1
                self._time = values[0] if math.isfinite(values[0]) else self._time
                rows.append(values)
            if self._has_ended:
                break
        return np.array(rows, float).reshape(-1, _QUANTITIES)

    def _rows_of_cells(self, lines: list[str], first: int) -> Iterator[tuple[int, list[str]]]:
        """Yield the cells of each line that has some, with its number."""
        separator = self._layout.separator
        if separator == " ":
            for where, line in enumerate(lines, start=first):
                if not line.isspace():
                    yield where, line.split()
            return
        begin: int | None = 0
        while begin is not None:
            begin = yield from self._cells_from(lines, begin, first)

    def _cells_from(
        self, lines: list[str], begin: int, first: int
    ) -> Generator[tuple[int, list[str]], None, int | None]:
        """Yield cells as `_rows_of_cells` from one of the lines on.

        A cell in quotation marks may go on over several lines. Where rows stand in those, nobody
        has closed it: it ends in its line then.

        Returns:
            The line to go on from, None at the end.
        """
        separator = self._layout.separator
        reader = csv.reader((lines[k] for k in range(begin, len(lines))), delimiter=separator)
        line = begin
        while True:
            try:
                cells, is_open = next(reader, None), False
            except csv.Error as error:
                if not any(map(self._is_row, lines[line + 1 : line + 2])):
                    where = first + begin + max(reader.line_num - 1, 0)
                    raise BagError(f"{self._path}, line {where} cannot be read: {error}") from None
                cells, is_open = [], True  # rather not closed than too long
            if cells is None:
                return None
            after = begin + reader.line_num
            if is_open or any(map(self._is_row, lines[line + 1 : after])):
                yield first + line, split_line(lines[line], separator)
                return line + 1
            if any(cell.strip() for cell in cells):
                yield first + after - 1, cells
            line = after

    def _is_row(self, line: str) -> bool:
        """Whether there is a number, or none said to be missing, in every place of a line."""
        layout, cells = self._layout, split_line(line, self._layout.separator)
        return all(
            index < len(cells)
            and (clock_time if layout.clock and quantity == 0 else self._number)(cells[index])
            is not None
            for quantity, index in enumerate(layout.indices)
            if index != NO_COLUMN
        )

    def _number(self, cell: str) -> float | None:
        layout = self._layout
        return number(cell, layout.decimal, decimal_is_sure=layout.decimal_is_sure)

    def _values(self, where: int, cells: list[str]) -> list[float] | None:
        """Return time, displacement and force of a line, None if it is no row.

        Raises:
            BagError: if it is one with text in it, or with too few or too many cells.
        """
        layout = self._layout
        found = [self._number(cells[i]) if i < len(cells) else None for i in self._indices]
        time = self._clock.read(cells) if self._clock is not None else None
        if self._clock is not None:
            found[0] = None if time is None else time.time_s
        no_number = [value is None for value in found]
        is_none = [value is None or math.isnan(value) for value in found]
        if all(no_number) if layout.rate_hz else no_number[0] or (is_none[0] and any(no_number)):
            return None
        names = [n for n, i in zip(layout.names, layout.indices, strict=True) if i != NO_COLUMN]
        values = []
        for name, index, value in zip(names, self._indices, found, strict=True):
            if index >= len(cells):
                raise BagError(
                    f"{self._path}, line {where}: {len(cells)} columns, {name} is number "
                    f"{index + 1}: complete the line or delete it"
                )
            if value is None:
                raise self._no_number(where, name, cells[index])
            values.append(value)
        if layout.separator == " " and len(cells) < layout.width:
            raise BagError(
                f"{self._path}, line {where} has {len(cells)} cells and the others {layout.width}: "
                "between spaces nobody sees which one is missing; write nan for it"
            )
        beyond = cells[layout.width] if len(cells) > layout.width else ""
        if beyond.strip() and self._number(beyond) is not None:
            raise BagError(
                f"{self._path}, line {where} has {len(cells)} cells and the others {layout.width}: "
                "does a number hold the sign that separates them?"
            )
        if layout.rate_hz:
            values.insert(0, float(self._counted(1)[0]))
        elif self._clock is not None and time is not None:
            values[0] = self._clock.elapsed(time)
        return values

    def _no_number(self, where: int, name: str, cell: str) -> BagError:
        shown = "".join(c if c.isprintable() else " " for c in cell[:_SHOWN])
        layout = self._layout
        why = "" if name == layout.names[0] else ": where a reading is missing, write nan"
        if number(cell, layout.decimal, decimal_is_sure=True) is not None:
            why = f": if a sign stands between its thousands, say --decimal {layout.decimal}"
        return BagError(f"{self._path}, line {where}: {name} is {shown!r} instead of a number{why}")

    def _no_row(self, found: _Interruption) -> BagError:
        named = zip(self._layout.names, self._layout.indices, strict=True)
        return self._no_number(found.line, next(n for n, i in named if i >= 0), found.cell)

    def _interrupt(self, where: int, cells: list[str]) -> None:
        """Note a line that is no row."""
        shown = next((cell.strip() for cell in cells if cell.strip()), "")
        found = self._interruption
        is_first = found is None
        if found is None:
            found = self._interruption = _Interruption(where, shown)
        found.last_line = where
        if not found.rows or found.kind in ("", _REMARKS):
            names = row_of_header(cells)
            if tuple(names) == self._layout.header:
                found.kind = "same"
            elif names_quantities(names):
                found.kind = "other"
            elif not shown.startswith("#"):
                found.kind = "" if found.kind == _REMARKS else found.kind
            elif is_first:
                found.kind = _REMARKS

    def _goes_on(self, where: int, time: float) -> bool:
        """Whether a row belongs to the table: none is behind a line that is no row.

        Raises:
            BagError: if so many rows are behind such a line that they are no results.
        """
        found = self._interruption
        if found is None:
            return True
        layout = self._layout
        goes_on = not found.rows and (layout.rate_hz or time >= self._time)
        if goes_on and (found.kind == _REMARKS or (found.kind == "same" and not layout.rate_hz)):
            (self._repeated if found.kind == "same" else self._remarks).append(found.line)
            self._interruption = None
            return True
        found.resumes = found.resumes or where
        found.last_line = where
        found.rows += 1
        if found.rows <= LARGEST_SUMMARY:
            return False
        if found.kind in ("", _REMARKS):
            raise self._no_row(found)
        if not layout.is_chosen:
            raise BagError(
                f"{self._path}: another table begins in line {found.resumes}; say which one is to "
                f"be read with --header-lines {layout.header_lines} or --header-lines "
                f"{found.resumes - 1}"
            )
        self._has_ended = True
        return False

    def _end(self) -> None:
        """Say what was passed over and left out."""
        self.notes += self._clock.notes if self._clock is not None else []
        if self._repeated:
            times = f" {len(self._repeated)} times" if len(self._repeated) > 1 else ""
            self.notes.append(
                f"the header comes again{times} within the rows (line {self._repeated[0]}): "
                "passed over"
            )
        if self._remarks:
            times = f" {len(self._remarks)} times" if len(self._remarks) > 1 else ""
            where = self._remarks[0]
            self.notes.append(f"remarks stand{times} within the rows (line {where}): passed over")
        self.notes += self._rewriter.notes()
        found = self._interruption
        if found is not None and not self._count:
            raise self._no_row(found)
        if found is not None and self._has_ended:
            self.notes.append(f"the table ends at line {found.line}: what follows is left out")
        elif found is not None:
            several = found.last_line > found.line
            until = f"s {found.line} to {found.last_line} are" if several else f" {found.line} is"
            self.notes.append(f"line{until} below the readings ({found.cell[:_SHOWN]!r}): left out")

    def _check_thousands(self, lines: list[str]) -> None:
        """See that whole numbers are not followed by ones with a sign between their thousands.

        Raises:
            BagError: if they may be.
        """
        layout = self._layout
        rows_of_cells = [split_line(line, layout.separator) for line in lines]
        names = [n for n, i in zip(layout.names, layout.indices, strict=True) if i >= 0]
        columns = [[cells[i] for cells in rows_of_cells if i < len(cells)] for i in self._indices]
        self._is_open = not any(shows_decimal_sign(cells, layout.decimal) for cells in columns)
        for name, cells in zip(names, columns, strict=True):
            pair = pair_in_doubt(cells, layout.decimal) if self._is_open else None
            if pair is not None:
                raise BagError(f"{self._path}: {thousands_in_doubt(name, pair, layout.decimal)}")
