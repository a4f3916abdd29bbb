"""Readings of the channel that is ahead, held back until those come that they belong to.

A ring; what is in it is used once, in order (`alignment`). Whether one of them is an outlier the
gate says only when it is used: until then those that may be one are known.
"""

from __future__ import annotations

from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.multiple_model.records import HELD


@compiled
def hold_none(held: Any) -> None:
    """Give up what is held."""
    held.first = held.count
    held.used = 0


@compiled
def hold(held: Any, time: float, reading: float, is_suspect: bool) -> None:
    """Hold a reading back; the oldest is given up where there is no room."""
    held.time[held.count % HELD] = time
    held.value[held.count % HELD] = reading
    held.count += 1
    held.first = max(held.first, held.count - HELD)
    if is_suspect:
        held.suspect = time


@compiled
def nearest(held: Any, wanted: float, near: float) -> int:
    """Number of the held reading nearest to a time [s].

    The next one is preferred as long as it is not far off, so that jitter of the stamps does not
    take one reading twice and leave out another. The newest is held by now, so that there is one.
    """
    number = held.first
    while number + 1 < held.count:
        now, following = held.time[number % HELD], held.time[(number + 1) % HELD]
        if abs(following - wanted) > abs(now - wanted) and now >= wanted - near:
            break
        number += 1
    return number  # type: ignore[no-any-return]


@compiled
def has_suspect(held: Any) -> bool:
    """True if one of those that are waiting may be an outlier."""
    return bool(held.first < held.count and held.time[held.first % HELD] <= held.suspect)
