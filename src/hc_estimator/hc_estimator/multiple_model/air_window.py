"""Does the force stay the same while the tool travels? A window of readings of both.

What is common to the first touch (`contact_onset`) and to a zero that wanders (`air_zero`): means
and sums of squares and products about them (Welford, Technometrics 4, 1962), and what they say.
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.linear_algebra import clear_vector, copy_vector

FEWEST = 20  # readings in the air that make a mean
LEAST_TRAVEL = 0.5  # in the air [mm]
TRAVEL_DEVIATIONS = 20.0  # the same, in deviations of the place
# The same of visits that are short, and in deviations; noise alone makes six of them.
SHORT_TRAVEL, SHORT_DEVIATIONS = 0.2, 10.0
WILDEST = 2.0  # scatter of a sensor in the air over its noise variance
SAME = 4.0  # deviations of the slope of the force over the way up to which it is none
CALMEST = 0.05  # scatter of a working sensor in the air over its noise variance, at least
SIGNIFICANT = 5.0  # deviations of the mean force from which on it is a zero that is off
SMALLEST_ZERO = 0.2  # deviations of a reading below which no zero is moved


@compiled
def clear(window: Any) -> None:
    """No reading is in a window."""
    window.count = 0
    clear_vector(window.mean)
    clear_vector(window.moment)
    window.lowest = math.inf
    window.highest = -math.inf


@compiled
def copy(source: Any, window: Any) -> None:
    """Let a window be as another one is now."""
    window.count = source.count
    copy_vector(source.mean, window.mean)
    copy_vector(source.moment, window.moment)
    window.lowest = source.lowest
    window.highest = source.highest


@compiled
def move(window: Any, displacement: float, force: float) -> None:
    """The zeros have moved by so much [mm], [N]; what was read is the same."""
    window.mean[0] -= displacement
    window.mean[1] -= force
    window.lowest -= displacement
    window.highest -= displacement


@compiled
def add(window: Any, displacement: float, force: float) -> None:
    """Take a reading, and where the tool was."""
    mean, moment = window.mean, window.moment
    window.count += 1
    way, change = displacement - mean[0], force - mean[1]
    mean[0] += way / window.count
    mean[1] += change / window.count
    moment[0] += way * (displacement - mean[0])
    moment[1] += way * (force - mean[1])
    moment[2] += change * (force - mean[1])
    window.lowest = min(window.lowest, displacement)
    window.highest = max(window.highest, displacement)


@compiled
def travels(window: Any, variance: float, least: float) -> bool:
    """True if the tool went far enough to show whether the force changes on the way.

    Args:
        window: of readings.
        variance: of a place [mm^2].
        least: way that is needed [mm].
    """
    least = max(least, TRAVEL_DEVIATIONS * math.sqrt(variance))
    return bool(window.highest - window.lowest >= least)


@compiled
def travels_shortly(window: Any, variance: float) -> bool:
    """True if it went somewhere at all, as of a visit to the air that is short; as `travels`."""
    least = max(SHORT_TRAVEL, SHORT_DEVIATIONS * math.sqrt(variance))
    return bool(window.highest - window.lowest >= least)


@compiled
def scatter_of(window: Any) -> float:
    """Variance of the force [N^2]."""
    return window.moment[2] / (window.count - 1)  # type: ignore[no-any-return]


@compiled
def variance_of_mean(window: Any, of_means: float) -> float:
    """Variance of the mean force [N^2].

    Args:
        window: of readings.
        of_means: variance of a reading that counts in it, where these go together
            (`noise_color.of_means`) [N^2].
    """
    return max(scatter_of(window), of_means) / window.count  # type: ignore[no-any-return]


@compiled
def is_calm(window: Any, variance: float, wildest: float) -> bool:
    """True if the force scatters as a working sensor does, at most so many times its variance."""
    scatter = scatter_of(window)
    return bool(scatter >= CALMEST * variance and scatter <= wildest * variance)


@compiled
def stays_the_same(window: Any) -> bool:
    """True if the force does not change on the way."""
    moment = window.moment
    return bool(abs(moment[1] / moment[0]) <= SAME * math.sqrt(scatter_of(window) / moment[0]))


@compiled
def would_show(window: Any, slope: float) -> bool:
    """True if the force would be seen to change with the place by so much [N/mm]."""
    return bool(slope > 2.0 * SAME * math.sqrt(scatter_of(window) / window.moment[0]))


@compiled
def zero_of(
    window: Any, noise: float, of_means: float, place_variance: float
) -> tuple[float, float]:
    """What the force's zero is if a tool that seems to be outside is, and its deviation [N].

    Args:
        window: of readings outside.
        noise: variance of the force [N^2].
        of_means: as in `variance_of_mean` [N^2].
        place_variance: of a place [mm^2].

    Returns:
        An infinite deviation where readings are few or the force does not stay the same.
    """
    if window.count < FEWEST or not travels_shortly(window, place_variance):
        return 0.0, math.inf
    if not (is_calm(window, noise, WILDEST) and stays_the_same(window)):
        return 0.0, math.inf
    return window.mean[1], math.sqrt(variance_of_mean(window, of_means))
