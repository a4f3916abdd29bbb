"""Hunt-Crossley forces at all sigma points of `kinematic`, without what they have in common.

One force takes two logarithms and four exponentials, and fifteen of them were most of a step. The
columns of a lower factor leave the displacement alone from the second on and the velocity from the
third on: three logarithms of displacements and five of velocities serve all points. With ln K and
ln B in the state each term is one exponential, exp(ln K + n ln d), and where depth and velocity are
those of the mean, the terms of two opposite points are those of the mean times and over the same.

Same limits as `contact.registry.contact_force`, same numbers but for rounding.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hc_estimator.compilation import compiled
from hc_estimator.contact.hunt_crossley import LARGEST_EXPONENT, TINY
from hc_estimator.contact.registry import (
    ADHESIVE,
    LARGEST_DISPLACEMENT_EXPONENT,
    LARGEST_VELOCITY_EXPONENT,
    SMALLEST_DISPLACEMENT_EXPONENT,
    SMALLEST_VELOCITY_EXPONENT,
    limited_n,
    limited_p,
)
from hc_estimator.state_space.kinematic import LARGEST_LOG

USUAL_LOG = 70.0
"""Up to this |ln d| and |ln v| no power that the exponents allow reaches LARGEST_EXPONENT."""


@compiled
def _logarithm(value: float) -> float:
    """Return ln of a depth or speed; minus infinity for one that counts as zero."""
    return math.log(value) if value > TINY else -math.inf


@compiled
def _force(
    log_depth: float,
    log_speed: float,
    forward: bool,
    log_stiffness: float,
    log_damping: float,
    displacement_exponent: float,
    velocity_exponent: float,
) -> float:
    """Force [N] with tension; arguments as the state has them, logarithms as `_logarithm` has."""
    if log_depth == -math.inf:
        return 0.0
    power = limited_n(displacement_exponent) * log_depth
    stiffness = min(max(log_stiffness, -LARGEST_LOG), LARGEST_LOG)
    force = math.exp(stiffness + min(power, LARGEST_EXPONENT))
    if log_speed == -math.inf:
        return force
    power += log_speed * limited_p(velocity_exponent)
    damping = min(max(log_damping, -LARGEST_LOG), LARGEST_LOG)
    drag = math.exp(damping + min(power, LARGEST_EXPONENT))
    return force + drag if forward else force - drag


@compiled
def _is_usual(center: NDArray[np.float64], factor: NDArray[np.float64], j: int, s: float) -> bool:
    """True if no limit is reached at mean +- s times column j, so that both are one exponential."""
    for i in range(3, 5):
        if not abs(center[i]) + s * abs(factor[i, j]) < LARGEST_LOG:
            return False
    n, p = s * abs(factor[5, j]), s * abs(factor[6, j])
    return bool(
        center[5] - n > SMALLEST_DISPLACEMENT_EXPONENT
        and center[5] + n < LARGEST_DISPLACEMENT_EXPONENT
        and center[6] - p > SMALLEST_VELOCITY_EXPONENT
        and center[6] + p < LARGEST_VELOCITY_EXPONENT
    )


@compiled
def _are_usual(center: NDArray[np.float64], covariance: NDArray[np.float64], s: float) -> bool:
    """True if `_is_usual` for every column: no element of a factor exceeds its row's deviation."""
    s *= 1.0 + 1e-6  # more than rounding
    for i in range(3, 5):
        if not abs(center[i]) + s * math.sqrt(covariance[i, i]) < LARGEST_LOG:
            return False
    n, p = s * math.sqrt(covariance[5, 5]), s * math.sqrt(covariance[6, 6])
    return bool(
        center[5] - n > SMALLEST_DISPLACEMENT_EXPONENT
        and center[5] + n < LARGEST_DISPLACEMENT_EXPONENT
        and center[6] - p > SMALLEST_VELOCITY_EXPONENT
        and center[6] + p < LARGEST_VELOCITY_EXPONENT
    )


@compiled
def measure_sigma_points(
    contact_model: int,
    center: NDArray[np.float64],
    covariance: NDArray[np.float64],
    factor: NDArray[np.float64],
    spread: float,
    outputs: NDArray[np.float64],
) -> None:
    """Measurement function [d, F] at the mean and at mean +- spread times each column.

    Args:
        contact_model: code of the contact model, one that `is_plain`.
        center: mean of the state, shape (7,).
        covariance: its covariance, shape (7, 7).
        factor: the lower Cholesky factor of that, shape (7, 7).
        spread: sqrt(N + lambda) of the unscented transform.
        outputs: takes displacement [mm] and force [N], shape (15, 2): the mean, then the points
            above and then those below it.
    """
    log_depth, log_speed = _logarithm(center[0]), _logarithm(abs(center[1]))
    usual_motion = abs(log_depth) < USUAL_LOG and abs(log_speed) < USUAL_LOG
    elastic = drag = 0.0
    if usual_motion and _is_usual(center, factor, 0, 0.0):
        elastic = math.exp(center[3] + center[5] * log_depth)
        drag = math.exp(center[4] + center[5] * log_depth + center[6] * log_speed)
        if center[1] < 0.0:
            drag = -drag
        outputs[0, 1] = elastic + drag
    else:
        usual_motion = False
        outputs[0, 1] = _point_force(center, factor, 0, 0.0, log_depth, log_speed, center[1])
    outputs[0, 0] = center[0]
    all_usual = usual_motion and _are_usual(center, covariance, spread)
    for j in range(7):
        above, below = 1 + j, 8 + j
        outputs[above, 0] = center[0] + spread * factor[0, j]
        outputs[below, 0] = center[0] - spread * factor[0, j]
        if j >= 2 and usual_motion and (all_usual or _is_usual(center, factor, j, spread)):
            exponent = factor[5, j] * log_depth
            ratio = math.exp(spread * (factor[3, j] + exponent))
            other = math.exp(spread * (factor[4, j] + exponent + factor[6, j] * log_speed))
            outputs[above, 1] = elastic * ratio + drag * other
            outputs[below, 1] = elastic / ratio + drag / other
            continue
        for k in range(2):
            sign = spread if k == 0 else -spread
            depth, velocity = center[0] + sign * factor[0, j], center[1] + sign * factor[1, j]
            ln_d = log_depth if j >= 1 else _logarithm(depth)
            ln_v = log_speed if j >= 2 else _logarithm(abs(velocity))
            point = above if k == 0 else below
            outputs[point, 1] = _point_force(center, factor, j, sign, ln_d, ln_v, velocity)
    if contact_model != ADHESIVE:
        for point in range(15):
            outputs[point, 1] = max(outputs[point, 1], 0.0)


@compiled
def _point_force(
    center: NDArray[np.float64],
    factor: NDArray[np.float64],
    j: int,
    sign: float,
    log_depth: float,
    log_speed: float,
    velocity: float,
) -> float:
    """Force with tension at mean + sign times column j, whose logarithms are known."""
    return _force(
        log_depth,
        log_speed,
        velocity > 0.0,
        center[3] + sign * factor[3, j],
        center[4] + sign * factor[4, j],
        center[5] + sign * factor[5, j],
        center[6] + sign * factor[6, j],
    )
