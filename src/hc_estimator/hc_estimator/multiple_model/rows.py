"""Beginning a hypothesis: from the prior, from another one, or with its motion alone anew.

Start, recovery and restart all go through `reset`.
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.adaptation import motion_density
from hc_estimator.compilation import compiled
from hc_estimator.contact.registry import fixed_value
from hc_estimator.linear_algebra import clear_matrix, clear_vector
from hc_estimator.multiple_model import delay_sensitivity
from hc_estimator.multiple_model.hypotheses import (
    ACCELERATION,
    BIASED,
    COUNTS,
    DEPTH,
    LOG_DAMPING,
    LOG_STIFFNESS,
    OWN,
    OWN_VARIANCES,
    STATES,
    SURFACE,
    VELOCITY,
)
from hc_estimator.multiple_model.kalman import predict

MOTION = (DEPTH, VELOCITY, ACCELERATION)
# Limits of the estimate, inside which the contact law means something.
LARGEST_LOG_STIFFNESS = 16.0
# B beyond these multiples of K is no tissue; far below, the force says nothing of ln B any more.
SMALLEST_LOG_RATIO = -14.0
LARGEST_LOG_RATIO = 3.0
SMALLEST_EXPONENT, LARGEST_EXPONENT = 0.6, 4.0
SMALLEST_VELOCITY_EXPONENT, LARGEST_VELOCITY_EXPONENT = 0.4, 2.0
LARGEST_RATE = 20.0  # of an own state that drives a parameter [1/s]
TURNED_RATE = 1.0  # deviation of a rate of ln K that has turned [1/s]
WILD = 100.0  # ln K beyond which a row is limited even after a refused force
LARGEST_SOUND = 1e100  # beyond it a number is no estimate


@compiled
def prior_deviation(settings: Any, parameter: int) -> float:
    """Standard deviation of the first guess of ln K, ln B, n or p (0 to 3); 0 holds it fixed."""
    if not math.isnan(fixed_value(settings.contact_model, parameter)):
        return 0.0
    if parameter == 0:
        return settings.initial_stiffness_log_std  # type: ignore[no-any-return]
    if parameter == 1:
        return settings.initial_damping_log_std  # type: ignore[no-any-return]
    if parameter == 2:
        return settings.initial_displacement_exponent_std  # type: ignore[no-any-return]
    return settings.initial_velocity_exponent_std  # type: ignore[no-any-return]


@compiled
def is_held(settings: Any, parameter: int) -> bool:
    """True if K, B, n or p (0 to 3) is held fixed: by the law, or by a deviation of 0."""
    return bool(prior_deviation(settings, parameter) <= 0.0)


@compiled
def guess_of(settings: Any, parameter: int) -> float:
    """First guess of ln K, ln B, n or p (0 to 3)."""
    if parameter == 0:
        return math.log(settings.initial_stiffness)
    if parameter == 1:
        return math.log(settings.initial_damping)
    if parameter == 2:
        return settings.initial_displacement_exponent  # type: ignore[no-any-return]
    return settings.initial_velocity_exponent  # type: ignore[no-any-return]


@compiled
def clear_adaptation(row: Any) -> None:
    """Forget what was learnt of the row's innovations."""
    row.model_error = 0.0
    row.alarm_sum = 0.0
    row.alarm_position = 0
    row.alarm = 0
    clear_matrix(row.alarm_line)
    row.contact_time = 0.0
    row.recent_nis = 2.0
    row.score = 0.0
    row.claimed = 0.0
    row.log_likelihood = 0.0
    row.inconsistent_time = 0.0
    row.alarmed = 0
    row.change_lead = 0.0
    delay_sensitivity.forget_evidence(row)


@compiled
def cut(row: Any, i: int) -> None:
    """Take from a state its variance and its ties to the others."""
    for j in range(STATES):
        row.covariance[i, j] = 0.0
        row.covariance[j, i] = 0.0


@compiled
def begin_own_states(row: Any) -> None:
    """Own states at their start, without ties to the others."""
    delay_sensitivity.clear(row, OWN, STATES)
    for i in range(OWN, STATES):
        row.state[i] = 0.0
        cut(row, i)
        row.covariance[i, i] = OWN_VARIANCES[row.index, i - OWN]
    if SURFACE[row.index] and row.position_deviation > 0.0:
        row.covariance[OWN, OWN] = row.position_deviation**2
        row.covariance[OWN + 1, OWN + 1] = 0.0


@compiled
def let_surface_move(row: Any) -> None:
    """What a contact position that stays does not explain may be one that moves."""
    row.position_deviation = 0.0
    rate = OWN + 1
    row.covariance[rate, rate] = OWN_VARIANCES[row.index, rate - OWN]


@compiled
def free_rate(row: Any) -> None:
    """Let the rate of ln K go, if the row has one: it may have turned."""
    if COUNTS[row.index] > OWN and not (SURFACE[row.index] or BIASED[row.index]):
        row.covariance[OWN, OWN] = max(row.covariance[OWN, OWN], TURNED_RATE**2)


@compiled
def clear_motion(row: Any) -> None:
    """Zero the motion's variances and its ties to everything else."""
    for i in MOTION:
        row.by_delay[i] = 0.0  # it is what the displacement alone says
        cut(row, i)


@compiled
def begin_motion(settings: Any, row: Any, displacement: float) -> None:
    """Forget the motion: mean at a reading and at rest, wide covariance."""
    clear_motion(row)
    for i in MOTION:
        row.state[i] = 0.0
    row.state[DEPTH] = displacement
    row.covariance[DEPTH, DEPTH] = settings.initial_displacement_std**2
    row.covariance[VELOCITY, VELOCITY] = settings.initial_velocity_std**2
    row.covariance[ACCELERATION, ACCELERATION] = settings.initial_acceleration_std**2


