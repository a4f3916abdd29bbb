"""What users of Python give as readings: lists, views, masked arrays, tables, made into numbers.

NumPy makes numbers of nearly everything, also of what are none: it takes the readings beneath a
mask, nanoseconds since 1970 of a date, and half of a complex number. Here that is NaN, or refused.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

_REFUSED = {
    "M": 'dates: give seconds, (t - t[0]) / np.timedelta64(1, "s")',
    "m": 'durations: give seconds, t / np.timedelta64(1, "s")',
    "c": "complex numbers",
}
"""Kinds of NumPy, and what they are."""


def as_numbers(name: str, given: ArrayLike) -> NDArray[np.float64]:
    """Return what was given as float64; what is masked, or missing in a table, is NaN.

    A whole number beyond float64 is infinite: a reading that is refused, not an error.

    Args:
        name: of the argument, for the message.
        given: readings.

    Raises:
        TypeError: they are dates, durations, complex or no numbers at all.
        ValueError: they are texts that are no numbers, or rows of different lengths.
    """
    if isinstance(given, np.ma.MaskedArray):
        given = np.ma.filled(given.astype(np.float64), np.nan)
    try:
        values = np.asarray(given)
    except ValueError as error:
        raise ValueError(f"{name} has rows of different lengths: {error}") from None
    if values.dtype.kind in _REFUSED:
        raise TypeError(f"{name} holds {_REFUSED[values.dtype.kind]}")
    if values.dtype.kind == "O" and values.ndim:  # of a table with missing values
        known = [np.nan if _is_missing(v) else v for v in values.flat]
        values = np.array(known, object).reshape(values.shape)
    try:
        return np.asarray(values, np.float64)
    except TypeError as error:
        raise TypeError(f"{name} holds what is no number: {error}") from None
    except ValueError as error:
        raise ValueError(f"{name} holds what is no number: {error}") from None
    except OverflowError:
        return np.array([_limited(v) for v in values.flat], np.float64).reshape(values.shape)


def _limited(value: Any) -> float:
    """Return a number as a float, infinite if no float is so large."""
    try:
        return float(value)
    except OverflowError:
        return math.inf if value > 0 else -math.inf


def _is_missing(value: object) -> bool:
    """Whether a value of a table stands for none: None, or NA of pandas, which equals nothing."""
    return value is None or type(value).__name__ in ("NAType", "NaTType")
