"""One row's Kalman filter: prediction, and an update with one reading at a time.

The displacement is a linear function of the state and comes first, by the plain Kalman update. The
force comes after it; what is expected of it is for `unscented` to say. With both readings this is
the joint update of a linear model; with one of them it is exact as well.
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.contact.registry import contact_force
from hc_estimator.multiple_model import delay_sensitivity, levels
from hc_estimator.multiple_model.hypotheses import (
    ACCELERATION,
    BIASED,
    BREATHES,
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
RATE_MEMORY = 0.3  # for which a rate goes on where the tissue is not felt [s]
BREATH_MEMORY = 1.0  # the same of a surface that turns: a quarter of a breath [s]
FASTEST_SINKING = 0.3  # from which on a surface breathes [mm/s]; see `spline_prior`
# Which parameters an update only considers (Schmidt), instead of correcting them.
HOLD_NOTHING = 0
HOLD_ALL = 1
HOLD_DAMPING = 2  # B and p
HOLD_TISSUE = 3  # all, but not where the surface is


@compiled
def force_of(
    settings: Any, depth: float, velocity: float, k: float, b: float, n: float, p: float
) -> float:
    """Force [N] of the contact law; k and b are ln K and ln B."""
    stiffness, damping = exp_limited(k), exp_limited(b)
    return contact_force(settings.contact_model, depth, velocity, stiffness, damping, n, p)


@compiled
def exp_limited(logarithm: float) -> float:
    """K or B of its logarithm, finite."""
    return math.exp(min(max(logarithm, -LARGEST_LOG), LARGEST_LOG))


@compiled
def probability(log_odds: float) -> float:
    """Probability of what is likelier by such a logarithm of odds."""
    return 1.0 / (1.0 + exp_limited(-log_odds))


@compiled
def force_at(settings: Any, row: Any, depth: float, velocity: float) -> float:
    """Force [N] that a row's parameters give at a depth and a velocity."""
    state = row.state
    k, b, n, p = state[LOG_STIFFNESS], state[LOG_DAMPING], state[EXPONENT], state[VELOCITY_EXPONENT]
    return force_of(settings, depth, velocity, k, b, n, p)


@compiled
def log_speed_of(row: Any, log_speed: float) -> float:
    """The given one where K and B can both be learnt; else each stands for itself."""
    free = row.covariance[LOG_STIFFNESS, LOG_STIFFNESS] > 0.0
    free = free and row.covariance[LOG_DAMPING, LOG_DAMPING] > 0.0
    return log_speed if free else UNBENT


@compiled
def log_force_variance(row: Any, log_depth: float) -> float:
    """Variance of the logarithm of the elastic force, ln K + n ln d, at a depth's logarithm."""
    covariance = row.covariance
    return covariance[LOG_STIFFNESS, LOG_STIFFNESS] + log_depth * (  # type: ignore[no-any-return]
        2.0 * covariance[LOG_STIFFNESS, EXPONENT] + log_depth * covariance[EXPONENT, EXPONENT]
    )


@compiled
def squares_left(settings: Any, points: Any, first: int, last: int, row: Any) -> float:
    """Sum of squares [N^2] that a row's law leaves of points, on a surface that stays.

    Args:
        settings: settings record.
        points: ring, of `history`.
        first: number of the first.
        last: number of the one after the last.
        row: whose parameters they are.
    """
    total = 0.0
    for i in range(first, last):
        point = points[i % points.shape[0]]
        error = point.force - force_at(settings, row, point.depth, point.velocity)
        total += error * error
    return total


@compiled
def squared_forces(points: Any, first: int, last: int) -> float:
    """Sum of the squared forces [N^2] of such points."""
    total = 0.0
    for i in range(first, last):
        force = points[i % points.shape[0]].force
        total += force * force
    return total


@compiled
def force_of_row(settings: Any, row: Any, ahead: float) -> float:
    """Force [N] that the row expects some time [s] after its state."""
    state = row.state
    depth = displacement_of(row, ahead)
    velocity = state[VELOCITY] + ahead * state[ACCELERATION]
    if SURFACE[row.index]:
        depth -= state[OWN] + ahead * state[OWN + 1]
        velocity -= state[OWN + 1]
    return force_at(settings, row, depth, velocity)


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
def _forget_rates(row: Any, kept: float) -> None:
    """Rates come to rest: what is not felt does not say how it goes on."""
    for i in range(OWN, COUNTS[row.index]):
        row.state[i] *= kept
        row.by_delay[i] *= kept
        for j in range(COUNTS[row.index]):
            row.covariance[i, j] *= kept
            row.covariance[j, i] *= kept


@compiled
def let_stiffness_vary(row: Any, variance: float) -> None:
    """Let ln K and ln B, which follows it, be less known by a variance."""
    for i in (LOG_STIFFNESS, LOG_DAMPING):
        for j in (LOG_STIFFNESS, LOG_DAMPING):
            if row.covariance[i, i] > 0.0 and row.covariance[j, j] > 0.0:  # else held fixed
                row.covariance[i, j] += variance


