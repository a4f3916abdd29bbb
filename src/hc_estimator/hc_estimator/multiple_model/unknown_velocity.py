"""What a velocity that is not known makes of the force, and what it must not teach.

Two errors of the unscented transform belong to it. Its points lie on the axes, and do not see that
the force is the *product* of velocity and damping; `product_variance` is that part. And as long as
not even the direction of the motion is known, sign(v) |v|^p looks linear in it, and noise of the
velocity would be counted as knowledge of B and p: `hold` leaves those two as they are.
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.contact.registry import is_plain
from hc_estimator.multiple_model.hypotheses import (
    EXPONENT,
    FRESH,
    LOG_DAMPING,
    VELOCITY,
    VELOCITY_EXPONENT,
)
from hc_estimator.multiple_model.kalman import HOLD_ALL, HOLD_DAMPING, HOLD_NOTHING, depth_of
from hc_estimator.multiple_model.maneuver import HOLD_TIME, MOVING, held_samples, is_turning

COHERENCE = 10.0  # samples over which the error of the velocity stays the same, at most


@compiled
def product_variance(
    settings: Any, maneuver: Any, row: Any, elapsed: float, coherent: float
) -> float:
    """Variance of the force from velocity times damping, both not known [N^2].

    The second-order term of the damping force in the velocity and in the logarithm of its factor
    B d^n |v|^p, for some time after a maneuver; times the samples over which it stays the same.

    Args:
        settings: settings record.
        maneuver: record of the last maneuver.
        row: a row that stands at the sample.
        elapsed: time since the last sample [s].
        coherent: samples over which an error of the linearisation stays the same.
    """
    if (
        maneuver.since > COHERENCE * held_samples(elapsed)
        and maneuver.departed > COHERENCE * HOLD_TIME
    ):
        return 0.0
    if not is_plain(settings.contact_model):
        return 0.0
    state, covariance = row.state, row.covariance
    depth, variance = depth_of(row), covariance[VELOCITY, VELOCITY]
    if not (depth > 0.0 and variance > 0.0 and elapsed > 0.0):
        return 0.0
    b, n, q = LOG_DAMPING, EXPONENT, VELOCITY_EXPONENT
    log_depth = math.log(depth)
    log_speed = 0.5 * math.log(state[VELOCITY] ** 2 + variance)
    p = state[q]
    slope = p * math.exp(min(state[b] + state[n] * log_depth + (p - 1.0) * log_speed, 300.0))
    by_p = log_speed + 1.0 / p
    of_log = covariance[b, b] + log_depth**2 * covariance[n, n] + by_p**2 * covariance[q, q]
    of_log += 2.0 * (log_depth * covariance[b, n] + by_p * covariance[b, q])
    of_log += 2.0 * log_depth * by_p * covariance[n, q]
    return float(min(coherent, COHERENCE) * slope * slope * variance * max(of_log, 0.0))


@compiled
def hold(settings: Any, maneuver: Any, row: Any, elapsed: float) -> int:
    """What an unknown velocity must not teach: all parameters, B and p, or nothing."""
    if settings.find_maneuvers == 0 or row.index >= FRESH:
        return HOLD_NOTHING
    if is_turning(maneuver, row, elapsed):
        return HOLD_ALL
    least = MOVING**2 if maneuver.departed < COHERENCE * HOLD_TIME else 1.0
    if row.state[VELOCITY] ** 2 < least * row.covariance[VELOCITY, VELOCITY]:
        return HOLD_DAMPING
    return HOLD_NOTHING
