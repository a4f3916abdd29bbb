"""Opens the file of a table in text, as it is or compressed: press.csv, press.csv.gz.

What loggers and archives compress is read as it is unpacked, also under the name of a plain table;
a file that ends in the midst of it is
refused, for nobody knows what of the last block is whole.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Final

from hc_logger.compressions import BY_SUFFIX, DAMAGED, Compression, compression_of
from hc_logger.errors import BagError
from hc_logger.other_files import LONGEST_BEGINNING, check_there, what_begins_with

TEXT_SUFFIXES: Final = (".csv", ".tsv", ".tab", ".txt", ".dat", ".asc", ".prn", ".tra", ".lvm")
"""Of tables in text; .tra is what testXpert writes, .lvm LabVIEW."""
_LOOKED_AT: Final = max(LONGEST_BEGINNING, 10)
COMPRESSED_SUFFIXES: Final = tuple(BY_SUFFIX)


def is_text(path: Path) -> bool:
    """Whether a name is that of a CSV file, compressed or not."""
    return text_suffix(path) in TEXT_SUFFIXES


def text_suffix(path: Path) -> str:
    """Return the ending of a name in small letters, without that of a compression."""
    suffix = path.suffix.lower()
    return Path(path.stem).suffix.lower() if suffix in BY_SUFFIX else suffix


@contextlib.contextmanager
def open_table(path: str | os.PathLike[str]) -> Iterator[IO[bytes]]:
    """Open a table's bytes.

    Raises:
        BagError: if it cannot be read, is no file, or cannot be unpacked, also within the block.
    """
    path = Path(path)
    check_there(path)
    packed = BY_SUFFIX.get(path.suffix.lower())
    try:
        with path.open("rb") as file:
            first = file.read(_LOOKED_AT)
        if packed is None:
            packed = _packed_under_another_name(first)
        elif first and compression_of(first) is None:
            raise BagError(f"{path} {what_begins_with(first, packed.suffix)}")
        opener = open if packed is None or packed.opener is None else packed.opener
        with opener(path, "rb") as stream:
            yield stream
    except DAMAGED as error:
        raise BagError(
            f"{path} is damaged, cut off, or not what its ending says ({error}); what can be "
            f"unpacked of it: {packed.show if packed else 'cat'} {path.name} > part.csv"
        ) from error
    except OSError as error:
        raise BagError(f"cannot read {path}: {error.strerror or error}") from error


def _packed_under_another_name(first: bytes) -> Compression | None:
    """Return how a file is compressed that is named as a plain table; None for what may be text."""
    packed = compression_of(first)
    is_text = first.startswith(b"BZh") and first[4:10] != b"1AY&SY"
    return None if packed is None or packed.opener is None or is_text else packed
