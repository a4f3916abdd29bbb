"""How files are compressed: the ending and first bytes of such a file, and what unpacks it."""

from __future__ import annotations

import bz2
import gzip
import lzma
import zlib
from collections.abc import Callable
from typing import Any, Final, NamedTuple


class Compression(NamedTuple):
    """One way to compress a file.

    Attributes:
        suffix: ending that is put behind a name.
        begins: first bytes of such a file.
        unpack: what makes a file of it in a shell.
        show: what writes it on standard output there.
        opener: opens a path for reading; None where a file that was cut off is not noticed.
    """

    suffix: str
    begins: bytes
    unpack: str
    show: str
    opener: Callable[..., Any] | None


COMPRESSIONS: Final = (
    Compression(".gz", b"\x1f\x8b", "gunzip -k", "zcat", gzip.open),
    Compression(".bz2", b"BZh", "bunzip2 -k", "bzcat", bz2.open),
    Compression(".xz", b"\xfd7zXZ", "unxz -k", "xzcat", lzma.open),
    Compression(".zst", b"\x28\xb5\x2f\xfd", "unzstd", "zstdcat", None),
)
BY_SUFFIX: Final = {one.suffix: one for one in COMPRESSIONS if one.opener is not None}
"""Those that are read as they are."""
DAMAGED: Final = (EOFError, zlib.error, lzma.LZMAError, gzip.BadGzipFile)
"""What reading one raises that was cut off or is another thing."""


def compression_of(first: bytes) -> Compression | None:
    """Return how a file is compressed by its first bytes; None if it is not."""
    return next((one for one in COMPRESSIONS if first.startswith(one.begins)), None)
