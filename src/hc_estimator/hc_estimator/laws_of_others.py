"""The sources of contact laws and filters from other packages, for the hash of the kernels.

A law of another package is compiled into the kernels of this one, so that the cached kernels carry
a hash of its file as well (compilation.py).
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from hc_msgs_py.entry_points import sources_of

ENTRY_POINTS = "hc.contact_laws"


def law_sources() -> Iterator[Path]:
    """Name the files that contact laws of other packages come from, as far as they are found."""
    yield from sources_of(ENTRY_POINTS)


def sources_beside(function: Any) -> Iterator[Path]:
    """Name all sources in the folder of a kernel that is none of this package; none of its own."""
    file = Path(function.__code__.co_filename)
    here = Path(__file__).resolve().parent
    if here not in file.resolve().parents and file.is_file():
        yield from file.parent.glob("*.py")