@compiled
def reset(settings: Any, row: Any, displacement: float) -> None:
    """Begin from the prior, with the tool at a displacement [mm]."""
    clear_vector(row.by_delay)
    clear_matrix(row.covariance)
    for i in range(4):
        row.state[LOG_STIFFNESS + i] = guess_of(settings, i)
        row.covariance[LOG_STIFFNESS + i, LOG_STIFFNESS + i] = prior_deviation(settings, i) ** 2
    begin_own_states(row)
    begin_motion(settings, row, displacement)
    row.predicted_force = 0.0
    row.since = -1.0
    row.counts_from = 0.0
    row.contradiction = 0.0
    clear_adaptation(row)


@compiled
def seed(source: Any, row: Any, since: float, counts_from: float) -> None:
    """Give a row the motion and the parameters of another, and its own states their start.

    Args:
        source: row to take from.
        row: row that is changed.
        since: contact clock [s] from which on what the row says is its own.
        counts_from: contact clock [s] from which on it may be chosen.
    """
    for i in range(OWN):
        row.state[i] = source.state[i]
        for j in range(OWN):
            row.covariance[i, j] = source.covariance[i, j]
    delay_sensitivity.take(source, row, 0, OWN)
    begin_own_states(row)
    row.predicted_force = source.predicted_force
    contact_time, model_error = source.contact_time, source.model_error
    clear_adaptation(row)
    row.contact_time = contact_time
    row.model_error = model_error
    row.since = since
    row.counts_from = counts_from
    row.contradiction = 0.0


@compiled
def free_damping(settings: Any, row: Any, deviation: float) -> None:
    """Let ln B go by so much more; what the law leaves may have been for lack of that."""
    row.model_error = 0.0
    if not is_held(settings, 1):
        row.covariance[LOG_DAMPING, LOG_DAMPING] += deviation * deviation


@compiled
def free_parameters(settings: Any, row: Any, deviations: tuple[float, float, float, float]) -> None:
    """Let the parameters go: their mean stays, their deviations are the given ones."""
    for i in range(4):
        k = LOG_STIFFNESS + i
        cut(row, k)
        if not is_held(settings, i):
            row.covariance[k, k] = deviations[i] ** 2


@compiled
def take_motion(settings: Any, row: Any, motion: Any, noise: float, ahead: float) -> None:
    """Replace the motion by what the displacement alone says.

    Args:
        settings: settings record.
        row: row that is changed; ties between motion and parameters are cut.
        motion: record of `motion_density`, settled.
        noise: variance of the displacement's noise [mm^2].
        ahead: time of the row's state since the last displacement [s].
    """
    clear_motion(row)
    for a in range(3):
        row.state[MOTION[a]] = motion_density.motion_of(motion, a)
        for b in range(3):
            row.covariance[MOTION[a], MOTION[b]] = motion_density.covariance_of(motion, a, b, noise)
    density = motion_density.jerk_density(settings, motion)
    predict(row, max(ahead, 0.0), density, False, True)


@compiled
def _keep(row: Any, i: int, low: float, high: float) -> None:
    """Keep a state between two limits; at a limit it does not depend on the delay."""
    if not low <= row.state[i] <= high:
        row.state[i] = min(max(row.state[i], low), high)
        row.by_delay[i] = 0.0


@compiled
def _keep_parameter(settings: Any, row: Any, i: int, low: float, high: float) -> None:
    """The same of ln K, n or p (0, 2, 3); what is held fixed stays where it was given."""
    if is_held(settings, i):
        row.state[LOG_STIFFNESS + i] = guess_of(settings, i)
    else:
        _keep(row, LOG_STIFFNESS + i, low, high)


@compiled
def limit(settings: Any, row: Any) -> None:
    """Keep the mean of the parameters where the contact law means something."""
    state = row.state
    _keep_parameter(settings, row, 0, -LARGEST_LOG_STIFFNESS, LARGEST_LOG_STIFFNESS)
    if not is_held(settings, 1):
        ratio = state[LOG_DAMPING] - state[LOG_STIFFNESS]
        if not SMALLEST_LOG_RATIO <= ratio <= LARGEST_LOG_RATIO:
            ratio = min(max(ratio, SMALLEST_LOG_RATIO), LARGEST_LOG_RATIO)
            state[LOG_DAMPING] = state[LOG_STIFFNESS] + ratio
            row.by_delay[LOG_DAMPING] = row.by_delay[LOG_STIFFNESS]
    else:
        state[LOG_DAMPING] = guess_of(settings, 1)
    _keep_parameter(settings, row, 2, SMALLEST_EXPONENT, LARGEST_EXPONENT)
    _keep_parameter(settings, row, 3, SMALLEST_VELOCITY_EXPONENT, LARGEST_VELOCITY_EXPONENT)
    for i in range(OWN, OWN if BIASED[row.index] else COUNTS[row.index]):
        _keep(row, i, -LARGEST_RATE, LARGEST_RATE)


@compiled
def limit_wild(settings: Any, rows: Any) -> None:
    """Keep rows numbers that only a displacement has moved: the next force limits the others."""
    for m in range(rows.shape[0]):
        row = rows[m]
        if row.active != 0 and not abs(row.state[LOG_STIFFNESS]) <= WILD:
            limit(settings, row)


@compiled
def is_sound(row: Any) -> bool:
    """True if every number of the row is one, and every variance positive or zero."""
    total = 0.0
    for i in range(COUNTS[row.index]):
        if not row.covariance[i, i] >= 0.0:
            return False
        total += abs(row.state[i]) + row.covariance[i, i]
    return total < LARGEST_SOUND
