"""`sir_pf`: the particle filter with sampling, importance, resampling (paper C, section IV.B).

Particles are states of the state space. Two proposals can be chosen. `process` is the papers': the
process function with process noise, Gaussian or gamma distributed (paper C, Eq. 22: impulses in
one direction), weighted with the likelihood of both readings (Eq. 27 with its minus sign).
`motion` draws displacement, velocity and acceleration anew at each sample from a Kalman filter of
the motion alone, and weights with the force: few particles cannot follow a precise displacement
sensor, and need not, because the motion is linear. Weights are kept as logarithms. Systematic
resampling when the effective sample size falls, with roughening of the parameters (Gordon,
Salmond and Smith 1993), which would otherwise never move.

A particle filter that has lost track may show a full effective sample size; the innovations tell:
see `recovery` for what follows on too many of them beyond the gate.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hc_estimator.adaptation import difference_noise, policy
from hc_estimator.compilation import compiled
from hc_estimator.contact.registry import end_of_parameters
from hc_estimator.correction import commit, gate, innovate
from hc_estimator.filters.motion_proposal import draw_motion, predict_motion
from hc_estimator.linear_algebra import (
    cholesky,
    clear_matrix,
    clear_vector,
    copy_matrix,
    copy_vector,
)
from hc_estimator.prediction import restart_motion
from hc_estimator.random_numbers import SPECIFICATIONS as RANDOM_SPECIFICATIONS
from hc_estimator.random_numbers import gamma, normal
from hc_estimator.recovery import recover
from hc_estimator.report import write_row
from hc_estimator.resampling import (
    RESAMPLING_THRESHOLD,
    SURVIVING_SHARE,
    effective_sample_size,
    flatten,
    resample,
)
from hc_estimator.screening import ACCEPTED, NUMERICAL, screen
from hc_estimator.specification import ParameterSpecification
from hc_estimator.state_space import kinematic
from hc_estimator.state_space import registry as state_space

COLUMNS = 9  # seven states, logarithms of the weight before and after the sample
WEIGHT = 8
GAMMA = 1  # positions in the choices
MOTION = 1

SPECIFICATIONS = (
    ParameterSpecification(
        "particle_count",
        "int",
        50,
        "Number of particles.",
        minimum=2,
        maximum=100000,
        runtime=False,
    ),
    RESAMPLING_THRESHOLD,
    SURVIVING_SHARE,
    ParameterSpecification(
        "roughening",
        "float",
        0.1,
        "After resampling the parameters are jittered by this share of their range over the "
        "particles; 0 leaves them.",
        minimum=0.0,
        maximum=10.0,
    ),
    ParameterSpecification(
        "likelihood_scale",
        "float",
        5.0,
        "Factor of the sensors' standard deviations in the weights. Few particles cannot resolve a "
        "precise sensor in seven dimensions; 1 is the likelihood itself.",
        minimum=1.0,
        maximum=1e4,
    ),
    ParameterSpecification(
        "proposal",
        "str",
        "process",
        "Where the particles' motion is drawn from: the process function with its noise, or a "
        "Kalman filter of the displacement alone. On `kinematic` only.",
        choices=("process", "motion"),
        runtime=False,
    ),
    ParameterSpecification(
        "process_noise_shape",
        "str",
        "gaussian",
        "Distribution of the process noise of displacement and velocity in the proposal: Gaussian, "
        "or gamma (one-sided impulses, paper C).",
        choices=("gaussian", "gamma"),
    ),
    ParameterSpecification(
        "gamma_shape",
        "float",
        0.05,
        "Shape of the gamma process noise (alpha of paper C, Eq. 22).",
        minimum=1e-3,
        maximum=1e3,
    ),
    ParameterSpecification(
        "gamma_scale_displacement",
        "float",
        0.0,
        "Scale of the gamma process noise of the displacement per sample (1 / beta of paper C).",
        minimum=0.0,
        maximum=1e3,
        unit="mm",
    ),
    ParameterSpecification(
        "gamma_scale_velocity",
        "float",
        2.0,
        "Scale of the gamma process noise of the velocity per sample (1 / beta of paper C).",
        minimum=0.0,
        maximum=1e6,
        unit="mm/s",
    ),
    *RANDOM_SPECIFICATIONS,
    *policy.NOISE_SPECIFICATIONS,
    policy.NOISE_ADAPTATION,
    *difference_noise.SPECIFICATIONS,
)


@compiled
def _draw_prior(settings: Any, memory: Any, particles: NDArray[np.float64]) -> bool:
    """Draw all particles from the normal distribution of the predicted state.

    At the start and after a gap: the displacement is known to the sensor's noise (a wider prior
    would leave no particle near it), the rest as `prediction.restart_motion` says.
    """
    memory.predicted_covariance[0, 0] = memory.noise[0]
    if not cholesky(memory.predicted_covariance, memory.factor):
        return False
    for k in range(particles.shape[0]):
        for i in range(7):
            memory.point[i] = normal(settings, memory)
        for i in range(7):
            total = memory.predicted_state[i]
            for j in range(i + 1):
                total += memory.factor[i, j] * memory.point[j]
            particles[k, i] = total
        particles[k, WEIGHT] = -math.log(particles.shape[0])
    return True


@compiled
def _move(
    settings: Any, memory: Any, particles: NDArray[np.float64], moved: NDArray[np.float64]
) -> bool:
    """Draw each particle's next state from the proposal; weights stay."""
    if not cholesky(memory.process_noise, memory.factor):
        return False
    impulses = settings.process_noise_shape == GAMMA
    for k in range(particles.shape[0]):
        state_space.process(settings, memory.elapsed, particles[k, :7], memory.point)
        for i in range(7):
            moved[k, i] = memory.point[i]
        for i in range(7):
            memory.point[i] = normal(settings, memory)
        for i in range(2 if impulses else 0, 7):
            for j in range(i + 1):
                moved[k, i] += memory.factor[i, j] * memory.point[j]
        if impulses:
            moved[k, 0] += settings.gamma_scale_displacement * gamma(
                settings, memory, settings.gamma_shape
            )
            moved[k, 1] += settings.gamma_scale_velocity * gamma(
                settings, memory, settings.gamma_shape
            )
        moved[k, WEIGHT] = particles[k, WEIGHT]
    return True


