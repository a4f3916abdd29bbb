"""Which columns of a CSV file tell the time, and in which unit a time without one is.

A message's stamp is two columns, seconds and nanoseconds. A time since 1970 says its unit by its
size; any other is taken for seconds where its steps are short.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence
from typing import Final

LONGEST_SECONDS: Final = 0.5
"""Median step of a time without a unit: below it, it is taken for seconds."""
EPOCH_UNITS: Final = (("s", 1e9), ("ms", 1e12), ("us", 1e15), ("ns", 1e18))
"""What a time since 1970 is in, by its size from 2001 on; four times as much is 2096."""
_STAMP: Final = re.compile(r"(?P<stamp>(?:^|.*[./_])stamp[./_])(?P<part>n?)(?:ano)?secs?$")


def stamps(names: Sequence[str], numeric: Sequence[int]) -> list[tuple[int, int]]:
    """Return the columns of seconds and nanoseconds of each stamp of a message.

    Args:
        names: of all columns.
        numeric: the columns that hold numbers.
    """
    parts = {
        part: i for i in numeric if i < len(names) and (part := _stamp_part(names[i])) is not None
    }
    return [
        (seconds, parts[stamp, True])
        for (stamp, is_nano), seconds in parts.items()
        if not is_nano and (stamp, True) in parts
    ]


def unit_of_times(numbers: Sequence[float]) -> tuple[str | None, str]:
    """Return the unit that times without one can only be in, and what is assumed.

    None where that is not clear.
    """
    if numbers:
        for unit, low in EPOCH_UNITS:
            if low < min(numbers) <= max(numbers) < 4.0 * low:
                return unit, f"taken for the time since 1970 in {unit}"
    steps = sorted(abs(b - a) for a, b in itertools.pairwise(numbers))
    if steps and 0.0 < steps[len(steps) // 2] < LONGEST_SECONDS:
        return "s", "taken for seconds"
    return None, ""


def _stamp_part(cell: str) -> tuple[str, bool] | None:
    """Return which stamp of a message a column is a part of, and whether it is its nanoseconds.

    None for a column that is no part of a stamp.
    """
    found = _STAMP.match(cell.strip().lower())
    return (found["stamp"], found["part"] == "n") if found else None
