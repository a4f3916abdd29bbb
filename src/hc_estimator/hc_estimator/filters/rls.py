"""`rls`: recursive least squares on the logarithm of the force, the baseline of the literature.

ln F = ln K + n ln d + ln(1 + (B/K) v) is taken as ln K + n ln d + (B/K) v (Haddadi and
Hashtrudi-Zaad 2008; papers A and B argue against it): linear in ln K, n and B/K, for p = 1 and a
damping force that is small against the elastic one. Displacement and velocity come from a Kalman
filter of the motion alone. It sees only samples whose force stands out of the noise.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hc_estimator.adaptation import difference_noise, policy
from hc_estimator.compilation import compiled
from hc_estimator.correction import commit, gate, innovate
from hc_estimator.linear_algebra import clear_matrix, copy_matrix, copy_vector
from hc_estimator.memory import Field
from hc_estimator.prediction import add_process_noise, predict
from hc_estimator.recovery import recover
from hc_estimator.report import say_range, write_row
from hc_estimator.screening import ACCEPTED, NUMERICAL, screen
from hc_estimator.specification import ParameterSpecification
from hc_estimator.state_space import kinematic
from hc_estimator.state_space.registry import force_of_state

SPECIFICATIONS = (
    ParameterSpecification(
        "forgetting",
        "float",
        0.9998,
        "Forgetting factor per sample; 1 remembers everything. Nothing is forgotten that the "
        "motion does not show anew (the covariance stays below that of the first guess).",
        minimum=0.5,
        maximum=1.0,
    ),
    ParameterSpecification(
        "smallest_force",
        "float",
        5.0,
        "Samples whose force is below so many standard deviations of its noise are left out: the "
        "logarithm makes their noise one-sided.",
        minimum=1.0,
        maximum=1e4,
    ),
    *policy.NOISE_SPECIFICATIONS,
    policy.NOISE_ADAPTATION,
    *difference_noise.SPECIFICATIONS,
)

FIELDS = (
    Field("regression", np.float64, (3,)),  # ln K, n, B/K
    Field("regression_factor", np.float64, (3, 3)),  # square root of their covariance
    Field("regression_prior", np.float64, (3,), 0.0),  # variances before any sample
)
SCRATCH = (
    Field("regressor", np.float64, (3,)),
    Field("regression_seen", np.float64, (3,)),
    Field("reported_factor", np.float64, (3, 3)),
)

SMALLEST_RATIO = 1e-9  # of B to K that is reported
SMALLEST_RATIO_STD = 0.1  # of the first guess of B/K [s/mm]


@compiled
def _start(settings: Any, memory: Any) -> None:
    """First guess of the regression from the settings."""
    ratio = settings.initial_damping / settings.initial_stiffness
    memory.regression[0] = math.log(settings.initial_stiffness)
    memory.regression[1] = settings.initial_displacement_exponent
    memory.regression[2] = ratio
    spread = max(ratio, SMALLEST_RATIO_STD) * settings.initial_damping_log_std
    memory.regression_prior[0] = settings.initial_stiffness_log_std**2
    memory.regression_prior[1] = settings.initial_displacement_exponent_std**2
    memory.regression_prior[2] = spread * spread
    clear_matrix(memory.regression_factor)
    for i in range(3):
        memory.regression_factor[i, i] = math.sqrt(memory.regression_prior[i])
    memory.state[6] = 1.0
    memory.begun = 1
    _to_state(memory)


@compiled
def _to_state(memory: Any) -> None:
    """Write ln K, ln B, n and their covariance where the report reads them (delta method)."""
    ratio = max(memory.regression[2], SMALLEST_RATIO)
    memory.state[3] = memory.regression[0]
    memory.state[4] = memory.regression[0] + math.log(ratio)
    memory.state[5] = memory.regression[1]
    covariance, factor = memory.covariance, memory.regression_factor
    reported = memory.reported_factor  # of ln K, ln B, n
    for j in range(3):
        reported[0, j] = factor[0, j]
        reported[1, j] = factor[0, j] + factor[2, j] / ratio
        reported[2, j] = factor[1, j]
    for i in range(3, 7):
        for j in range(7):
            covariance[i, j] = 0.0
            covariance[j, i] = 0.0
    for i in range(3):
        for j in range(3):
            for k in range(3):
                covariance[3 + i, 3 + j] += reported[i, k] * reported[j, k]
    memory.prior_variance[0] = memory.regression_prior[0]
    memory.prior_variance[1] = memory.regression_prior[0] + memory.regression_prior[2] / ratio**2
    memory.prior_variance[2] = memory.regression_prior[1]
    memory.prior_variance[3] = 0.0


@compiled
def _regress(settings: Any, memory: Any, displacement: float, velocity: float) -> None:
    """One step of recursive least squares with the measured force, if it stands out of the noise.

    In Potter's square-root form (Bierman, Factorization Methods for Discrete Sequential
    Estimation, 1977, section II.6): whatever the rounding, the covariance stays one.

    Args:
        settings: settings record.
        memory: memory record.
        displacement: filtered d [mm].
        velocity: filtered v [mm/s].
    """
    force = memory.measurement[1]
    noise = memory.noise[1]
    if displacement <= 0.0 or force * abs(force) < settings.smallest_force**2 * noise:
        return
    regressor, seen, factor = memory.regressor, memory.regression_seen, memory.regression_factor
    regressor[0] = 1.0
    regressor[1] = math.log(displacement)
    regressor[2] = velocity
    residual = math.log(force)
    relative_noise = noise / (force * force)  # of ln F
    spread = relative_noise + _see(memory)
    wide = False
    for i in range(3):
        residual -= regressor[i] * memory.regression[i]
        variance = 0.0
        for j in range(3):
            variance += factor[i, j] * factor[i, j]
        wide = wide or variance > memory.regression_prior[i]
    remember = 1.0 if wide else math.sqrt(settings.forgetting)
    share = 1.0 / (spread + math.sqrt(relative_noise * spread))
    for i in range(3):
        gain = 0.0
        for j in range(3):
            gain += factor[i, j] * seen[j]
        memory.regression[i] += gain * residual / spread
        for j in range(3):
            factor[i, j] = (factor[i, j] - gain * seen[j] * share) / remember


@compiled
def _see(memory: Any) -> float:
    """What the regressor sees of the factor, in memory.regression_seen; the variance of ln F."""
    total = 0.0
    for j in range(3):
        seen = 0.0
        for i in range(3):
            seen += memory.regression_factor[i, j] * memory.regressor[i]
        memory.regression_seen[j] = seen
        total += seen * seen
    return total


@compiled
def _use(settings: Any, memory: Any, time: float) -> int:
    """Filter the motion with the displacement, then regress the force on it."""
    if memory.begun == 0:
        _start(settings, memory)
    if not predict(settings, memory, False):
        return NUMERICAL
    add_process_noise(memory)
    policy.prepare(settings, memory)
    state, covariance = memory.predicted_state, memory.predicted_covariance
    memory.predicted_measurement[0] = state[0]
    memory.predicted_measurement[1] = force_of_state(settings, state)
    # Displacement: variance of the prediction. Force: that of the regression, in newtons.
    clear_matrix(memory.sensitivity)
    memory.sensitivity[0, 0] = math.sqrt(covariance[0, 0])
    clear_matrix(memory.curvature)
    force = memory.predicted_measurement[1]
    if state[0] > 0.0:
        memory.regressor[0] = 1.0
        memory.regressor[1] = math.log(state[0])
        memory.regressor[2] = state[1]
        memory.curvature[1, 1] = force * force * _see(memory)
    if not innovate(memory):
        return NUMERICAL
    decision = gate(settings, memory)
    if decision != ACCEPTED:
        return decision
    if memory.present[0] != 0:
        if not kinematic.correct_motion(
            memory.innovation[0],
            memory.measurement_noise[0],
            state,
            covariance,
            memory.factor,
            memory.updated_state,
            memory.updated_covariance,
        ):
            return NUMERICAL
    else:
        copy_vector(state, memory.updated_state)
        copy_matrix(covariance, memory.updated_covariance)
    decision = commit(settings, memory, time)
    if decision == ACCEPTED:
        memory.change_detected = 0
        if memory.present[1] != 0:
            _regress(settings, memory, memory.state[0], memory.state[1])
        _to_state(memory)
        policy.learn_noise(settings, memory)
    return decision


@compiled
def run(
    settings_array: Any,
    memory_array: Any,
    particles: NDArray[np.float64],
    samples: NDArray[np.float64],
    rows: NDArray[np.float64],
) -> None:
    """Run the filter over samples; arguments as in `filters.ukf.run`."""
    settings, memory = settings_array[0], memory_array[0]
    for k in range(samples.shape[0]):
        time = samples[k, 0]
        decision = screen(settings, memory, time, samples[k, 1], samples[k, 2])
        if decision == ACCEPTED:
            decision = _use(settings, memory, time)
        recover(settings, memory, time, decision)
        write_row(settings, memory, decision, rows[k])
        say_range(settings, samples[k, 2], rows[k])
