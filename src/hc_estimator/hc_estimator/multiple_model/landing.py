"""What a force says of a surface that moves where the tool may just be touching it.

A surface that has not been felt for a while may be a millimetre from where it was. Beneath a tool
that may as well be in the air the force is no linear function of that, not even roughly, and a
Kalman filter that takes a hundred readings of nothing for a hundred measurements knows the surface
to micrometres, a millimetre from its place. So no force here says only that the surface is no
higher than the tool (an inequality, met by projection: Simon, IET Control Theory and Applications
4(8), 2010); what is known of it stays as it is, up to what is known beforehand. And the first force
is a measurement of the depth, by the law turned round: ln d is linear in ln F and ln K, and d is
known by a share of itself, however far the surface had gone. Neither teaches anything about the
tissue (ours).
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.multiple_model.hypotheses import (
    DEPTH,
    EXPONENT,
    LOG_DAMPING,
    LOG_STIFFNESS,
    OWN,
    OWN_VARIANCES,
    STATES,
    SURFACE,
    VELOCITY,
    VELOCITY_EXPONENT,
)
from hc_estimator.multiple_model.kalman import (
    depth_of,
    exp_limited,
    log_force_variance,
    use_depth,
)
from hc_estimator.multiple_model.local_polynomial import TOUCHING

KNOWN, AIR, LANDS = 0, 1, 2
SURE = 2.0  # deviations of the depth from which on the tool touches for certain
LIKELY = 3.0  # the same that the surface may be off
LARGEST_SHARE = 0.5  # of the depth, as its deviation by the first force
DRAG_SHARE = 0.2  # of the force, as the deviation that damping makes


@compiled
def look(row: Any, reading: float, noise: float) -> int:
    """What a force says: KNOWN (as anywhere), AIR (nothing but that), or LANDS.

    Args:
        row: whose surface moves, or not.
        reading: force [N].
        noise: variance of the sensor [N^2].
    """
    if not SURFACE[row.index]:
        return KNOWN
    depth, spread = depth_of(row), math.sqrt(max(_depth_variance(row), 0.0))
    if depth > SURE * spread:
        return KNOWN
    if reading < TOUCHING * math.sqrt(noise):
        return AIR
    return LANDS if depth > -LIKELY * spread else KNOWN


@compiled
def _depth_variance(row: Any) -> float:
    covariance = row.covariance
    both = covariance[DEPTH, DEPTH] + covariance[OWN, OWN]
    return both - 2.0 * covariance[DEPTH, OWN]  # type: ignore[no-any-return]


@compiled
def _velocity_of(row: Any) -> float:
    """Velocity of the tool in the tissue [mm/s]."""
    return row.state[VELOCITY] - row.state[OWN + 1]  # type: ignore[no-any-return]


@compiled
def depth_at(row: Any, force: float, velocity: float) -> float:
    """Depth [mm] at which a row's law gives a force [N] at a velocity; 0 where it gives none."""
    state = row.state
    log_slope = state[LOG_STIFFNESS]
    if velocity != 0.0:
        drag = state[LOG_DAMPING] - state[LOG_STIFFNESS]
        drag = exp_limited(drag + state[VELOCITY_EXPONENT] * math.log(abs(velocity)))
        share = 1.0 + (drag if velocity > 0.0 else -drag)
        if share <= 0.0:
            return 0.0
        log_slope += math.log(share)
    log_depth = (math.log(force) - log_slope) / max(state[EXPONENT], 0.5)
    return exp_limited(log_depth)


@compiled
def stay_in_air(row: Any, reading: float, noise: float) -> None:
    """The surface is no higher than a force that is none allows; how well it is known is kept.

    Args:
        row: changed.
        reading: force [N].
        noise: variance of the sensor [N^2].
    """
    covariance = row.covariance
    deepest = depth_at(row, max(reading, 0.0) + TOUCHING * math.sqrt(noise), _velocity_of(row))
    if depth_of(row) > deepest:
        row.state[OWN] = row.state[DEPTH] - deepest
    for i in range(OWN, OWN + 2):
        most = OWN_VARIANCES[row.index, i - OWN]
        if covariance[i, i] > most:
            share = math.sqrt(most / covariance[i, i])
            for j in range(STATES):
                covariance[i, j] *= share
                covariance[j, i] *= share


@compiled
def land(row: Any, reading: float, noise: float) -> bool:
    """Use the first force as a measurement of the depth; False if that says nothing new.

    Args:
        row: changed.
        reading: force [N].
        noise: variance of the sensor [N^2].
    """
    n = max(row.state[EXPONENT], 0.5)
    depth = depth_at(row, reading, _velocity_of(row))
    if not depth > 0.0:
        return False
    log_depth = math.log(depth)
    variance = noise / (reading * reading) + DRAG_SHARE**2
    variance += log_force_variance(row, log_depth)
    variance /= n * n
    if not variance < LARGEST_SHARE**2:
        return False
    variance *= depth * depth
    if not variance < _depth_variance(row):
        return False
    use_depth(row, depth, variance)
    return True
