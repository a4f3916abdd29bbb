"""What force a row expects: the unscented transform, plain or of the force's logarithm.

Paper A, Eq. 7 to 14, with points drawn from the covariance that the displacement has left: the tool
is then known to micrometres, and the law is all but linear over so short a way. Each pair of
opposite sigma points splits into an odd part, which is linear (the sensitivity), and an even part,
which is curvature (`tempering` says what for). Only the columns of the Cholesky factor that move
depth, velocity or parameters need the contact law, and those that move parameters alone share two
logarithms.
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.contact.hunt_crossley import LARGEST_EXPONENT
from hc_estimator.contact.registry import ADHESIVE, is_plain, limited_n, limited_p
from hc_estimator.linear_algebra import clear_matrix, clear_vector
from hc_estimator.multiple_model import levels
from hc_estimator.multiple_model.hypotheses import (
    BIASED,
    COUNTS,
    DEPTH,
    EXPONENT,
    LOG_DAMPING,
    LOG_STIFFNESS,
    OWN,
    SURFACE,
    VELOCITY,
    VELOCITY_EXPONENT,
)
from hc_estimator.multiple_model.kalman import (
    LARGEST_LOG,
    TINY,
    exp_limited,
    force_of,
    log_speed_of,
)

CENTRAL_WEIGHT = 2.0  # of the central point in covariances: alpha = 1, beta = 2, kappa = 0
SURE = 10.0  # deviations of a force from which on its logarithm is about normal
UNKNOWN_SHARE = 0.5  # of the reading, as the deviation of what was expected
LARGEST_FORCE = 1e60  # [N]; what is squared and tempered must be a number that is saved
LEAST_SHARE = 1e-6  # of the reading that every sigma point must have for its logarithm
PIVOT_TOLERANCE = 1e-15  # a pivot this much smaller than its element is rounding error


@compiled
def foresee_force(settings: Any, row: Any, log_speed: float, reading: float, noise: float) -> bool:
    """Unscented transform of the force: predicted mean, sensitivity and curvature.

    Args:
        settings: settings record.
        row: what it expects is noted in it.
        log_speed: see `levels`.
        reading: force that was measured [N].
        noise: variance of its error [N^2].

    Returns:
        False if the covariance has no Cholesky factor, or the force is out of all bounds; the row
        is then lost.
    """
    count = COUNTS[row.index]
    if not _factorise(row.covariance, row.factor, count):
        return False
    state, factor, sensitivity = row.state, row.factor, row.sensitivity
    surface = SURFACE[row.index]
    plain = is_plain(settings.contact_model)
    scale = float(count)
    spread = math.sqrt(scale)
    depth, velocity = state[DEPTH], state[VELOCITY]
    if surface:
        depth -= state[OWN]
        velocity -= state[OWN + 1]
    k, b, n, p = state[2], state[3], state[4], state[5]
    ridge = levels.ridge_at(k, b, p, log_speed_of(row, log_speed))
    touching = depth > TINY
    log_depth = math.log(depth) if touching else 0.0
    speed = abs(velocity)
    log_velocity = math.log(speed) if speed > TINY else math.log(TINY)
    sign = 1.0 if velocity > 0.0 else -1.0
    least = -math.inf if settings.contact_model == ADHESIVE else 0.0
    if plain:
        drag = sign if speed > TINY else 0.0
        centre = max(_force(depth, log_depth, log_velocity, drag, k, b, n, p), least)
    else:
        centre = force_of(settings, depth, velocity, k, b, n, p)
    total = 0.0
    squares = 0.0
    for j in range(count):
        move_depth = spread * factor[DEPTH, j] if j == 0 else 0.0
        move_velocity = spread * factor[VELOCITY, j] if j <= VELOCITY else 0.0
        if surface:
            if j <= OWN:
                move_depth -= spread * factor[OWN, j]
            if j <= OWN + 1:
                move_velocity -= spread * factor[OWN + 1, j]
        move_k = spread * factor[LOG_STIFFNESS, j] if j <= LOG_STIFFNESS else 0.0
        move_b = spread * factor[LOG_DAMPING, j] if j <= LOG_DAMPING else 0.0
        move_n = spread * factor[EXPONENT, j] if j <= EXPONENT else 0.0
        move_p = spread * factor[VELOCITY_EXPONENT, j] if j <= VELOCITY_EXPONENT else 0.0
        moves_tool = move_depth != 0.0 or move_velocity != 0.0
        if not moves_tool and j > VELOCITY_EXPONENT:
            sensitivity[j] = 0.0
            row.sigma_force[j, 0] = centre
            row.sigma_force[j, 1] = centre
            continue
        k_plus, b_plus = levels.moved(ridge, move_k, move_b, move_p)
        k_minus, b_minus = levels.moved(ridge, -move_k, -move_b, -move_p)
        n_plus, n_minus, p_plus, p_minus = n + move_n, n - move_n, p + move_p, p - move_p
        if plain and not moves_tool:
            plus, minus = 0.0, 0.0
            if touching:
                plus = _parametric_force(
                    log_depth, log_velocity, sign, k_plus, b_plus, n_plus, p_plus
                )
                minus = _parametric_force(
                    log_depth, log_velocity, sign, k_minus, b_minus, n_minus, p_minus
                )
        elif plain and move_depth == 0.0:
            plus = _faster_force(
                depth, log_depth, velocity + move_velocity, k_plus, b_plus, n_plus, p_plus
            )
            minus = _faster_force(
                depth, log_depth, velocity - move_velocity, k_minus, b_minus, n_minus, p_minus
            )
        else:
            above, below = depth + move_depth, depth - move_depth
            faster, slower = velocity + move_velocity, velocity - move_velocity
            plus = force_of(settings, above, faster, k_plus, b_plus, n_plus, p_plus)
            minus = force_of(settings, below, slower, k_minus, b_minus, n_minus, p_minus)
        if plain:
            plus, minus = max(plus, least), max(minus, least)
        row.sigma_force[j, 0] = plus
        row.sigma_force[j, 1] = minus
        sensitivity[j] = 0.5 * (plus - minus) / spread
        even = 0.5 * (plus + minus) - centre
        total += even
        squares += even * even
    if BIASED[row.index]:  # what is added to the law, and linear
        for j in range(OWN + 1):
            sensitivity[j] += factor[OWN, j]
        centre += state[OWN]
    bend = total / scale  # of the mean against the central point
    _note_expected(row, centre + bend, _curvature(squares, total, bend, count))
    unknown = not BIASED[row.index] and row.explained > UNKNOWN_SHARE**2 * reading * reading
    if unknown and reading > SURE * math.sqrt(noise):
        _foresee_logarithm(row, centre, reading)
    if abs(row.innovation[1]) < LARGEST_FORCE and row.explained < LARGEST_FORCE**2:
        return True
    _forget_expected(row)
    return False


@compiled
def _curvature(squares: float, total: float, bend: float, count: int) -> float:
    """Variance that the even parts of the sigma points make."""
    scale = float(count)
    curvature = (squares - 2.0 * bend * total + scale * bend * bend) / scale
    return curvature + CENTRAL_WEIGHT * bend * bend


@compiled
def _note_expected(row: Any, mean: float, curvature: float) -> None:
    """Note mean and variance of the force that are expected."""
    linear = 0.0
    for j in range(COUNTS[row.index]):
        linear += row.sensitivity[j] * row.sensitivity[j]
    row.innovation[1] = -mean  # the reading is added by `innovate_force`
    row.explained = linear + curvature
    row.force_noise = curvature  # for `tempering`


@compiled
def _forget_expected(row: Any) -> None:
    """Keep nothing of a force that is out of all bounds: it need not have been a number."""
    row.innovation[1] = 0.0
    row.explained = 0.0
    row.force_noise = 0.0
    clear_vector(row.sensitivity)
    clear_matrix(row.sigma_force)


@compiled
def _foresee_logarithm(row: Any, centre: float, reading: float) -> None:
    """The same for the logarithm of the force, where that is closer to linear.

    A force that is clearly felt is known by a small share of itself, and its logarithm is linear in
    ln K and n (ours). All is in newtons of the reading, reading ln(force / reading), so that noise
    and likelihood stay the same. Only as long as next to nothing is known: what is curved in a law
    must be tempered, or a law that does not fit teaches wrong parameters for certain.
    """
    count = COUNTS[row.index]
    least = LEAST_SHARE * reading
    if not centre > least:
        return
    for j in range(count):
        if not (row.sigma_force[j, 0] > least and row.sigma_force[j, 1] > least):
            return
    total, squares = 0.0, 0.0
    middle = math.log(centre / reading)
    for j in range(count):
        plus = math.log(row.sigma_force[j, 0] / reading)
        minus = math.log(row.sigma_force[j, 1] / reading)
        even = 0.5 * reading * (plus + minus - 2.0 * middle)
        total += even
        squares += even * even
    bend = total / count
    curvature = _curvature(squares, total, bend, count)
    if not curvature < row.force_noise:
        return
    spread = math.sqrt(float(count))
    for j in range(count):
        share = math.log(row.sigma_force[j, 0] / row.sigma_force[j, 1])
        row.sensitivity[j] = 0.5 * reading * share / spread
    _note_expected(row, reading * (1.0 + middle) + bend, curvature)


@compiled
def _force(
    depth: float,
    log_depth: float,
    log_speed: float,
    drag: float,
    k: float,
    b: float,
    n: float,
    p: float,
) -> float:
    """`kalman.force_of` for the plain law, tension allowed, where the logarithms are known.

    Args:
        depth: [mm].
        log_depth: its logarithm.
        log_speed: that of the speed.
        drag: sign of the damping force; 0 at rest.
        k: ln K.
        b: ln B.
        n: exponent of the depth.
        p: exponent of the speed.
    """
    if depth <= TINY:
        return 0.0
    log_power = limited_n(n) * log_depth
    force = exp_limited(k) * math.exp(min(log_power, LARGEST_EXPONENT))
    if drag != 0.0:
        log_power += limited_p(p) * log_speed
        force += drag * (exp_limited(b) * math.exp(min(log_power, LARGEST_EXPONENT)))
    return force


@compiled
def _faster_force(
    depth: float, log_depth: float, velocity: float, k: float, b: float, n: float, p: float
) -> float:
    """The same at another velocity [mm/s]."""
    speed = abs(velocity)
    if speed <= TINY:
        return _force(depth, log_depth, 0.0, 0.0, k, b, n, p)
    drag = 1.0 if velocity > 0.0 else -1.0
    return _force(depth, log_depth, math.log(speed), drag, k, b, n, p)


@compiled
def _parametric_force(
    log_depth: float, log_speed: float, sign: float, k: float, b: float, n: float, p: float
) -> float:
    """Hunt-Crossley force, tension allowed, from the logarithms of depth and speed."""
    power = limited_n(n) * log_depth
    elastic = math.exp(min(k + power, LARGEST_LOG))
    return elastic + sign * math.exp(min(b + power + limited_p(p) * log_speed, LARGEST_LOG))


@compiled
def _factorise(matrix: Any, factor: Any, count: int) -> bool:
    """Lower Cholesky factor of the leading block; False if it is not finite or clearly indefinite.

    A pivot that is zero to rounding makes a zero column: what is held fixed has no variance.
    """
    for j in range(count):
        pivot = matrix[j, j]
        for k in range(j):
            pivot -= factor[j, k] * factor[j, k]
        threshold = PIVOT_TOLERANCE * matrix[j, j]
        if not (pivot >= -1e4 * threshold and pivot < math.inf):  # NaN fails too
            return False
        if pivot <= threshold:
            for i in range(j, count):
                factor[i, j] = 0.0
            continue
        root = math.sqrt(pivot)
        factor[j, j] = root
        inverse = 1.0 / root
        for i in range(j + 1, count):
            total = matrix[i, j]
            for k in range(j):
                total -= factor[i, k] * factor[j, k]
            factor[i, j] = total * inverse
    return True
