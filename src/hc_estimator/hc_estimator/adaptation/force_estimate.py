"""The contact force given everything: what `self_tuning_ukf` reports as reconstructed force.

The contact law at the updated state is the right answer while the law fits and its parameters are
known. With few samples, after the tool turned, or with a law that does not fit, it is not, and the
force sensor knows better. The mean of the force given both readings weighs one against the other
by what is known of their errors, as the output of a Kalman filter:

    F = h(x) + [H P H_d^T, H P H^T + M] S^-1 innovation,    S = H' P H'^T + diag(R_d, M + R)

with the law h and its derivative H at the predicted state x, the displacement's derivative H_d, the
variance M of the misfit and the sensors' R_d and R. For a law that fits, and a filter that uses the
reading as it stands, this is the law at the updated state, to first order. What only the learning
of the parameters needs (`linearisation` and `manoeuvre` count an error that repeats itself many
times over) is left out: the force of this moment has that error once. In the very first samples
the law's force is that of a first guess and says nothing; the force felt last, carried on by the
ratio in which the law changes, says more.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hc_estimator.adaptation import difference_noise, manoeuvre
from hc_estimator.compilation import compiled
from hc_estimator.linear_algebra import copy_vector
from hc_estimator.state_space import registry as state_space

EARLY = 64  # remembered samples up to which the law's own force is that of a first guess
AS_IT_STANDS = 1.1  # force noise over the sensor's, up to which the reading is used as it stands
DEVIATIONS = 3.0  # by which a reading is not what was foreseen
DOUBT_TIME = 1.0  # time constant of their share [s]
OFTEN_OFF = 0.5  # share from which on the law does not fit

FIELDS = (  # of the last sample
    ("followed", np.int64, ()),  # 1 if its force may be carried on
    ("followed_force", np.float64, ()),  # [N]
    ("followed_variance", np.float64, ()),  # of that [N^2]
    ("followed_point", np.float64, (2,)),  # displacement, velocity
    ("told_off", np.float64, ()),  # share of the samples that the fit has not foreseen
)
SCRATCH = (("given_force", np.float64, ()),)  # of the sample [N]


@compiled
def _sensor_noise(memory: Any) -> float:
    """Variance of one force reading [N^2], as far as it is known."""
    if memory.calibrated == 0 and memory.difference_count[1] > 0:
        return difference_noise.cautious(memory, 1)
    return memory.sensor_noise[1]  # type: ignore[no-any-return]


@compiled
def _weigh(memory: Any, force: float, cross: float, variance: float) -> None:
    """Mean of the force given both readings, in memory.given_force.

    Args:
        memory: memory record after the innovation.
        force: predicted by the law [N].
        cross: covariance of the law's force with the predicted displacement [N mm].
        variance: of the force, misfit included [N^2].
    """
    memory.given_force = force
    sensor, s00 = _sensor_noise(memory), memory.innovation_covariance[0, 0]
    determinant = s00 * (variance + sensor) - cross * cross
    if not determinant > 0.0:
        return
    first = cross * sensor / determinant
    second = (variance * s00 - cross * cross) / determinant
    given = force + first * memory.innovation[0] + second * (memory.measurement[1] - force)
    if math.isfinite(given):
        memory.given_force = given


@compiled
def restart(memory: Any) -> None:
    """Nothing was felt of this tissue yet."""
    memory.followed = 0
    memory.told_off = 0.0


@compiled
def find(settings: Any, memory: Any) -> None:
    """The force by the filter's own parameters; from the innovation of the sample."""
    early = memory.known == 0 and memory.history_count < EARLY
    as_it_stands = memory.measurement_noise[1] < AS_IT_STANDS * memory.sensor_noise[1]
    if as_it_stands and not early and not manoeuvre.is_turning(memory):
        memory.given_force = state_space.force_of_state(settings, memory.updated_state)
        return
    state, jacobian = memory.predicted_state, memory.measurement_jacobian
    force = state_space.force_of_state(settings, state)
    state_space.measurement_jacobian(settings, state, memory.gradient, jacobian)
    slope, covariance = memory.measurement_jacobian[1], memory.predicted_covariance
    variance = manoeuvre.product_variance(settings, memory, 1.0) + memory.model_error[0]
    cross = 0.0
    for i in range(7):
        cross += slope[i] * covariance[0, i]
        for j in range(7):
            variance += slope[i] * covariance[i, j] * slope[j]
    if not (early and memory.followed != 0 and _follow(settings, memory, force, variance)):
        _weigh(memory, force, cross, variance)
        memory.followed_variance = min(variance, _sensor_noise(memory))
    memory.followed = 1 if early and force > 0.0 else 0
    memory.followed_force = memory.given_force
    memory.followed_point[0] = memory.state[0]
    memory.followed_point[1] = memory.state[1]


