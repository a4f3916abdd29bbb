"""The text of a CSV file: its encoding, its lines with a bound, the cells in them."""

from __future__ import annotations

import codecs
import csv
import io
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from hc_logger.csv_open import open_table
from hc_logger.errors import BagError
from hc_logger.other_files import what_begins_with

LOOKED_AT_BYTES: Final = 256 * 1024
LOOKED_AT_LINES: Final = 400
_KEPT_LINES: Final = 50
"""From the beginning of a file, whatever is left out after them."""
_LATIN_SHARE: Final = 0.9
"""Of the characters of a table in UTF-16: as many are digits, separators and plain letters."""
LONGEST_LINE: Final = 1024 * 1024
"""Characters; a file without line ends would have to be kept in memory as a whole."""
_ZEROS: Final = re.compile(rb"\0+")
_LOST_BYTES: Final = 8
"""So many zeros in a row are no text of whatever encoding: a file system lost what stood there."""
_BYTE_ORDER_MARKS: Final = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF32_LE, "utf-32"),  # before UTF-16, whose mark it begins with
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)


def find_encoding(path: Path) -> str:
    """Return the encoding of a text file, as Python names it: Windows-1252 if it is not Unicode.

    Raises:
        BagError: if it cannot be read or is not a text file.
    """
    with open_table(path) as file:
        start = file.read(LOOKED_AT_BYTES)
    for mark, name in _BYTE_ORDER_MARKS:
        if start.startswith(mark):
            return name
    if b"\0" in start:
        return _with_zeros(path, start)
    try:
        # What was cut off in the middle of a character is none.
        codecs.getincrementaldecoder("utf-8")().decode(start)
    except UnicodeDecodeError:
        return "cp1252"
    return "utf-8"


def _with_zeros(path: Path, start: bytes) -> str:
    """Return the encoding of a text with zero bytes: UTF-16 without a mark.

    Raises:
        BagError: if it is none.
    """
    start = start[: len(start) // 2 * 2]
    even, odd = start[0::2].count(0), start[1::2].count(0)
    for high, low, name in ((odd, even, "utf-16-le"), (even, odd, "utf-16-be")):
        if low == 0 and high > _LATIN_SHARE * (len(start) // 2):
            return name
    text = start.rstrip(b"\0")
    if text and b"\0" not in text:
        line = text.count(b"\n") + 1
        raise BagError(
            f"{path} ends in zero bytes from line {line} on, as after a crash of what wrote it: "
            "cut them off"
        )
    lost = [len(run) for run in _ZEROS.findall(text)]
    if min(lost) >= _LOST_BYTES:
        line = text.count(b"\n", 0, text.index(b"\0")) + 1
        raise BagError(
            f"{path} has {sum(lost)} zero bytes within its rows (line {line}), as after a crash of "
            "what wrote it: cut them out, and what is left of the line"
        )
    other = what_begins_with(start, path.suffix.lower())
    in_utf_16 = "is not a text file; if it is one in UTF-16, say so: --encoding utf-16-le"
    raise BagError(f"{path} {other or in_utf_16}")


def first_lines(path: Path, encoding: str, around: int = 0) -> tuple[list[str], int]:
    """Return some lines to look at, without their ends; see limited_lines().

    Args:
        path: the file.
        encoding: as Python names it.
        around: a line that is to be among them: of many lines before it some in the middle are
            left out.

    Returns:
        The lines, and how many were left out.
    """
    lines: list[str] = []
    left_out = max(0, around - LOOKED_AT_LINES)
    size = 0
    for count, line in enumerate(limited_lines(path, encoding)):
        if _KEPT_LINES <= count < _KEPT_LINES + left_out:
            continue
        lines.append(line.rstrip("\n"))
        size += len(line) if count >= around else 0
        if len(lines) >= 2 * LOOKED_AT_LINES or size >= LOOKED_AT_BYTES:
            break
        if count + 1 >= around + LOOKED_AT_LINES:
            break
    return lines, left_out


def limited_lines(path: Path, encoding: str) -> Iterator[str]:
    """Yield the lines of a file.

    Raises:
        BagError: if it cannot be read, or a line is too long to be one.
    """
    try:
        with open_table(path) as file:
            stream = io.TextIOWrapper(file, encoding=encoding, errors="replace")
            count = 0
            while line := stream.readline(LONGEST_LINE):
                count += 1
                if len(line) == LONGEST_LINE and not line.endswith("\n"):
                    raise BagError(f"{path}, line {count} has more than {LONGEST_LINE} characters")
                yield line
    except UnicodeError:
        raise BagError(f"{path} is not a text in {encoding}: give its encoding") from None


def split_line(line: str, separator: str) -> list[str]:
    """Return the cells of a line."""
    if separator == " ":
        return line.split()
    if '"' not in line:
        return line.split(separator)
    try:
        return next(csv.reader([line], delimiter=separator), [])
    except csv.Error:
        return line.split(separator)
