"""One row's Kalman filter: prediction, and an update with one reading at a time.

The displacement is a linear function of the state and comes first, by the plain Kalman update. The
force comes after it, by the unscented transform (paper A, Eq. 7 to 14) with points drawn from the
covariance that the displacement has left: the tool is then known to micrometres, and the law is
all but linear over so short a way. With both readings this is the joint update of a linear model;
with one of them it is exact as well.

Each pair of opposite sigma points splits into an odd part, which is linear (the sensitivity), and
an even part, which is curvature (`tempering` says what for). Only the columns of the Cholesky
factor that move depth, velocity or parameters need the contact law, and those that move parameters
alone share two logarithms.
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.contact.registry import ADHESIVE, HUNT_CROSSLEY, contact_force
from hc_estimator.contact.registry import (
    LARGEST_DISPLACEMENT_EXPONENT as LARGEST_N,
)
from hc_estimator.contact.registry import (
    LARGEST_VELOCITY_EXPONENT as LARGEST_P,
)
from hc_estimator.contact.registry import (
    SMALLEST_DISPLACEMENT_EXPONENT as SMALLEST_N,
)
from hc_estimator.contact.registry import (
    SMALLEST_VELOCITY_EXPONENT as SMALLEST_P,
)
from hc_estimator.multiple_model import levels
from hc_estimator.multiple_model.hypotheses import (
    ACCELERATION,
    COUNTS,
    DEPTH,
    DRIVEN,
    DRIVES,
    EXPONENT,
    FIRST_PARAMETER,
    LAST_PARAMETER,
    LOG_DAMPING,
    LOG_STIFFNESS,
    OWN,
    OWN_WALKS,
    SURFACE,
    VELOCITY,
    VELOCITY_EXPONENT,
    WALKS,
)
from hc_estimator.multiple_model.levels import UNBENT

TINY = 1e-300
LARGEST_LOG = 300.0  # of a force; beyond it exp() would not be finite when squared
CENTRAL_WEIGHT = 2.0  # of the central point in covariances: alpha = 1, beta = 2, kappa = 0
# Which parameters an update only considers (Schmidt), instead of correcting them.
HOLD_NOTHING = 0
HOLD_ALL = 1
HOLD_DAMPING = 2  # B and p
SURE = 10.0  # deviations of a force from which on its logarithm is about normal
UNKNOWN_SHARE = 0.5  # of the reading, as the deviation of what was expected
LEAST_SHARE = 1e-6  # of the reading that every sigma point must have for its logarithm
PIVOT_TOLERANCE = 1e-15  # a pivot this much smaller than its element is rounding error


@compiled
def force_of(
    settings: Any, depth: float, velocity: float, k: float, b: float, n: float, p: float
) -> float:
    """Force [N] of the contact law; k and b are ln K and ln B."""
    stiffness = math.exp(min(max(k, -LARGEST_LOG), LARGEST_LOG))
    damping = math.exp(min(max(b, -LARGEST_LOG), LARGEST_LOG))
    return contact_force(settings.contact_model, depth, velocity, stiffness, damping, n, p)


@compiled
def log_speed_of(row: Any, log_speed: float) -> float:
    """The given one where K and B can both be learnt; else each stands for itself."""
    free = row.covariance[LOG_STIFFNESS, LOG_STIFFNESS] > 0.0
    free = free and row.covariance[LOG_DAMPING, LOG_DAMPING] > 0.0
    return log_speed if free else UNBENT


@compiled
def force_of_row(settings: Any, row: Any, ahead: float) -> float:
    """Force [N] that the row expects some time [s] after its state."""
    state = row.state
    depth = displacement_of(row, ahead)
    velocity = state[VELOCITY] + ahead * state[ACCELERATION]
    if SURFACE[row.index]:
        depth -= state[OWN] + ahead * state[OWN + 1]
        velocity -= state[OWN + 1]
    return force_of(
        settings,
        depth,
        velocity,
        state[LOG_STIFFNESS],
        state[LOG_DAMPING],
        state[EXPONENT],
        state[VELOCITY_EXPONENT],
    )


@compiled
def displacement_of(row: Any, ahead: float) -> float:
    """Displacement [mm] that the row expects some time [s] after its state."""
    state = row.state
    return state[DEPTH] + ahead * (state[VELOCITY] + 0.5 * ahead * state[ACCELERATION])  # type: ignore[no-any-return]


@compiled
def depth_of(row: Any) -> float:
    """Depth of the tool in the tissue [mm]."""
    surface = row.state[OWN] if SURFACE[row.index] else 0.0
    return row.state[DEPTH] - surface  # type: ignore[no-any-return]


@compiled
def predict(row: Any, elapsed: float, density: float, goes_on: bool) -> None:
    """Constant acceleration with white jerk; parameters that walk or follow the own states.

    Args:
        row: state and covariance are changed.
        elapsed: time [s].
        density: of the jerk [mm^2/s^5].
        goes_on: True if the parameters may change, False far from the tissue.
    """
    state, covariance, m = row.state, row.covariance, row.index
    count = COUNTS[m]
    half = 0.5 * elapsed * elapsed
    state[DEPTH] += elapsed * state[VELOCITY] + half * state[ACCELERATION]
    state[VELOCITY] += elapsed * state[ACCELERATION]
    for j in range(count):
        third = covariance[ACCELERATION, j]
        covariance[DEPTH, j] += elapsed * covariance[VELOCITY, j] + half * third
        covariance[VELOCITY, j] += elapsed * third
    for i in range(count):
        third = covariance[i, ACCELERATION]
        covariance[i, DEPTH] += elapsed * covariance[i, VELOCITY] + half * third
        covariance[i, VELOCITY] += elapsed * third
    noise = density * elapsed
    covariance[ACCELERATION, ACCELERATION] += noise
    noise *= elapsed
    covariance[VELOCITY, ACCELERATION] += noise / 2.0
    covariance[ACCELERATION, VELOCITY] += noise / 2.0
    noise *= elapsed
    covariance[DEPTH, ACCELERATION] += noise / 6.0
    covariance[ACCELERATION, DEPTH] += noise / 6.0
    covariance[VELOCITY, VELOCITY] += noise / 3.0
    noise *= elapsed
    covariance[DEPTH, VELOCITY] += noise / 8.0
    covariance[VELOCITY, DEPTH] += noise / 8.0
    noise *= elapsed
    covariance[DEPTH, DEPTH] += noise / 20.0
    if not goes_on:
        return
    for own in range(count - OWN):
        for k in range(DRIVEN):
            rate = DRIVES[m, own, k] * elapsed
            if rate == 0.0:
                continue
            source, target = OWN + own, FIRST_PARAMETER + k if k < DRIVEN - 1 else OWN
            state[target] += rate * state[source]
            for j in range(count):
                covariance[target, j] += rate * covariance[source, j]
            for i in range(count):
                covariance[i, target] += rate * covariance[i, source]
        if covariance[OWN + own, OWN + own] > 0.0:
            covariance[OWN + own, OWN + own] += OWN_WALKS[m, own] * elapsed
    for i in range(4):
        if covariance[FIRST_PARAMETER + i, FIRST_PARAMETER + i] > 0.0:  # else held fixed
            covariance[FIRST_PARAMETER + i, FIRST_PARAMETER + i] += WALKS[m, i] * elapsed


@compiled
def use_displacement(
    row: Any, reading: float, offset: float, noise: float, hold: int, log_speed: float
) -> None:
    """Kalman update with a displacement.

    Args:
        row: changed; innovation, its variance and its normalised square are noted.
        reading: [mm].
        offset: by how much later than the state it was taken [s].
        noise: its variance [mm^2].
        hold: which parameters are only considered.
        log_speed: see `levels`.
    """
    covariance, gain = row.covariance, row.sensitivity
    count = COUNTS[row.index]
    half = 0.5 * offset * offset
    predicted = displacement_of(row, offset)
    for i in range(count):
        gain[i] = (
            covariance[i, DEPTH]
            + offset * covariance[i, VELOCITY]
            + half * covariance[i, ACCELERATION]
        )
    variance = gain[DEPTH] + offset * gain[VELOCITY] + half * gain[ACCELERATION] + noise
    innovation = reading - predicted
    row.innovation[0] = innovation
    row.innovation_variance[0] = variance
    row.nis[0] = innovation * innovation / variance
    _apply(row, gain, innovation, variance, hold, log_speed)


@compiled
def _is_held(i: int, hold: int) -> bool:
    """True if a state is only considered."""
    if hold == HOLD_DAMPING:
        return i in (LOG_DAMPING, VELOCITY_EXPONENT)
    return FIRST_PARAMETER <= i < LAST_PARAMETER or i >= OWN


@compiled
def _apply(
    row: Any,
    covariance_column: Any,
    innovation: float,
    variance: float,
    hold: int,
    log_speed: float,
) -> None:
    """State and covariance after a scalar update.

    Args:
        row: changed.
        covariance_column: covariance of the state with the measurement, shape (STATES,).
        innovation: measured minus predicted.
        variance: of the innovation.
        hold: which parameters are only considered; the covariance is that of the reduced gain K',
            P - K' c^T - c K'^T + K' S K'^T.
        log_speed: see `levels`.
    """
    state, covariance, column = row.state, row.covariance, covariance_column
    count = COUNTS[row.index]
    inverse = 1.0 / variance
    if hold == HOLD_NOTHING:
        scaled = innovation * inverse
        log_speed = log_speed_of(row, log_speed)
        k, b, p = state[LOG_STIFFNESS], state[LOG_DAMPING], state[VELOCITY_EXPONENT]
        for i in range(count):
            state[i] += column[i] * scaled
            gain = column[i] * inverse
            for j in range(i + 1):
                element = covariance[i, j] - gain * column[j]
                covariance[i, j] = element
                covariance[j, i] = element
        if log_speed > UNBENT:
            levels.follow(row, k, b, p, log_speed)
        return
    for i in range(count):
        held_i = _is_held(i, hold)
        if not held_i:
            state[i] += column[i] * innovation * inverse
        for j in range(i + 1):
            if held_i and _is_held(j, hold):
                continue
            # Where either gain is the full one, all four terms come to one.
            element = covariance[i, j] - column[i] * column[j] * inverse
            covariance[i, j] = element
            covariance[j, i] = element


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
        False if the covariance has no Cholesky factor; the row is then lost.
    """
    count = COUNTS[row.index]
    if not _factorise(row.covariance, row.factor, count):
        return False
    state, factor, sensitivity = row.state, row.factor, row.sensitivity
    surface = SURFACE[row.index]
    plain = settings.contact_model == HUNT_CROSSLEY or settings.contact_model == ADHESIVE
    scale = float(count)
    spread = math.sqrt(scale)
    depth, velocity = state[DEPTH], state[VELOCITY]
    if surface:
        depth -= state[OWN]
        velocity -= state[OWN + 1]
    k, b, n, p = state[2], state[3], state[4], state[5]
    log_speed = log_speed_of(row, log_speed)
    share = levels.share_of_damping(k, b, p, log_speed)
    touching = depth > TINY
    log_depth = math.log(depth) if touching else 0.0
    speed = abs(velocity)
    log_velocity = math.log(speed) if speed > TINY else math.log(TINY)
    sign = 1.0 if velocity > 0.0 else -1.0
    least = -math.inf if settings.contact_model == ADHESIVE else 0.0
    centre = force_of(settings, depth, velocity, k, b, n, p)
    total = 0.0
    squares = 0.0
    for j in range(count):
        move_depth = spread * factor[DEPTH, j] if j == 0 else 0.0
        move_velocity = spread * factor[VELOCITY, j] if j <= VELOCITY else 0.0
        if surface:
            if j <= OWN:
                move_depth -= spread * factor[OWN, j]
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
        k_plus, b_plus = levels.moved(k, b, p, move_k, move_b, move_p, share, log_speed)
        k_minus, b_minus = levels.moved(k, b, p, -move_k, -move_b, -move_p, share, log_speed)
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
                plus = max(plus, least)
                minus = max(minus, least)
        else:
            above, below = depth + move_depth, depth - move_depth
            faster, slower = velocity + move_velocity, velocity - move_velocity
            plus = force_of(settings, above, faster, k_plus, b_plus, n_plus, p_plus)
            minus = force_of(settings, below, slower, k_minus, b_minus, n_minus, p_minus)
        row.sigma_force[j, 0] = plus
        row.sigma_force[j, 1] = minus
        sensitivity[j] = 0.5 * (plus - minus) / spread
        even = 0.5 * (plus + minus) - centre
        total += even
        squares += even * even
    bend = total / scale  # of the mean against the central point
    _note_expected(row, centre + bend, _curvature(squares, total, bend, count))
    unknown = row.explained > UNKNOWN_SHARE**2 * reading * reading
    if unknown and reading > SURE * math.sqrt(noise):
        _foresee_logarithm(row, centre, reading)
    return bool(math.isfinite(row.explained))


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
def _parametric_force(
    log_depth: float, log_speed: float, sign: float, k: float, b: float, n: float, p: float
) -> float:
    """Hunt-Crossley force, tension allowed, from the logarithms of depth and speed."""
    n = min(max(n, SMALLEST_N), LARGEST_N)
    p = min(max(p, SMALLEST_P), LARGEST_P)
    power = n * log_depth
    elastic = math.exp(min(k + power, LARGEST_LOG))
    return elastic + sign * math.exp(min(b + power + p * log_speed, LARGEST_LOG))


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


@compiled
def innovate_force(row: Any, reading: float, noise: float) -> None:
    """Innovation of the force, after `foresee_force`; `noise` is its variance [N^2]."""
    row.innovation[1] += reading
    row.force_noise = noise
    variance = row.explained + noise
    row.innovation_variance[1] = variance
    row.nis[1] = row.innovation[1] * row.innovation[1] / variance


@compiled
def use_force(row: Any, hold: int, log_speed: float) -> None:
    """Update with the force whose innovation is noted; the rest as in `use_displacement`."""
    count = COUNTS[row.index]
    factor, sensitivity = row.factor, row.sensitivity
    for i in range(count - 1, -1, -1):  # c = L s, in place from the bottom
        total = 0.0
        for j in range(i + 1):
            total += factor[i, j] * sensitivity[j]
        sensitivity[i] = total
    _apply(row, sensitivity, row.innovation[1], row.innovation_variance[1], hold, log_speed)
