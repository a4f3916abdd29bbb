"""Readings of one channel with what can be said of them, and doubts about them."""

from __future__ import annotations

import math
from collections.abc import Generator
from enum import Enum
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
T = TypeVar("T")
Parts = Generator[None, None, T]
"""Work in parts of some tenths of a millisecond, between which others have their turn."""

LEAST_SAMPLES = 100
MEANINGS = "docs/guide/warnings.md"
"""Where every warning is explained."""
SUSPECT = "suspect: "
"""Before check and channel in the name of a diagnostic value that says what cannot be right."""
CLEAR = 10.0
"""A channel moves if its range is so many times its noise."""

NO_NUMBERS = "are no numbers (NaN): the sensor or its driver gave none"
"""What is said of readings that are not finite, of those of a node and of a bag."""
BEYOND_ANY_SENSOR = 1e12
"""Squares of what is smaller can be summed."""


class Check(Enum):
    """What is doubted."""

    TIMES = "times"
    STUCK = "stuck"
    PAUSE = "pause"
    RATE = "rate"
    SATURATION = "saturation"
    QUANTISATION = "quantisation"
    SMOOTHED = "smoothed"
    EXCHANGED = "exchanged"
    SIGN = "sign"
    UNITS = "units"
    INERTIA = "inertia"
    DAMPING = "damping"
    FRICTION = "friction"
    HYSTERESIS = "hysteresis"
    VIBRATION = "vibration"
    ZERO_STEP = "zero step"
    FORCE_ZERO = "force zero"
    POSITION_ZERO = "position zero"
    CLOCK = "clock"
    JUMP = "jump"


class Suspicion(NamedTuple):
    """A reading that cannot be right.

    Attributes:
        check: what is doubted.
        channel: displacement, force, or samples for both.
        sentence: what is seen, and what to do about it.
        remedy: what would put it right: the factor of a sign or a unit, the zero to take off [N] or
            [mm], in how many samples a reading stands that is to count once, the force from which
            on readings are to be left out [N], over how long a moving mean is taken [s]; NaN where
            no number would.
        since_s: time of the first reading that the remedy is for [s]; -inf for all.
        until_s: time of the first one that it is no longer for [s]; inf for all.
    """

    check: Check
    channel: str
    sentence: str
    remedy: float = math.nan
    since_s: float = -math.inf
    until_s: float = math.inf


class Readings(NamedTuple):
    """One channel: times [s] and values (mm or N), shape (samples,) each, all finite."""

    name: str
    unit: str
    time_s: FloatArray
    values: FloatArray


def whole(parts: Parts[T]) -> T:
    """Do all parts of a work, one after the other, and return what came of it."""
    while True:
        try:
            next(parts)
        except StopIteration as end:
            return end.value  # type: ignore[no-any-return]


def usable(name: str, unit: str, time_s: FloatArray, values: FloatArray) -> Readings:
    """Return the readings that are numbers and not beyond any sensor."""
    times, readings = np.asarray(time_s), np.asarray(values)
    # A comparison with NaN is false.
    use = (np.abs(times) < BEYOND_ANY_SENSOR) & (np.abs(readings) < BEYOND_ANY_SENSOR)
    return Readings(name, unit, times[use], readings[use])


def robust_range(values: FloatArray) -> tuple[float, float]:
    """Return the values that half a percent lie below and above: spikes do not count."""
    low, high = np.quantile(values, (0.005, 0.995))
    return float(low), float(high)


def noise(values: FloatArray) -> float:
    """Return the standard deviation of white noise on a smooth signal, from second differences."""
    second = np.diff(values, 2)
    return float(1.4826 * np.median(np.abs(second - np.median(second))) / math.sqrt(6.0))


def moves(values: FloatArray) -> bool:
    """Whether a channel changes by more than its noise."""
    low, high = robust_range(values)
    return high - low > CLEAR * noise(values)


def runs(values: FloatArray) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return starts and lengths of the runs of equal values."""
    starts = np.flatnonzero(np.concatenate(([True], values[1:] != values[:-1])))
    return starts, np.diff(np.append(starts, len(values)))
