"""What is read of a force behind a sensor's filter, mean or memory, and behind a delay."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, lfilter

from hc_evaluation.play import behind_play

Array = NDArray[np.float64]
Behind = Callable[[Array, float, float], Array]

MEAN: Final = "mean"
LOW_PASS: Final = ("low-pass of the first order", "low-pass of the second order")
MEMORY: Final = "memory"
DELAY: Final = "delay"


def behind(kind: str, columns: Array, size: float, rate_hz: float) -> Array:
    """Return what is read of a force, and its derivatives, shape (n, m).

    Args:
        kind: MEAN, MEMORY, DELAY or one of LOW_PASS.
        columns: the force [N], and beside it its derivatives by whatever, shape (n, m).
        size: length of the mean, delay or 1 / (2 pi corner) [s]; width of a memory's gap [N].
        rate_hz: of the rows.
    """
    return _BEHIND[kind](columns, size, rate_hz)


def _low_pass(order: int) -> Behind:
    def filtered(columns: Array, size: float, rate_hz: float) -> Array:
        corner_hz = min(1.0 / (2.0 * np.pi * size), 0.49 * rate_hz)
        return from_rest(*butter(order, corner_hz, fs=rate_hz), columns)

    return filtered


def _behind_mean(columns: Array, size: float, rate_hz: float) -> Array:
    length = max(2.0, size * rate_hz)
    whole = int(length)
    weights = np.append(np.full(whole, 1.0 / length), (length - whole) / length)
    return from_rest(weights, np.ones(1), columns)


def from_rest(numerator: Array, denominator: Array, columns: Array) -> Array:
    """Filter columns, as if they had been what they are at first for ever.

    Args:
        numerator: of the filter, shape (k,).
        denominator: shape (l,).
        columns: over time, shape (n,) or (n, m).
    """
    result: Array = lfilter(numerator, denominator, columns - columns[0], axis=0) + columns[0]
    return result


def _behind_memory(columns: Array, size: float, _rate_hz: float) -> Array:
    """Derivatives are those of when the spring gave way last."""
    follows = behind_play(columns[:, 0], size)
    moved = np.append(True, follows[1:] != follows[:-1])
    since = np.maximum.accumulate(np.where(moved, np.arange(len(follows)), 0))
    return np.column_stack([follows, columns[since, 1:]])


def _behind_delay(columns: Array, size: float, rate_hz: float) -> Array:
    rows = np.arange(len(columns)) - size * rate_hz
    before = np.clip(np.floor(rows).astype(np.int64), 0, len(columns) - 2)
    share = np.clip(rows - before, 0.0, 1.0)[:, None]
    result: Array = columns[before] * (1.0 - share) + columns[before + 1] * share
    return result


_BEHIND: Final[dict[str, Behind]] = {
    LOW_PASS[0]: _low_pass(1),
    LOW_PASS[1]: _low_pass(2),
    MEAN: _behind_mean,
    MEMORY: _behind_memory,
    DELAY: _behind_delay,
}
