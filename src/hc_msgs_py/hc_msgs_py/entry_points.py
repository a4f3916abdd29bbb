"""What other packages bring by entry points: found, loaded, and why not where it cannot be.

Filters (`hc.filters`), contact laws (`hc.contact_laws`) and tissues of the rig (`hc.tissues`) come
this way. One that cannot be loaded disturbs nobody; who asks for it hears why.
"""

from __future__ import annotations

import functools
import importlib.metadata
import importlib.util
from collections.abc import Iterator
from pathlib import Path
from typing import TypeVar

T = TypeVar("T")


class FaultOfAnotherError(Exception):
    """What another package brought does not work: a line for the user, who is to ask its maker."""


@functools.cache
def points_of(group: str) -> tuple[importlib.metadata.EntryPoint, ...]:
    """Return the entry points of a group, in an order that does not depend on the path."""
    found = importlib.metadata.entry_points(group=group)
    return tuple(sorted(set(found), key=lambda point: (point.name, point.value)))


def sources_of(group: str) -> Iterator[Path]:
    """Name the files that the objects of a group come from, as far as they are found.

    Of a module in a package all files beside it, for it may be made of them.
    """
    for point in points_of(group):
        try:
            specification = importlib.util.find_spec(point.module)
        except Exception:  # noqa: BLE001 - `add_those_of_others` says what is wrong
            continue
        if specification is None or specification.origin is None:
            continue
        path = Path(specification.origin)
        if (path.parent / "__init__.py").is_file():
            yield from path.parent.glob("*.py")
        elif path.is_file():
            yield path


def add_those_of_others(
    known: dict[str, T], group: str, kind: type[T], what: str
) -> dict[str, str]:
    """Add the objects of a group of entry points to those that are known.

    Args:
        known: by name; gets the others' at its end.
        group: of entry points.
        kind: the class that each is of.
        what: what one is, for messages: "a filter".

    Returns:
        Why, by name, for those that could not be added: the others work without them.
    """
    problems: dict[str, str] = {}
    for point in points_of(group):
        if point.name in known:
            problems[point.name] = f"{what} of that name is there already, not {point.value}"
            continue
        try:
            loaded = point.load()
        except (Exception, SystemExit) as error:  # noqa: BLE001 - whatever others' modules do
            problems[point.name] = f"{point.value}: {type(error).__name__}: {error}"
            continue
        if isinstance(loaded, kind):
            known[point.name] = loaded
        else:
            problems[point.name] = f"{point.value} is a {type(loaded).__name__}, no {kind.__name__}"
    return problems
