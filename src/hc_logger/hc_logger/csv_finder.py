"""Finds out how a CSV file is written: encoding, separator, decimal sign, header, columns, units.

Every maker of testing machines has a way of their own. What the first lines leave no doubt about
is found, and said; where they leave a doubt (two columns of forces, no unit) the file is refused,
with the option that settles it. Files with our own header need none of this.
"""

from __future__ import annotations

import itertools
import math
import os
from functools import partial
from pathlib import Path

from hc_logger.csv_clock_column import date_column
from hc_logger.csv_columns import candidates, status_column
from hc_logger.csv_header import Header, find_header
from hc_logger.csv_layout import COLUMNS, NO_COLUMN, CsvLayout
from hc_logger.csv_number import (
    clock_period,
    has_groups,
    number,
    pair_in_doubt,
    shows_decimal_sign,
    thousands_in_doubt,
    time_of_day,
)
from hc_logger.csv_options import CsvOptions
from hc_logger.csv_own import own_layout
from hc_logger.csv_rate import why_not_counted
from hc_logger.csv_stress import why_no_displacement, why_no_force
from hc_logger.csv_table import SEPARATORS, Table, cut, why_no_rows
from hc_logger.csv_text import find_encoding, first_lines, split_line
from hc_logger.csv_time import stamps, unit_of_times
from hc_logger.csv_vocabulary import (
    NAMES,
    QUANTITIES,
    UNITS,
    is_weight,
    split_name,
    unit_of,
)
from hc_logger.errors import BagError, WrongOptionError

_MADE_OF = {"displacement": why_no_displacement, "force": why_no_force}
"""What other quantities of a testing machine make one that is missing."""


def find_layout(path: str | os.PathLike[str], options: CsvOptions | None = None) -> CsvLayout:
    """Find out how a file is written.

    Args:
        path: the file.
        options: what is known of it.

    Raises:
        BagError: if it cannot be read, or it is not clear what it holds; says what to give.
    """
    path, options = Path(path), options or CsvOptions()
    options.check()
    encoding = options.encoding or find_encoding(path)
    lines, left_out = first_lines(path, encoding, options.header_lines or 0)
    if options == CsvOptions(encoding=options.encoding):
        own = own_layout(path, lines, encoding)
        if own is not None:
            return own
    return _Finder(path, options, encoding, lines, left_out).layout()