@compiled
def _expect(settings: Any, memory: Any, particles: NDArray[np.float64]) -> None:
    """Weighted mean and covariance of the particles' readings: the predicted measurement."""
    mean, curvature = memory.predicted_measurement, memory.curvature
    clear_vector(mean)
    clear_matrix(curvature)
    clear_matrix(memory.sensitivity)
    for second in range(2):
        for k in range(particles.shape[0]):
            weight = math.exp(particles[k, WEIGHT])
            if weight == 0.0:
                continue
            state_space.measure(settings, particles[k, :7], memory.outputs[0])
            if second == 0:
                mean[0] += weight * memory.outputs[0, 0]
                mean[1] += weight * memory.outputs[0, 1]
            else:
                a, b = memory.outputs[0, 0] - mean[0], memory.outputs[0, 1] - mean[1]
                curvature[0, 0] += weight * a * a
                curvature[0, 1] += weight * a * b
                curvature[1, 1] += weight * b * b
    curvature[1, 0] = curvature[0, 1]


@compiled
def _weigh(settings: Any, memory: Any, particles: NDArray[np.float64], first_channel: int) -> None:
    """Multiply the weights by the likelihood of what was read (paper C, Eq. 9 and 27).

    Args:
        settings: settings record.
        memory: memory record.
        particles: their log weights are changed.
        first_channel: 0 weights with displacement and force, 1 with the force alone.
    """
    scale = settings.likelihood_scale * settings.likelihood_scale
    for k in range(particles.shape[0]):
        particles[k, WEIGHT - 1] = particles[k, WEIGHT]
        state_space.measure(settings, particles[k, :7], memory.outputs[0])
        for i in range(first_channel, 2):
            if memory.present[i] == 0:
                continue
            residual = memory.measurement[i] - memory.outputs[0, i]
            particles[k, WEIGHT] -= (
                0.5 * residual * residual / (scale * memory.measurement_noise[i])
            )


@compiled
def summarise(memory: Any, particles: NDArray[np.float64]) -> None:
    """Weighted mean and covariance of the particles as the updated state and covariance."""
    state, covariance = memory.updated_state, memory.updated_covariance
    clear_vector(state)
    clear_matrix(covariance)
    for k in range(particles.shape[0]):
        weight = math.exp(particles[k, WEIGHT])
        if weight > 0.0:
            for i in range(7):
                state[i] += weight * particles[k, i]
    for k in range(particles.shape[0]):
        weight = math.exp(particles[k, WEIGHT])
        if weight > 0.0:
            for i in range(7):
                for j in range(i + 1):
                    covariance[i, j] += (
                        weight * (particles[k, i] - state[i]) * (particles[k, j] - state[j])
                    )
    for i in range(7):
        for j in range(i):
            covariance[j, i] = covariance[i, j]