@compiled
def _follow(settings: Any, memory: Any, force: float, variance: float) -> bool:
    """Carry the force of the last sample on by the ratio in which the law changes.

    Args:
        settings: settings record.
        memory: memory record after the innovation.
        force: by the law [N], positive.
        variance: what the law's force is known to [N^2].

    Returns:
        False if the law changes too much for that.
    """
    if memory.restart != 0 or not force > 0.0 or not memory.followed_point[0] > 0.0:
        return False
    copy_vector(memory.predicted_state, memory.point)
    memory.point[0] = memory.followed_point[0]
    memory.point[1] = memory.followed_point[1]
    before = state_space.force_of_state(settings, memory.point)
    if not 0.5 * before < force < 2.0 * before:
        return False
    ratio = force / before
    # The exponent n is not known, and how much of the force is damping is not either.
    deeper = math.log(memory.predicted_state[0] / memory.point[0])
    share = memory.predicted_covariance[5, 5] * deeper * deeper + (ratio - 1.0) ** 2
    known = memory.followed_variance * ratio * ratio
    known += share * (memory.followed_force**2 + memory.followed_variance)
    known = min(known, variance)
    sensor = _sensor_noise(memory)
    gain = known / (known + sensor)
    predicted = memory.followed_force * ratio
    given = predicted + gain * (memory.measurement[1] - predicted)
    if not math.isfinite(given):
        return False
    memory.given_force = given
    memory.followed_variance = gain * sensor
    return True


@compiled
def trust_sensor(memory: Any) -> None:
    """The tool was just seen to turn: nothing that was predicted holds."""
    memory.given_force = memory.measurement[1]


@compiled
def find_told(settings: Any, memory: Any, values: Any, force: float) -> None:
    """The force by the fit in `hindsight`, where that is what is told.

    Args:
        settings: settings record.
        memory: memory record after the sample.
        values: ln K, ln B, n, p that were told before it.
        force: predicted with them [N].
    """
    copy_vector(memory.predicted_state, memory.point)
    for i in range(4):
        memory.point[3 + i] = values[i]
    jacobian = memory.measurement_jacobian
    state_space.measurement_jacobian(settings, memory.point, memory.gradient, jacobian)
    slope, covariance = memory.measurement_jacobian[1], memory.predicted_covariance
    by_motion = 0.0
    cross = 0.0
    for i in range(2):
        cross += slope[i] * covariance[0, i]
        for j in range(2):
            by_motion += slope[i] * covariance[i, j] * slope[j]
    by_law = 0.0
    for i in range(4):
        for j in range(4):
            element = slope[3 + i] * memory.told_covariance[i, j] * slope[3 + j]
            by_law += element / memory.told_repeats
    _doubt(memory, force, by_motion + by_law / memory.told_misfit)
    variance = by_motion + by_law + memory.model_error[0]
    variance += max(memory.fit_misfit - memory.sensor_noise[1], 0.0)
    _weigh(memory, force, cross, variance)


@compiled
def _doubt(memory: Any, force: float, variance: float) -> None:
    """Count the share of the samples that the fit has not foreseen, if all it leaves is noise."""
    limit = DEVIATIONS * DEVIATIONS * (variance + _sensor_noise(memory))
    off = 1.0 if (memory.measurement[1] - force) ** 2 > limit else 0.0
    share = min(memory.elapsed / DOUBT_TIME, 1.0)
    memory.told_off += share * (off - memory.told_off)


@compiled
def is_doubted(memory: Any) -> bool:
    """True if what is told foresees too few of the samples: the contact law does not fit."""
    return memory.told_off > OFTEN_OFF  # type: ignore[no-any-return]
