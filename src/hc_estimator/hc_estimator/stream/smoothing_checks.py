"""A channel that its driver smoothed: a moving mean, or a median of the last readings.

Both bend K, B, n and p, and both look like a delay. Their noise tells them. From one moving mean to
the next one reading comes in and one goes out, so that what a reading adds it takes away again when
it leaves: differences that lie the mean's length apart go against each other by half. A median is
one of the readings themselves: it returns to the very value that it had before.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from hc_estimator.stream.correlation import autocorrelation
from hc_estimator.stream.readings import FloatArray, Parts, Readings, robust_range, runs
from hc_estimator.stream.stamp_checks import rate_of

MOST_ROWS: Final = 8192
"""Of the end of a recording, which are looked at."""
LEAST_ROWS: Final = 400
SHORTEST_MEAN: Final = 6
"""Readings; below, differences of the fourth order go together of themselves."""
AGAINST: Final = -0.35
"""Correlation of differences a mean's length apart, -0.5 in theory; elsewhere -0.1 by chance."""
TWICE: Final = 0.12
"""Largest correlation twice as far apart: hum, and what was interpolated, comes again there."""
LEAST_CHANGE: Final = 0.002
"""Of a channel's range: what a mean changes by less, nobody minds."""
LARGEST_SHARE: Final = 0.25
"""Of the readings looked at, which a mean may be of."""
ALIVE: Final = 0.2
"""Share of readings that equal the one before, at most: of more the channel repeats them."""
BENDS: Final = 0.15
"""Of nine tenths of the bends, of one half at least: what was interpolated bends here and there
alone, and its bends go against each other, too."""
RETURNS: Final = 0.04
"""Share of the values of a median that return after one other value."""
STAYS: Final = (0.15, 0.75)
"""Share of its readings that equal the one before."""
IN_STEPS: Final = 0.8
"""Share of what lies between neighbouring values that are whole steps, in a channel of steps."""
_NEAR, _FEWEST_NEAR, _WHOLE = 30.0, 20, 0.05
"""In steps: what is looked at; how many of it there have to be; how far from whole they may be."""
MOST_USUAL: Final = 6.0
"""Times the median difference: what jumps, and jumps back, is no noise."""
_ORDER: Final = 4
_DIGITS: Final = 2


def mean_length(readings: Readings) -> int:
    """Return of how many readings a channel is the moving mean; 0 where it is none.

    Args:
        readings: evenly spaced but for some.
    """
    values = readings.values[-MOST_ROWS:]
    if len(values) < LEAST_ROWS or np.mean(values[1:] == values[:-1]) > ALIVE:
        return 0
    half, most = np.quantile(np.abs(np.diff(values, 2)), (0.5, 0.9))
    if half < BENDS * most:
        return 0
    quick = np.diff(values, _ORDER)
    usual = MOST_USUAL * float(np.median(np.abs(quick)))
    together = autocorrelation(np.clip(quick, -usual, usual))
    if len(together) <= SHORTEST_MEAN:
        return 0
    longest = int(LARGEST_SHARE * len(values))
    lag = SHORTEST_MEAN + int(np.argmin(together[SHORTEST_MEAN:longest]))
    twice = together[2 * lag - 2 : 2 * lag + 3]
    if not (together[lag] < AGAINST and np.max(np.abs(twice), initial=0.0) < TWICE):
        return 0
    again = _moving_mean(values, lag)
    low, high = robust_range(values)
    changed = float(np.sqrt(np.mean((again - values[lag // 2 :][: len(again)]) ** 2)))
    return lag if changed > LEAST_CHANGE * (high - low) else 0


def is_median(readings: Readings) -> bool:
    """Whether a channel is the median of its sensor's last readings.

    Args:
        readings: evenly spaced but for some.
    """
    values = readings.values[-MOST_ROWS:]
    if len(values) < LEAST_ROWS:
        return False
    stays = float(np.mean(values[1:] == values[:-1]))
    if not STAYS[0] < stays < STAYS[1]:
        return False
    starts, _lengths = runs(values)
    met = values[starts]
    if len(met) < LEAST_ROWS // 4 or comes_in_steps(met):
        return False
    return float(np.mean(met[2:] == met[:-2])) > RETURNS


def comes_in_steps(values: FloatArray) -> bool:
    """Whether values are whole multiples of a step: they return to one another by chance.

    Args:
        values: shape (n,), of any order.
    """
    gaps = np.diff(np.unique(values))
    if not len(gaps):
        return True
    steps = gaps[gaps < _NEAR * gaps.min()] / gaps.min()
    regular = np.abs(steps - np.round(steps)) < _WHOLE
    return len(steps) >= min(_FEWEST_NEAR, len(gaps)) and float(np.mean(regular)) > IN_STEPS


def smoothed(readings: Readings) -> Parts[tuple[str, float]]:
    """Find, in parts, a channel that is a moving mean, or a median, of what its sensor reads.

    Returns:
        The sentence, and over how long the mean is taken [s], NaN of a median; empty and NaN for
        one that is neither.
    """
    name = readings.name
    sensor = "position" if name == "displacement" else "force"
    length = mean_length(readings)
    yield
    if length:
        seconds = length / rate_of(readings.time_s)
        return (
            f"the {name} is a moving mean over {seconds:.{_DIGITS}g} s ({length} readings), as its "
            f"noise shows: it comes {500.0 * seconds:.{_DIGITS}g} ms late and flattens what is "
            f"quicker, which the law takes for other tissue: switch off the filter of the {sensor} "
            "sensor or of its driver, or shorten it"
        ), seconds
    if is_median(readings):
        return (
            f"the {name} is a median of its sensor's last readings, for it returns to values that "
            "it had just before: it comes late and cuts off what is quick, which the law takes for "
            f"other tissue: switch off the filter of the {sensor} sensor or of its driver"
        ), math.nan
    return "", math.nan


def _moving_mean(values: FloatArray, length: int) -> NDArray[np.float64]:
    """Return the mean over so many readings, in their middle; shorter by one less than these."""
    sums = np.cumsum(np.concatenate(([0.0], values)))
    mean: FloatArray = (sums[length:] - sums[:-length]) / length
    return mean
