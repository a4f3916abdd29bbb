"""A channel that repeats its last reading until there is a new one: each reading counts once.

A controller publishes at 500 Hz what its encoder or tracker tells at 125 Hz. A reading that is
repeated says that the tool has not moved, which is wrong, and the law is then bent to fit. Dropped
readings leave the others at their own stamps. A channel that rests repeats its reading as well: so
every so often a repeated one counts, or the other sensor would be alone.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from hc_estimator.stream.dry_friction import DRY_FRICTION, TAKEN_OFF_ALREADY

LONGEST_S = 0.09
"""A reading that stays for so long counts again: the tool rests. Below `input.pairing.maximum_gap`,
beyond which readings of the other sensor are dropped."""
SETTINGS: Final = {"displacement": "input.position.held", "force": "input.force.held"}
"""Setting of a node by which the repeated readings of a channel are left out. Where it does so the
configuration of its estimates says it, beside the estimator's own settings."""
SHARE = 0.9
"""Of a maximum gap: how long a reading counts at most."""


def channels_held(position: bool, force: bool) -> tuple[str, ...]:
    """Return the channels whose repeated readings are left out.

    Args:
        position: whether those of the position sensor are.
        force: whether those of the force sensor are.
    """
    return tuple(name for name, held in zip(SETTINGS, (position, force), strict=True) if held)


def channels_held_by(settings: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the channels of which settings leave readings out: repeated ones, or of friction.

    Args:
        settings: of a node, or of the configuration of its estimates, by the names of `SETTINGS`
            and of `dry_friction`; one that is not there leaves none out.
    """
    position, force = (bool(settings.get(name)) for name in SETTINGS.values())
    friction = (DRY_FRICTION.name, TAKEN_OFF_ALREADY)
    return channels_held(position, force or any(settings.get(name) for name in friction))


class Repeats:
    """Readings of one channel, one after the other."""

    def __init__(self, longest_ns: int = round(LONGEST_S * 1e9)) -> None:
        """Begin without a reading.

        Args:
            longest_ns: a reading that stays for so long counts again.
        """
        self.longest_ns = longest_ns
        self.forget()

    def forget(self) -> None:
        """Take the next reading for a new one."""
        self._value: Any = None
        self._stamp_ns = 0

    def is_one(self, stamp_ns: int, value: Any) -> bool:
        """Whether a reading only repeats the one before; else it is the one that counts now."""
        since_ns = stamp_ns - self._stamp_ns
        if value == self._value and 0 <= since_ns < self.longest_ns:
            return True
        self._value, self._stamp_ns = value, stamp_ns
        return False


def once_each(stamps_ns: NDArray[np.int64], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return readings with NaN for those that only repeat the one before.

    Args:
        stamps_ns: stamps [ns], shape (n,), in the order in which the readings came.
        values: readings, shape (n,); NaN where there is none.
    """
    there = np.flatnonzero(~np.isnan(values))
    left = values.copy()
    left[there[~new_readings(stamps_ns[there], values[there])]] = np.nan
    return left


def new_readings(stamps_ns: NDArray[np.int64], values: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which readings of a recording are new.

    Args:
        stamps_ns: stamps [ns], shape (n,), in the order in which the readings came.
        values: readings, shape (n,) or (n, components).
    """
    rows = values.reshape(len(values), -1).tolist()
    repeats = Repeats()
    return np.array(
        [
            not repeats.is_one(stamp, row)
            for stamp, row in zip(stamps_ns.tolist(), rows, strict=True)
        ],
        np.bool_,
    )
