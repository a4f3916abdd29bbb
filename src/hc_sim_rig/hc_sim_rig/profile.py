"""Motion profiles: waypoints plus sines, evaluated at a motion time.

Every motion of the rig (and every operator's force) is the sum of two tables: segments between
waypoints (straight, with minimum jerk, or at a constant acceleration from or to rest), and sines.
Between two segments and beyond the last a profile stays where it is.
"""

from __future__ import annotations

import itertools
import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hc_sim_rig.compilation import compiled
from hc_sim_rig.layout import (
    SEGMENT_COLUMNS,
    SHAPE_LINEAR,
    SHAPE_MINIMUM_JERK,
    SHAPE_SLOWING_DOWN,
    SHAPE_SPEEDING_UP,
    SINE_COLUMNS,
)


class Profile(NamedTuple):
    """A motion as the kernels take it."""

    offset: float
    """Constant part, which the amplitude does not scale."""
    segments: NDArray[np.float64]
    """(S, 5): start time [s], end time [s], start value, end value, shape."""
    sines: NDArray[np.float64]
    """(M, 3): amplitude, angular frequency [rad/s], phase [rad]."""


def profile_from_points(
    points: list[tuple[float, float]],
    shape: float,
    sines: list[tuple[float, float, float]] | None = None,
) -> Profile:
    """Make a profile from waypoints (time, value) and sines (amplitude, frequency Hz, phase).

    The first waypoint's value becomes the offset: an amplitude scales the way from there.
    """
    offset = points[0][1]
    rows = [
        (t0, t1, x0 - offset, x1 - offset, shape)
        for (t0, x0), (t1, x1) in itertools.pairwise(points)
        if t1 > t0
    ]
    waves = [(a, 2.0 * math.pi * f, phase) for a, f, phase in sines or []]
    return Profile(
        offset,
        np.array(rows, dtype=np.float64).reshape(-1, SEGMENT_COLUMNS),
        np.array(waves, dtype=np.float64).reshape(-1, SINE_COLUMNS),
    )


def leg_duration(way: float, velocity: float, acceleration: float) -> float:
    """Time that a way takes from rest to rest with limits of velocity and acceleration [s]."""
    distance = abs(way)
    peak = min(velocity, math.sqrt(acceleration * distance))
    return distance / peak + peak / acceleration if distance > 0.0 else 0.0


def profile_from_legs(
    start: float, legs: list[tuple[float, float]], velocity: float, acceleration: float
) -> Profile:
    """Make a profile of ways from rest to rest with a trapezoidal velocity.

    Args:
        start: value before the first leg; becomes the offset.
        legs: when each leg begins and where it ends, in order of time; none may begin before the
            one ahead of it has ended (`leg_duration`).
        velocity: limit, reached where the way is long enough.
        acceleration: with which it speeds up and slows down.
    """
    rows = []
    value = 0.0
    for begin, end_value in legs:
        way = end_value - start - value
        if way == 0.0:
            continue
        end = begin + leg_duration(way, velocity, acceleration)
        target = value + way
        if velocity * velocity >= acceleration * abs(way):  # it never gets to full speed
            middle = 0.5 * (begin + end), 0.5 * (value + target)
            knots = [(begin, value), middle, (end, target)]
            shapes = [SHAPE_SPEEDING_UP, SHAPE_SLOWING_DOWN]
        else:
            ramp_time = velocity / acceleration
            ramp = math.copysign(0.5 * velocity * ramp_time, way)
            knots = [(begin, value), (begin + ramp_time, value + ramp)]
            knots += [(end - ramp_time, target - ramp), (end, target)]
            shapes = [SHAPE_SPEEDING_UP, SHAPE_LINEAR, SHAPE_SLOWING_DOWN]
        for ((t0, x0), (t1, x1)), shape in zip(itertools.pairwise(knots), shapes, strict=True):
            if t1 > t0:
                rows.append((t0, t1, x0, x1, shape))
        value = target
    return Profile(
        start,
        np.array(rows, dtype=np.float64).reshape(-1, SEGMENT_COLUMNS),
        np.zeros((0, SINE_COLUMNS)),
    )


@compiled  # with a cache file: Python calls it too, at every start
def profile_at(
    time: float, segments: NDArray[np.float64], sines: NDArray[np.float64], hint: int
) -> Any:
    """Value, rate of change and segment of a profile (without its offset) at a motion time.

    Args:
        time: motion time [s].
        segments: (S, 5) table.
        sines: (M, 3) table.
        hint: segment in which the search starts (an earlier answer).

    Returns:
        Tuple of value, its derivative by motion time, and the segment found.
    """
    value = 0.0
    rate = 0.0
    count = segments.shape[0]
    index = min(max(hint, 0), max(count - 1, 0))
    if count > 0:
        while index > 0 and time < segments[index, 0]:
            index -= 1
        while index < count - 1 and time >= segments[index + 1, 0]:
            index += 1
        start, end = segments[index, 0], segments[index, 1]
        low, high = segments[index, 2], segments[index, 3]
        if time < start:
            value = low
        elif time >= end:
            value = high
        else:
            span = end - start
            u = (time - start) / span
            if segments[index, 4] == SHAPE_MINIMUM_JERK:
                value = low + (high - low) * u * u * u * (10.0 + u * (6.0 * u - 15.0))
                rate = (high - low) / span * 30.0 * u * u * (1.0 - u) * (1.0 - u)
            elif segments[index, 4] == SHAPE_SPEEDING_UP:
                value = low + (high - low) * u * u
                rate = (high - low) / span * 2.0 * u
            elif segments[index, 4] == SHAPE_SLOWING_DOWN:
                value = high - (high - low) * (1.0 - u) * (1.0 - u)
                rate = (high - low) / span * 2.0 * (1.0 - u)
            else:
                value = low + (high - low) * u
                rate = (high - low) / span
    for k in range(sines.shape[0]):
        angle = sines[k, 1] * time + sines[k, 2]
        value += sines[k, 0] * math.sin(angle)
        rate += sines[k, 0] * sines[k, 1] * math.cos(angle)
    return value, rate, index