@compiled
def predict(row: Any, elapsed: float, density: float, goes_on: bool, away: bool) -> None:
    """Constant acceleration with white jerk; parameters that walk or follow the own states.

    Args:
        row: state and covariance are changed.
        elapsed: time [s].
        density: of the jerk [mm^2/s^5].
        goes_on: True if the parameters may change, False far from the tissue.
        away: True if the tissue is not felt.
    """
    state, covariance, m = row.state, row.covariance, row.index
    count = COUNTS[m]
    delay_sensitivity.predict(row, elapsed, goes_on)
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
            if target != OWN and covariance[target, target] == 0.0:
                continue  # held fixed
            if not away or target == OWN:  # what is not felt goes on nowhere, as far as is known
                state[target] += rate * state[source]
            for j in range(count):
                covariance[target, j] += rate * covariance[source, j]
            for i in range(count):
                covariance[i, target] += rate * covariance[i, source]
        if covariance[OWN + own, OWN + own] > 0.0:
            covariance[OWN + own, OWN + own] += OWN_WALKS[m, own] * elapsed
    if away and not SURFACE[m] and not BIASED[m]:
        _forget_rates(row, math.exp(-elapsed / RATE_MEMORY))
    elif away and BREATHES[m] and abs(state[OWN + 1]) > FASTEST_SINKING:
        # What breathes may have turned; its variance goes on growing.
        state[OWN + 1] *= math.exp(-elapsed / BREATH_MEMORY)
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
    known = gain[DEPTH] + offset * gain[VELOCITY] + half * gain[ACCELERATION]
    variance = max(known, 0.0) + noise  # rounding may take more than there is
    innovation = reading - predicted
    row.innovation[0] = innovation
    row.innovation_variance[0] = variance
    row.nis[0] = innovation * innovation / variance
    by_delay = delay_sensitivity.of_displacement(row, offset)
    _apply(row, gain, innovation, variance, by_delay, hold, log_speed)


@compiled
def _is_held(i: int, hold: int) -> bool:
    """True if a state is only considered."""
    if hold == HOLD_DAMPING:
        return i in (LOG_DAMPING, VELOCITY_EXPONENT)
    if hold == HOLD_TISSUE:
        return FIRST_PARAMETER <= i < LAST_PARAMETER or i >= OWN + 2
    return FIRST_PARAMETER <= i < LAST_PARAMETER or i >= OWN


@compiled
def _apply(
    row: Any,
    covariance_column: Any,
    innovation: float,
    variance: float,
    by_delay: float,
    hold: int,
    log_speed: float,
) -> None:
    """State and covariance after a scalar update.

    Args:
        row: changed.
        covariance_column: covariance of the state with the measurement, shape (STATES,).
        innovation: measured minus predicted.
        variance: of the innovation.
        by_delay: derivative of the innovation by the error of the delay [1/s].
        hold: which parameters are only considered; the covariance is that of the reduced gain K',
            P - K' c^T - c K'^T + K' S K'^T.
        log_speed: see `levels`.
    """
    state, covariance, column = row.state, row.covariance, covariance_column
    count = COUNTS[row.index]
    inverse = 1.0 / variance
    if hold == HOLD_NOTHING:
        scaled = innovation * inverse
        row.delay_score -= scaled * by_delay
        row.delay_information += by_delay * by_delay * inverse
        log_speed = log_speed_of(row, log_speed)
        k, b, p = state[LOG_STIFFNESS], state[LOG_DAMPING], state[VELOCITY_EXPONENT]
        before = levels.log_ratio_by_delay(row, log_speed) if log_speed > UNBENT else 0.0
        for i in range(count):
            state[i] += column[i] * scaled
            gain = column[i] * inverse
            row.by_delay[i] += gain * by_delay
            for j in range(i + 1):
                element = covariance[i, j] - gain * column[j]
                covariance[i, j] = element
                covariance[j, i] = element
        if log_speed > UNBENT:
            levels.follow(row, k, b, p, before, log_speed)
        return
    for i in range(count):
        held_i = _is_held(i, hold)
        if not held_i:
            state[i] += column[i] * innovation * inverse
            row.by_delay[i] += column[i] * inverse * by_delay
        for j in range(i + 1):
            if held_i and _is_held(j, hold):
                continue
            # Where either gain is the full one, all four terms come to one.
            element = covariance[i, j] - column[i] * column[j] * inverse
            covariance[i, j] = element
            covariance[j, i] = element


@compiled
def use_depth(row: Any, depth: float, variance: float) -> None:
    """Update tool and surface, which may move, with a depth [mm] of known variance [mm^2]."""
    covariance, column = row.covariance, row.sensitivity
    for i in range(COUNTS[row.index]):
        column[i] = covariance[i, DEPTH] - covariance[i, OWN]
    known = max(column[DEPTH] - column[OWN], 0.0) + variance
    by_delay = row.by_delay[OWN] - row.by_delay[DEPTH]
    _apply(row, column, depth - depth_of(row), known, by_delay, HOLD_TISSUE, UNBENT)


@compiled
def innovate_force(row: Any, reading: float, noise: float) -> None:
    """Innovation of the force, after `foresee_force`; `noise` is its variance [N^2]."""
    row.innovation[1] += reading
    row.force_noise = noise
    variance = row.explained + noise
    row.innovation_variance[1] = variance
    row.nis[1] = row.innovation[1] * row.innovation[1] / variance


@compiled
def innovate_nothing(row: Any, reading: float, noise: float) -> None:
    """Innovation of a force that is expected to be none, of the sensor's variance [N^2]."""
    row.explained = 0.0
    row.force_noise = noise
    row.innovation[1] = reading
    row.innovation_variance[1] = noise
    row.nis[1] = reading * reading / noise


@compiled
def use_force(row: Any, hold: int, log_speed: float) -> None:
    """Update with the force whose innovation is noted; the rest as in `use_displacement`."""
    count = COUNTS[row.index]
    factor, sensitivity = row.factor, row.sensitivity
    by_delay = delay_sensitivity.of_force(row)
    for i in range(count - 1, -1, -1):  # c = L s, in place from the bottom
        total = 0.0
        for j in range(i + 1):
            total += factor[i, j] * sensitivity[j]
        sensitivity[i] = total
    innovation, variance = row.innovation[1], row.innovation_variance[1]
    _apply(row, sensitivity, innovation, variance, by_delay, hold, log_speed)
