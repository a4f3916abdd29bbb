"""Names of bags where one is taken: NAME, NAME_2, NAME_3 and so on."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from hc_logger.errors import BagError, BagExistsError
from hc_logger.writer import BagWriter


def numbered_bags(path: str | os.PathLike[str]) -> list[Path]:
    """Return the folders NAME, NAME_2, NAME_3 and so on that are there, in this order."""
    first = Path(path)
    found = [first] if first.exists() else []
    number = 2
    while (following := first.with_name(f"{first.name}_{number}")).exists():
        found.append(following)
        number += 1
    return found


def new_numbered_bag(path: str | os.PathLike[str], **options: Any) -> BagWriter:
    """Make a bag under the first name of NAME, NAME_2, NAME_3 and so on that is free.

    Args:
        path: the first name.
        **options: as for BagWriter.

    Raises:
        BagError: if the folder cannot be made.
    """
    first = Path(path)
    if first.name in ("", ".."):
        raise BagError(f"{path} is no name that a new bag can have")
    number = 1
    while True:
        try:
            return BagWriter(
                first if number == 1 else first.with_name(f"{first.name}_{number}"), **options
            )
        except BagExistsError:
            number += 1
