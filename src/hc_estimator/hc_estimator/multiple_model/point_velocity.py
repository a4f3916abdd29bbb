"""How fast was the tool at a point of what was felt, and how well is that known?

Least squares take velocities for exact but for a noise of which they know the variance
(`normal_equations`). A velocity that is always a share too small is no noise: the damping becomes
as much too large. A parabola of 30 ms makes that of a tremor of 8 Hz 6 % too small, and of 16 Hz 22
%, a quintic of 80 ms next to nothing and 5, with about the noise of the parabola. So where the
innovations say that a tool moves more than the displacement shows (`density_correction`) the
velocity is the quintic's. Elsewhere, where points have no neighbours yet, or a slow sensor none at
all, it is the parabola's and what a cubic adds, once that is known to be there. (B was 3 to 8 % too
high where hands trembled by 0.02 to 0.05 mm from 5 Hz on, by parabolas alone. By quintics alone
ramps with rests and a force zero that is off had a misfit told in 13 % of the time.)
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.adaptation import density_correction
from hc_estimator.compilation import compiled
from hc_estimator.multiple_model import grid as grids
from hc_estimator.multiple_model import history as histories
from hc_estimator.multiple_model import smoothing
from hc_estimator.multiple_model.local_polynomial import CUBIC_SLOPE_NOISE, SEXTIC_SLOPE_NOISE
from hc_estimator.multiple_model.records import POINTS

CUBIC_EVIDENCE = 4.0  # squared deviations at which half of what a cubic adds is used


@compiled
def velocity_at(history: Any, point: Any) -> float:
    """Velocity at a point [mm/s]."""
    if history.trembles != 0 and point.by_quintic != 0:
        return point.quintic  # type: ignore[no-any-return]
    return point.velocity + history.cubic_share * point.cubic  # type: ignore[no-any-return]


@compiled
def noise_of(history: Any, point: Any) -> int:
    """Index of the noise of that velocity in `history.velocity_std` and `velocity_noise`."""
    quintic = history.trembles != 0 and point.by_quintic != 0
    return histories.OF_QUINTIC if quintic else histories.OF_FIT


@compiled
def take_noise(bank: Any, independent: float) -> None:
    """Noise of the points' velocities, by what they are from, and what is used of them.

    Args:
        bank: velocity_std and velocity_noise of the history are set, and the share of the cubic.
        independent: number of points whose errors are independent of one another.
    """
    history, finder, noise = bank.history, bank.delay, bank.sensor_noise[0]
    history.trembles = 1 if density_correction.moves_more(bank.motion, history.trembles != 0) else 0
    spacing, width = finder.grid_step * history.every, finder.grid_width
    variance = grids.velocity_variance(finder, noise)
    _share_cubic(history, variance, independent)
    own = (1.0 + CUBIC_SLOPE_NOISE * history.cubic_share**2) * variance
    _note(history, histories.OF_FIT, own, own * width / spacing)
    own = SEXTIC_SLOPE_NOISE * variance
    _note(history, histories.OF_SEXTIC, own, own * width / spacing)
    own = (1.0 + CUBIC_SLOPE_NOISE) * variance
    _note(history, histories.NARROW, own, own * width / spacing)
    if finder.neighbours >= smoothing.FEWEST_NEIGHBOURS:
        value = noise * smoothing.VALUE_VARIANCE / grids.readings_of(finder)
        own = smoothing.slope_variance(finder, value, smoothing.BY_QUINTIC)
        _note(history, histories.OF_QUINTIC, own, own * width / spacing)
        own = smoothing.slope_variance(finder, value, smoothing.BY_CUBIC)
    # Slopes that overlap are off by differences of the same readings, which cancel over many.
    _note(history, histories.WIDE, own, own / history.every)


@compiled
def _note(history: Any, source: int, variance: float, by_share: float) -> None:
    """Note the noise of velocities; the latter by a point's share in the information."""
    history.velocity_std[source] = math.sqrt(variance)
    history.velocity_noise[source] = by_share


@compiled
def _share_cubic(history: Any, variance: float, independent: float) -> None:
    """How much of what a cubic adds to the parabolas' velocities is more than their noise.

    A parabola's slope is a share of (omega half)^2 / 10 too small for a motion of the angular
    frequency omega, always the same way, so that many points give a wrong damping for certain. A
    cubic's is not, and its part is five times as noisy (Savitzky and Golay, Anal. Chem. 36, 1964):
    it is used once it is known to be there, by its correlation with the slope or its mean square.

    Args:
        history: its share is set.
        variance: of a parabola's slope [mm^2/s^2].
        independent: number of points whose errors are independent of one another.
    """
    squares, along, speeds, first = 0.0, 0.0, 0.0, histories.oldest(history)
    for k in range(first, history.count):
        point = history.points[k % POINTS]
        squares += point.cubic * point.cubic
        along += point.velocity * point.cubic
        speeds += point.velocity * point.velocity
    count = history.count - first
    noise = CUBIC_SLOPE_NOISE * variance
    # Both are squares of what is normal, with a deviation of one, if there is only noise.
    slope = along * along * independent / max(noise * speeds * count, 1e-300)
    excess = max(squares / max(count * noise, 1e-300) - 1.0, 0.0) ** 2 * 0.5 * independent
    evidence = (slope + excess) ** 2
    history.cubic_share = evidence / (evidence + CUBIC_EVIDENCE**2)
