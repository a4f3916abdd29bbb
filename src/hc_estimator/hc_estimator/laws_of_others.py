"""Contact laws from other packages, by entry point, and the sources that kernels there come from.

A law of another package is compiled into the kernels of this one, so that the cached kernels carry
a hash of its file as well (compilation.py).
"""

from __future__ import annotations

import functools
import importlib.metadata
import importlib.util
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

ENTRY_POINTS = "hc.contact_laws"


@functools.cache
def _points() -> tuple[importlib.metadata.EntryPoint, ...]:
    """The entry points, in an order that does not depend on the path."""
    found = importlib.metadata.entry_points(group=ENTRY_POINTS)
    return tuple(sorted(set(found), key=lambda point: (point.name, point.value)))


def law_sources() -> Iterator[Path]:
    """Name the files that contact laws of other packages come from, as far as they are found."""
    for point in _points():
        try:
            specification = importlib.util.find_spec(point.module)
        except Exception:  # noqa: BLE001 - `add_laws_of_others` says what is wrong
            continue
        if specification is not None and specification.origin is not None:
            path = Path(specification.origin)
            if path.is_file():
                yield path


def sources_beside(function: Any) -> Iterator[Path]:
    """Name all sources in the folder of a kernel that is none of this package; none of its own."""
    file = Path(function.__code__.co_filename)
    here = Path(__file__).resolve().parent
    if here not in file.resolve().parents and file.is_file():
        yield from file.parent.glob("*.py")


def add_laws_of_others(laws: dict[str, Any], kind: type) -> Mapping[str, str]:
    """Add the contact laws of other packages.

    Args:
        laws: by name; gets the others' at its end.
        kind: the class that a law is of.

    Returns:
        Why, by name, for those that could not be added: the others work without them.
    """
    problems: dict[str, str] = {}
    for point in _points():
        if point.name in laws:
            problems[point.name] = f"a contact law of that name is there, not {point.value}"
            continue
        try:
            law = point.load()
        except Exception as error:  # noqa: BLE001 - whatever somebody else's module does
            problems[point.name] = f"{point.value}: {type(error).__name__}: {error}"
            continue
        if isinstance(law, kind):
            laws[point.name] = law
        else:
            problems[point.name] = f"{point.value} is a {type(law).__name__}, no {kind.__name__}"
    return problems
