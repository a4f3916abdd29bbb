"""Finds out how a CSV file is written: encoding, separator, decimal sign, header, columns, units.

Every maker of testing machines has a way of their own. What the first lines leave no doubt about
is found, and said; where they leave a doubt (two columns of forces, no unit) the file is refused,
with the option that settles it. Files with our own header need none of this.
"""

from __future__ import annotations

import codecs
import itertools
import math
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, NamedTuple

from hc_logger.csv_table import (
    LABVIEW,
    SEPARATORS,
    Table,
    cut,
    labview_header,
    why_no_rows,
)
from hc_logger.csv_text import (
    find_encoding,
    first_lines,
    is_cut_off,
    last_line,
    number,
    split_line,
)
from hc_logger.csv_vocabulary import NAMES, QUANTITIES, UNITS, is_weight, split_name, unit_of
from hc_logger.errors import BagError

COLUMNS: Final = ("time_s", "displacement_mm", "force_N")
COMMENT_SIGNS: Final = "#% "
"""Before a header, as numpy and MATLAB write them."""
LONGEST_SECONDS: Final = 0.5
"""Median step of a time without a unit: below it, it is taken for seconds."""
_ASSIGNMENT = re.compile(r"(?:^|,)\s*(time|displacement|force)\s*=", re.ASCII)


@dataclass(frozen=True)
class CsvOptions:
    """What the user says of a file; what is empty is found out.

    Attributes:
        columns: name or number (from 1) of the column of each quantity.
        units: unit of each quantity.
        separator: one character; a space stands for any white space.
        decimal: "." or ",".
        header_lines: how many lines come before the first row of numbers; None finds out.
        encoding: as Python names it.
    """

    columns: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    separator: str = ""
    decimal: str = ""
    header_lines: int | None = None
    encoding: str = ""


def parse_assignments(text: str) -> dict[str, str]:
    """Split "time=A,displacement=B,force=C"; what stands for A may hold commas.

    Raises:
        ValueError: if it is not of that form.
    """
    found = list(_ASSIGNMENT.finditer(text))
    if not found or found[0].start() != 0:
        raise ValueError("it is not of the form time=...,displacement=...,force=...")
    ends = [match.start() for match in found[1:]] + [len(text)]
    result: dict[str, str] = {}
    for match, end in zip(found, ends, strict=True):
        value = text[match.end() : end].strip()
        if not value or match[1] in result:
            raise ValueError(f"{match[1]} is given {'twice' if match[1] in result else 'nothing'}")
        result[match[1]] = value
    return result


class CsvLayout(NamedTuple):
    """How a file is written.

    Attributes:
        encoding: as Python names it.
        separator: one character; a space stands for any white space.
        decimal: "." or ",".
        header_lines: lines before the first row of numbers.
        indices: column of time, displacement, force, from 0.
        names: their names, for messages.
        factors: what makes s, mm, N of them.
        notes: what was assumed, one line each; none for a file of our own.
    """

    encoding: str
    separator: str
    decimal: str
    header_lines: int
    indices: tuple[int, int, int]
    names: tuple[str, str, str]
    factors: tuple[float, float, float]
    notes: tuple[str, ...] = ()


def find_layout(path: str | os.PathLike[str], options: CsvOptions | None = None) -> CsvLayout:
    """Find out how a file is written.

    Args:
        path: the file.
        options: what is known of it.

    Raises:
        BagError: if it cannot be read, or it is not clear what it holds; says what to give.
    """
    path, options = Path(path), options or CsvOptions()
    _check(options)
    encoding = options.encoding or find_encoding(path)
    lines = first_lines(path, encoding)
    if options == CsvOptions(encoding=options.encoding):
        own = _own_layout(lines, encoding)
        if own is not None:
            return _with_end(path, own)
    return _with_end(path, _Finder(path, options, encoding, lines).layout())


def _with_end(path: Path, layout: CsvLayout) -> CsvLayout:
    """Add to the notes that the last line will be left out, if it will."""
    if not is_cut_off(last_line(path, layout.encoding), layout.separator, layout.indices):
        return layout
    return layout._replace(
        notes=(*layout.notes, "the last line is cut off in its middle: it is left out")
    )


def _check(options: CsvOptions) -> None:
    for quantity, unit in options.units.items():
        if unit_of(unit, quantity) is None:
            raise BagError(f"{unit!r} is no unit of {quantity}: give {', '.join(UNITS[quantity])}")
    if options.separator and options.separator not in SEPARATORS:
        raise BagError(
            f"{options.separator!r} is no separator: give one of {', '.join(SEPARATORS.values())}"
        )
    if options.decimal not in ("", ".", ","):
        raise BagError(f"{options.decimal!r} is no decimal sign: give . or ,")
    if options.decimal == "," and options.separator == ",":
        raise BagError("a comma cannot be both separator and decimal sign")
    if options.encoding:
        try:
            text_encoding = codecs.lookup(options.encoding)._is_text_encoding
        except LookupError:
            text_encoding = False
        if not text_encoding:
            raise BagError(f"{options.encoding[:40]!r} is no encoding: give for example utf-8")


def _own_layout(lines: list[str], encoding: str) -> CsvLayout | None:
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
            return CsvLayout(encoding, separator, decimal, 1, (a, b, c), COLUMNS, (1.0, 1.0, 1.0))
    return None


