"""Where was the tool some time before a point that is remembered?

For fits in which the force is late by an unknown time: by whole points first, then between two of
them.
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.multiple_model.history import UNKNOWN
from hc_estimator.multiple_model.records import POINTS

SAME_TIME = 0.1  # of the time between two points, by which they may be off


@compiled
def place_of(history: Any, fit: Any, k: int) -> int:
    """Number of the point whose displacement belongs to a point's force; -1 if it has none."""
    j = k - fit.shift
    if j < fit.first or j >= fit.last or history.points[j % POINTS].source == UNKNOWN:
        return -1
    apart = history.points[k % POINTS].time - history.points[j % POINTS].time
    if abs(apart - fit.shift * fit.spacing) > SAME_TIME * fit.spacing:
        return -1
    return j  # type: ignore[no-any-return]


@compiled
def _between(s: float, begin: float, slope: float, end: float, end_slope: float) -> float:
    """Value at a share `s` of an interval by the cubic with these ends (Hermite), slopes by s."""
    rise = end - begin
    blend = (1.0 - s) * (slope - rise) + s * (rise - end_slope)
    return begin + s * rise + s * (1.0 - s) * blend


@compiled
def _share_of_way(history: Any, fit: Any, number: int, delay: float) -> float:
    """Share of the way to the next point that is some time [s] before one; NaN: not known."""
    other = number - 1 if delay > 0.0 else number + 1
    if delay == 0.0 or not fit.first <= other < fit.last:
        return math.nan
    near = history.points[other % POINTS]
    apart = near.time - history.points[number % POINTS].time
    known = near.source != UNKNOWN and abs(apart) < (1.0 + SAME_TIME) * fit.spacing
    return -delay / apart if known and abs(delay) <= abs(apart) else math.nan


@compiled
def motion_before(history: Any, fit: Any, number: int, delay: float) -> tuple[float, float, float]:
    """Depth, velocity and acceleration of the tool some time [s] before a point of this number.

    A Taylor series over half of 20 ms is off by enough to make 8.3 ms of a delay of 9.3, so that
    between two points both are used. What the depths say of the velocity is mostly their noise.
    """
    point = history.points[number % POINTS]
    depth, velocity, acceleration = point.depth, point.motion_velocity, point.motion_acceleration
    s = _share_of_way(history, fit, number, delay)
    if s >= 0.0:
        near = history.points[(number - 1 if delay > 0.0 else number + 1) % POINTS]
        apart = near.time - point.time
        return (
            _between(s, depth, apart * velocity, near.depth, apart * near.motion_velocity),
            _between(
                s,
                velocity,
                apart * acceleration,
                near.motion_velocity,
                apart * near.motion_acceleration,
            ),
            acceleration + s * (near.motion_acceleration - acceleration),
        )
    depth -= delay * (velocity - 0.5 * delay * acceleration)
    return depth, velocity - delay * acceleration, acceleration


@compiled
def noise_left(history: Any, fit: Any, number: int, delay: float) -> float:
    """Share of the variance of a point's motion that is left where two are averaged."""
    s = _share_of_way(history, fit, number, delay)
    if not s >= 0.0:
        return 1.0
    here = _between(s, 1.0, 0.0, 0.0, 0.0)
    return here * here + (1.0 - here) * (1.0 - here)