@compiled
def _roughen(settings: Any, memory: Any, particles: NDArray[np.float64]) -> None:
    """Jitter the parameters by a share of their range, which shrinks with more particles."""
    share = settings.roughening * float(particles.shape[0]) ** (-0.25)  # four parameters
    last = end_of_parameters(settings.contact_model)
    for i in range(3, last):
        smallest = largest = particles[0, i]
        for k in range(1, particles.shape[0]):
            smallest = min(smallest, particles[k, i])
            largest = max(largest, particles[k, i])
        for k in range(particles.shape[0]):
            particles[k, i] += share * (largest - smallest) * normal(settings, memory)


@compiled
def _use(settings: Any, memory: Any, time: float, particles: NDArray[np.float64]) -> int:
    """Move, weigh and resample the particles; the decision on the sample."""
    count = particles.shape[0] // 2
    current, moved = particles[:count], particles[count:]
    elapsed = min(memory.elapsed, settings.longest_gap)
    state_space.process_noise(settings, elapsed, memory.process_noise)
    if memory.restart != 0 or memory.begun == 0:
        memory.restart = 1
        restart_motion(settings, memory)
        if not _draw_prior(settings, memory, moved):
            return NUMERICAL
        memory.begun = 1
    elif not _move(settings, memory, current, moved):
        return NUMERICAL
    by_motion = settings.proposal == MOTION
    if by_motion:
        predict_motion(settings, memory)
        state, covariance = memory.predicted_state, memory.predicted_covariance
        if not draw_motion(settings, memory, state, covariance, moved):
            return NUMERICAL
    policy.prepare(settings, memory)
    _expect(settings, memory, moved)
    if not innovate(memory):
        return NUMERICAL
    decision = gate(settings, memory)
    if decision != ACCEPTED:
        return decision
    if by_motion and memory.present[0] != 0:
        if not kinematic.correct_motion(
            memory.measurement[0] - memory.predicted_state[0],
            memory.measurement_noise[0],
            memory.predicted_state,
            memory.predicted_covariance,
            memory.factor,
            memory.updated_state,
            memory.updated_covariance,
        ):
            return NUMERICAL
        state, covariance = memory.updated_state, memory.updated_covariance
        if not draw_motion(settings, memory, state, covariance, moved):
            return NUMERICAL
        copy_vector(state, memory.predicted_state)  # `summarise` needs the room
        copy_matrix(covariance, memory.predicted_covariance)
    _weigh(settings, memory, moved, 1 if by_motion else 0)
    if math.isnan(flatten(moved, settings.surviving_share)):
        return NUMERICAL
    for k in range(count):
        for i in range(7):
            memory.point[i] = moved[k, i]
        state_space.constrain(settings, memory.point)
        for i in range(3, 7):
            moved[k, i] = memory.point[i]
    summarise(memory, moved)
    decision = commit(settings, memory, time)
    if decision != ACCEPTED:
        return decision
    memory.change_detected = 0
    copy_matrix(moved, current)
    if by_motion:
        copy_vector(memory.predicted_state, memory.motion_state)
        copy_matrix(memory.predicted_covariance, memory.motion_covariance)
    if effective_sample_size(current) < settings.resampling_threshold * count:
        resample(settings, memory, current, moved)
        _roughen(settings, memory, current)
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
    """Run the filter over samples.

    Args:
        settings_array: one settings record, shape (1,).
        memory_array: one memory record, shape (1,); changed.
        particles: the particles, and room for as many again, shape (2 count, COLUMNS); changed.
        samples: time [s], displacement [mm], force [N], shape (samples, 3).
        rows: takes the estimates, shape (samples, estimate.COLUMNS).
    """
    settings, memory = settings_array[0], memory_array[0]
    for k in range(samples.shape[0]):
        time = samples[k, 0]
        decision = screen(settings, memory, time, samples[k, 1], samples[k, 2])
        if decision == ACCEPTED:
            decision = _use(settings, memory, time, particles)
        recover(settings, memory, time, decision)
        write_row(settings, memory, decision, rows[k])