class _Finder:
    """Finds the layout of one file of others."""

    def __init__(
        self, path: Path, options: CsvOptions, encoding: str, lines: list[str], left_out: int
    ) -> None:
        self._path = path
        self._options = options
        self._encoding = encoding
        self._lines = lines
        self._left_out = left_out
        self._notes: list[str] = []
        self._quantities = QUANTITIES[1:] if options.rate_hz else QUANTITIES

    def layout(self) -> CsvLayout:
        """Return it.

        Raises:
            BagError: if it is not clear.
        """
        table = self._table()
        header = find_header(self._lines, table)
        cells = list(header.names)
        if rate_hz := self._options.rate_hz:
            why = why_not_counted(rate_hz, table, header, self._numbers, self._cells)
            if why:
                raise BagError(f"{self._path}: {why}")
        first, nanoseconds = self._stamp(table, cells)
        indices = {"time": first} if first != NO_COLUMN else {}
        indices |= {q: self._column(q, table, header) for q in self._quantities if q not in indices}
        if len(set(indices.values())) < len(indices):
            raise self._refusal("two quantities are the same column", "--columns")
        names = {q: cells[i] if cells else f"column {i + 1}" for q, i in indices.items()}
        clock = indices.get("time") in table.clocks and indices.get("time") not in table.numeric
        is_open = self._is_open(table)
        for quantity in self._quantities[0 if self._options.rate_hz or not clock else 1 :]:
            self._check_thousands(table, names[quantity], indices[quantity], is_open)
        is_stamp = nanoseconds != NO_COLUMN
        if is_stamp:
            nano = cells[nanoseconds] if cells else f"column {nanoseconds + 1}"
            self._notes.append(f"{names['time']} and {nano} together are the time")
        found = self._units(table, indices, names, header.units, clock, is_stamp)
        self._notes.insert(0, self._summary(table, names, found))
        if self._options.rate_hz:
            indices["time"], names["time"] = NO_COLUMN, "the time"
            found["time"] = ("s", 1.0)
        a, b, c = (indices[q] for q in QUANTITIES)
        return CsvLayout(
            self._encoding,
            table.separator,
            table.decimal,
            table.first + self._left_out,
            (a, b, c),
            (names["time"], names["displacement"], names["force"]),
            (found["time"][1], found["displacement"][1], found["force"][1]),
            table.width,
            header=header.line,
            clock=clock,
            date=date_column(partial(self._cells, table), a, table.width) if clock else NO_COLUMN,
            clock_period_s=clock_period(self._cells(table, a)),
            nanoseconds=nanoseconds,
            rate_hz=self._options.rate_hz,
            decimal_is_sure=bool(self._options.decimal),
            decimal_is_open=is_open,
            is_chosen=self._options.header_lines is not None,
            status=status_column(cells),
            notes=tuple(self._notes),
        )

    def _units(
        self,
        table: Table,
        indices: dict[str, int],
        names: dict[str, str],
        units: tuple[str, ...],
        clock: bool,
        is_stamp: bool,
    ) -> dict[str, tuple[str, float]]:
        """Return the unit of each quantity and its factor."""
        found = {}
        unknown = []
        for quantity, index in indices.items():
            if quantity == "time" and is_stamp:
                found[quantity] = ("s", 1.0)
                continue
            if quantity == "time" and clock:
                found[quantity] = ("s", 1.0)
                self._notes.append(
                    f"{names[quantity]} is written as on a clock: taken for seconds from the first "
                    "row"
                )
                self._check_clock(table, names[quantity], index)
                continue
            below = units[index] if units else ""
            pair = self._unit(quantity, names[quantity], below, table, index)
            if pair is None:
                unknown.append(quantity)
            else:
                found[quantity] = pair
        if unknown:
            names_of = " and ".join(repr(names[q]) for q in unknown)
            options = ",".join(f"{q}=..." for q in unknown)
            choices = "; ".join(", ".join(UNITS[q]) for q in unknown)
            what = "the unit of {} is" if len(unknown) == 1 else "the units of {} are"
            raise self._refusal(
                f"{what.format(names_of)} not known", f"--units {options} ({choices})"
            )
        return found

    def _refusal(self, what: str, option: str) -> BagError:
        head = next((line for line in self._lines if line.strip()), "")
        shown = "".join(c if c.isprintable() else " " for c in head.strip())[:80]
        return BagError(f"{self._path}: {what}; say it with {option} (first line: {shown!r})")

    def _table(self) -> Table:
        if not any(line.strip() for line in self._lines):
            raise BagError(f"{self._path} has no rows: it is empty")
        options = self._options
        separators = [options.separator] if options.separator else list(SEPARATORS)
        decimals = [options.decimal] if options.decimal else [".", ","]
        # A comma can only be both where every cell is in quotation marks.
        quoted = all(line.lstrip().startswith('"') for line in self._lines[-20:] if line.strip())
        if separators == decimals == [","] and not quoted:
            raise BagError("a comma cannot be both separator and decimal sign")
        first = options.header_lines
        least, sure = len(self._quantities), bool(options.decimal)
        tables = [
            table
            for separator in separators
            for decimal in decimals
            if quoted or not (separator == "," and decimal == ",")
            if (
                table := cut(
                    self._lines,
                    separator,
                    decimal,
                    first if first is None else first - self._left_out,
                    least,
                    sure,
                )
            )
            is not None
        ]
        if not tables:
            raise self._no_rows()
        # Whole numbers look the same with either decimal sign, and white space beside a separator
        # is no separator: the first of those that give the same columns is the plain one.
        best = tables[0]
        for other in tables[1:]:
            if other.separator == best.separator and other.numeric == best.numeric:
                continue
            if other.separator == " ":
                continue
            if len(other.numeric) != len(best.numeric) or other.separator != best.separator:
                raise self._refusal(
                    f"{SEPARATORS[best.separator]} and {SEPARATORS[other.separator]} could both "
                    "separate the columns",
                    "--separator and --decimal",
                )
        return best

    def _no_rows(self) -> BagError:
        """Say what stands there instead of rows of three numbers."""
        why = why_no_rows(self._lines) if self._options.header_lines is None else ""
        if why:
            return BagError(f"{self._path}: {why}")
        return self._refusal(
            "no rows of three numbers are to be seen (time, displacement, force)",
            "--separator, --decimal, --header-lines",
        )

    def _column(self, quantity: str, table: Table, header: Header) -> int:
        cells = list(header.names)
        wanted = self._options.columns.get(quantity)
        if wanted is not None:
            return self._named(quantity, wanted, table, cells)
        if not cells:
            raise self._refusal("the columns have no names", self._example(table, True))
        numeric = [i for i in range(len(cells)) if i in table.numeric]
        known, why = candidates(quantity, cells, numeric, header.units)
        if why:
            self._notes.append(why)
        if len(known) == 1:
            return known[0]
        if quantity == "time" and not known and len(table.clocks) == 1:
            return table.clocks[0]
        other = [
            i
            for i, cell in enumerate(cells)
            if i not in numeric and split_name(cell, quantity)[0] in NAMES[quantity]
        ]
        if not known and other:
            raise self._refusal(
                f"the column {cells[other[0]][:30]!r} holds {self._text_in(table, other[0])!r}, "
                "which is no number",
                self._example(table),
            )
        why = _MADE_OF[quantity](cells, header.units) if not known and quantity in _MADE_OF else ""
        if why:
            raise BagError(f"{self._path}: no column is known to be the {quantity}: {why}")
        shown = ", ".join(repr(cells[i][:30]) for i in (known or numeric)[:8])
        what = "several columns could be" if known else "no column is known to be"
        raise self._refusal(f"{what} the {quantity}: {shown}", self._example(table))

    def _text_in(self, table: Table, index: int) -> str:
        """Return what stands in a column instead of a number."""
        for cell in self._cells(table, index):
            if number(cell, table.decimal, decimal_is_sure=bool(self._options.decimal)) is None:
                return cell.strip()[:30]
        return ""

    def _cells(self, table: Table, index: int) -> list[str]:
        rows = (split_line(line, table.separator) for line in self._lines[table.first :])
        return [row[index] for row in rows if len(row) == table.width]

    def _named(self, quantity: str, wanted: str, table: Table, cells: list[str]) -> int:
        bare = [" ".join(cell.split()).lower() for cell in cells]
        same = [i for i, cell in enumerate(bare) if cell == " ".join(wanted.split()).lower()]
        same = same or [
            i for i, cell in enumerate(cells) if split_name(cell)[0] == split_name(wanted)[0]
        ]
        if len(same) == 1:
            return same[0]
        if not same and wanted.isascii() and wanted.isdigit() and 1 <= int(wanted) <= table.width:
            return int(wanted) - 1
        shown = ", ".join(repr(cell[:30]) for cell in cells[:12]) or f"1 to {table.width}"
        what = "several columns are called" if same else "no column is called"
        raise WrongOptionError(f"{self._path}: {what} {wanted[:40]!r}; it has {shown}")

    def _unit(
        self, quantity: str, name: str, below: str, table: Table, index: int
    ) -> tuple[str, float] | None:
        """Return the unit of a column and its factor, None if it is not known."""
        given = self._options.units.get(quantity)
        found = unit_of(given, quantity) if given else None
        if found is None:
            found = split_name(name, quantity)[1] or unit_of(below, quantity)
            if found in ("gf", "kgf") and is_weight(below or name):
                self._notes.append(f"{name} is taken for the force of a mass: {found}")
        if found is None and quantity == "time":
            found, what = unit_of_times(self._numbers(table, index))
            if found is not None:
                self._notes.append(f"{name} has no unit: {what}")
        return None if found is None else (found, UNITS[quantity][found])

    def _stamp(self, table: Table, cells: list[str]) -> tuple[int, int]:
        """Return the columns of seconds and nanoseconds of the time, none if it is in one column.

        Of several messages in a table the stamp of the first counts, unless the user names one; A+B
        names both.
        """
        none = (NO_COLUMN, NO_COLUMN)
        if "time" not in self._quantities:
            return none
        wanted = self._options.columns.get("time")
        if wanted is not None and "+" in wanted and wanted not in cells:
            a, b = (part.strip() for part in wanted.split("+", 1))
            return self._named("time", a, table, cells), self._named("time", b, table, cells)
        pairs = stamps(cells, table.numeric)
        if wanted is None:
            others = set(candidates("time", cells, table.numeric)[0]).difference(*pairs)
            return pairs[0] if pairs and not others else none
        named = self._named("time", wanted, table, cells)
        return next((pair for pair in pairs if pair[0] == named), none)

    def _numbers(self, table: Table, index: int) -> list[float]:
        sure = bool(self._options.decimal)
        values = [
            number(cell, table.decimal, decimal_is_sure=sure) for cell in self._cells(table, index)
        ]
        return [value for value in values if value is not None and math.isfinite(value)]

    def _is_open(self, table: Table) -> bool:
        """Whether no number shows what the decimal sign is, and the user does not say it."""
        return not self._options.decimal and not any(
            shows_decimal_sign(self._cells(table, index), table.decimal) for index in table.numeric
        )

    def _check_thousands(self, table: Table, name: str, index: int, is_open: bool) -> None:
        """See whether a column has signs between its thousands, and say so.

        Raises:
            BagError: if it is not clear.
        """
        cells = self._cells(table, index)
        pair = pair_in_doubt(cells, table.decimal) if is_open else None
        if pair is not None:
            raise BagError(f"{self._path}: {thousands_in_doubt(name, pair, table.decimal)}")
        grouped = next((c for c in cells if has_groups(c, table.decimal)), None)
        if grouped is not None:
            self._notes.append(f"{name} has signs between thousands ({grouped.strip()}): left out")

    def _check_clock(self, table: Table, name: str, index: int) -> None:
        """See that a clock tells the rows apart.

        Raises:
            BagError: if most rows have the time of the row before.
        """
        times = [time_of_day(cell) for cell in self._cells(table, index)]
        same = sum(a == b for a, b in itertools.pairwise(times))
        if 2 * same > len(times):
            raise self._refusal(
                f"the clock {name!r} is too coarse, most rows have the time of the row before",
                "--columns time=... (another column) or --rate HZ (rows in a second)",
            )

    def _summary(
        self, table: Table, names: dict[str, str], units: dict[str, tuple[str, float]]
    ) -> str:
        columns = ", ".join(
            f"{quantity} is {name!r} in {units[quantity][0]}" for quantity, name in names.items()
        )
        if self._options.rate_hz:
            columns = f"time is counted, {self._options.rate_hz:g} rows a second, {columns}"
        how = [f"separated by {SEPARATORS[table.separator]}"]
        if table.decimal == ",":
            how.append("decimal comma")
        if self._encoding not in ("utf-8", "utf-8-sig"):
            how.append(f"encoding {self._encoding}")
        return f"{columns}; {', '.join(how)}: mind signs and zeros"

    def _example(self, table: Table, with_units: bool = False) -> str:
        """Return the options that name the columns."""
        columns = ",".join(f"{quantity}=..." for quantity in self._quantities)
        units = " and --units time=s,displacement=mm,force=N (or others)" if with_units else ""
        return (
            f"--columns {columns} (names, or numbers 1 to {table.width}){units}, or name the "
            f"columns {','.join(COLUMNS)}"
        )
