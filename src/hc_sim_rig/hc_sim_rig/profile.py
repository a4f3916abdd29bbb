"""Motion profiles: waypoints plus sines, evaluated at a motion time.

Every motion of the rig (and every operator's force) is the sum of two tables: segments between
waypoints, straight or minimum-jerk, and sines. Beyond its last waypoint a profile stays there.
"""

from __future__ import annotations

import itertools
import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hc_sim_rig.compilation import inlined
from hc_sim_rig.layout import SEGMENT_COLUMNS, SHAPE_MINIMUM_JERK, SINE_COLUMNS


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


@inlined
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
            else:
                value = low + (high - low) * u
                rate = (high - low) / span
    for k in range(sines.shape[0]):
        angle = sines[k, 1] * time + sines[k, 2]
        value += sines[k, 0] * math.sin(angle)
        rate += sines[k, 0] * sines[k, 1] * math.cos(angle)
    return value, rate, index