class _Finder:
    """Finds the layout of one file of others."""

    def __init__(self, path: Path, options: CsvOptions, encoding: str, lines: list[str]) -> None:
        self._path = path
        self._options = options
        self._encoding = encoding
        self._lines = lines
        self._notes: list[str] = []

    def layout(self) -> CsvLayout:
        """Return it.

        Raises:
            BagError: if it is not clear.
        """
        table = self._table()
        cells, units = self._header(table)
        indices = tuple(self._column(q, table, cells) for q in QUANTITIES)
        if len(set(indices)) < len(indices):
            raise self._refusal("two quantities are the same column", "--columns")
        names = tuple(cells[i] if cells else f"column {i + 1}" for i in indices)
        maybe = {
            q: self._unit(q, name, units[i] if units else "", table, i)
            for q, i, name in zip(QUANTITIES, indices, names, strict=True)
        }
        unknown = [q for q in QUANTITIES if maybe[q] is None]
        if unknown:
            names_of = " and ".join(repr(names[QUANTITIES.index(q)]) for q in unknown)
            options = ",".join(f"{q}=..." for q in unknown)
            choices = "; ".join(", ".join(UNITS[q]) for q in unknown)
            what = (
                f"the unit of {names_of} is"
                if len(unknown) == 1
                else f"the units of {names_of} are"
            )
            raise self._refusal(f"{what} not known", f"--units {options} ({choices})")
        found = [pair for pair in maybe.values() if pair is not None]
        self._notes.insert(0, self._summary(table, names, found))
        return CsvLayout(
            self._encoding,
            table.separator,
            table.decimal,
            table.first,
            (indices[0], indices[1], indices[2]),
            (names[0], names[1], names[2]),
            (found[0][1], found[1][1], found[2][1]),
            tuple(self._notes),
        )

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
        tables = [
            table
            for separator in separators
            for decimal in decimals
            if not (separator == "," and decimal == ",")
            if (table := cut(self._lines, separator, decimal, options.header_lines)) is not None
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

    def _header(self, table: Table) -> tuple[list[str], list[str]]:
        """Return the names of the columns and their units, each empty if there are none."""
        above = [
            [cell.strip() for cell in split_line(line.lstrip(COMMENT_SIGNS), table.separator)]
            for line in self._lines[: table.first]
            if line.strip()
        ]
        if above and above[0][0] == LABVIEW:
            return labview_header(above, table.width)
        rows = [row for row in above if len(row) == table.width]
        units: list[str] = []
        if (
            len(rows) > 1
            and any(map(unit_of, rows[-1]))
            and all(
                not cell or unit_of(cell) or cell.strip("[](){}<>- ") == "" for cell in rows[-1]
            )
        ):
            units = rows.pop()
        return (rows[-1] if rows else []), units

    def _column(self, quantity: str, table: Table, cells: list[str]) -> int:
        wanted = self._options.columns.get(quantity)
        if wanted is not None:
            return self._named(quantity, wanted, table, cells)
        if not cells:
            raise self._refusal("the columns have no names", _example(table))
        numeric = [i for i in range(len(cells)) if i in table.numeric]
        plain = {i: split_name(cells[i], quantity)[0] for i in numeric}
        exact = [i for i in numeric if plain[i] == quantity]
        known = exact or [i for i in numeric if plain[i] in NAMES[quantity]]
        known = known or [i for i in numeric if self._contains(plain[i], quantity)]
        pressed = [i for i in known if plain[i].startswith("compress")]
        if len(known) > 1 and len(pressed) == 1:
            self._notes.append(f"of {len(known)} columns of {quantity} the one of compression")
            known = pressed
        if len(known) == 1:
            return known[0]
        shown = ", ".join(repr(cells[i][:30]) for i in (known or numeric)[:8])
        what = "several columns could be" if known else "no column is known to be"
        raise self._refusal(f"{what} the {quantity}: {shown}", _example(table))

    @staticmethod
    def _contains(name: str, quantity: str) -> bool:
        words = name.split()
        return any(word in words for word in NAMES[quantity] if len(word) > 1)

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
        raise BagError(f"{self._path}: {what} {wanted[:40]!r}; it has {shown}")

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
        if found is None and quantity == "time" and self._looks_like_seconds(table, index):
            found = "s"
            self._notes.append(f"{name} has no unit: taken for seconds")
        return None if found is None else (found, UNITS[quantity][found])

    def _looks_like_seconds(self, table: Table, index: int) -> bool:
        values = []
        for line in self._lines[table.first :]:
            cells = split_line(line, table.separator)
            value = number(cells[index], table.decimal) if index < len(cells) else None
            if value is not None and math.isfinite(value):
                values.append(value)
        steps = sorted(abs(b - a) for a, b in itertools.pairwise(values))
        return bool(steps) and 0.0 < steps[len(steps) // 2] < LONGEST_SECONDS

    def _summary(self, table: Table, names: tuple[str, ...], units: list[tuple[str, float]]) -> str:
        columns = ", ".join(
            f"{quantity} is {name!r} in {unit}"
            for quantity, name, (unit, _) in zip(QUANTITIES, names, units, strict=True)
        )
        how = [f"separated by {SEPARATORS[table.separator]}"]
        if table.decimal == ",":
            how.append("decimal comma")
        if self._encoding not in ("utf-8", "utf-8-sig"):
            how.append(f"encoding {self._encoding}")
        return f"{columns}; {', '.join(how)}: mind signs and zeros"


def _example(table: Table) -> str:
    return (
        f"--columns time=...,displacement=...,force=... (names, or numbers 1 to {table.width}), or "
        f"name the columns {','.join(COLUMNS)}"
    )
