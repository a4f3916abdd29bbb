"""`sir_pf`: the particle filter with sampling, importance, resampling (paper C, section IV.B).

Particles are states of the state space, kept as a structure of arrays (plane i holds state i of
all of them), so that what is done to each is a vector loop. Two proposals can be chosen. `process`
is the papers': the process function with process noise, Gaussian or gamma distributed (paper C, Eq.
22: impulses in one direction), weighted with the likelihood of both readings (Eq. 27 with its minus
sign). `motion` draws displacement, velocity and acceleration anew at each sample from a Kalman
filter of the motion alone, and weights with the force: few particles cannot follow a precise
displacement sensor, and need not, because the motion is linear. Weights are kept as logarithms.
Systematic resampling when the effective sample size falls, with roughening of the parameters
(Gordon, Salmond and Smith 1993), which would otherwise never move.

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
from hc_estimator.filters import particle_models
from hc_estimator.filters.motion_proposal import draw_motion, predict_motion
from hc_estimator.linear_algebra import cholesky, clear_matrix, copy_matrix, copy_vector
from hc_estimator.prediction import restart_motion
from hc_estimator.random_numbers import SPECIFICATIONS as RANDOM_SPECIFICATIONS
from hc_estimator.random_numbers import fill_normal, gamma
from hc_estimator.recovery import recover
from hc_estimator.report import say_range, write_row
from hc_estimator.resampling import (
    RESAMPLING_THRESHOLD,
    SURVIVING_SHARE,
    draw_places,
    effective_sample_size,
    flatten,
    weights_of,
)
from hc_estimator.screening import ACCEPTED, NUMERICAL, screen
from hc_estimator.specification import ParameterSpecification
from hc_estimator.state_space import kinematic
from hc_estimator.state_space import registry as state_space
from hc_estimator.vector_mathematics import add_scaled, largest, smallest, total_product

# Planes of the particles' array, shape (PLANES, count).
KEPT = 8  # between samples: seven states and the logarithm of the weight
WEIGHT = 7
MOVED = 8  # the same of the present sample
BEFORE = 16  # logarithm of the weight before it
SHARE = 17  # the weight itself
FORCE = 18  # expected [N]
NORMALS = 19  # seven planes of random numbers, and then of deviations from the mean
APART = 26  # one plane of deviations
WEIGHTED = 27  # the same times the weights; places of those that are drawn
PLANES = 28

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
def _add_noise(
    factor: NDArray[np.float64],
    normals: NDArray[np.float64],
    first: int,
    planes: NDArray[np.float64],
) -> None:
    """Add to the states from the first one on what a Cholesky factor makes of normal numbers."""
    for i in range(first, 7):
        for j in range(i + 1):
            if factor[i, j] != 0.0:
                add_scaled(factor[i, j], normals[j], planes[i])


@compiled
def _draw_prior(memory: Any, normals: NDArray[np.float64], moved: NDArray[np.float64]) -> bool:
    """Draw all particles from the normal distribution of the predicted state.

    At the start and after a gap: the displacement is known to the sensor's noise (a wider prior
    would leave no particle near it), the rest as `prediction.restart_motion` says.
    """
    memory.predicted_covariance[0, 0] = memory.noise[0]
    if not cholesky(memory.predicted_covariance, memory.factor):
        return False
    equal = -math.log(moved.shape[1])
    for k in range(moved.shape[1]):
        for i in range(7):
            moved[i, k] = memory.predicted_state[i]
        moved[WEIGHT, k] = equal
    _add_noise(memory.factor, normals, 0, moved)
    return True


@compiled
def _move(
    settings: Any,
    memory: Any,
    current: NDArray[np.float64],
    normals: NDArray[np.float64],
    moved: NDArray[np.float64],
    by_motion: bool,
) -> bool:
    """Draw each particle's next state from the proposal; weights stay.

    Where the motion comes from a filter of its own, the parameters alone.
    """
    if not cholesky(memory.process_noise, memory.factor):
        return False
    particle_models.process(settings, memory, current[:7], moved[:7])
    impulses = settings.process_noise_shape == GAMMA and not by_motion
    _add_noise(memory.factor, normals, 3 if by_motion else (2 if impulses else 0), moved)
    if impulses:
        for k in range(moved.shape[1]):
            moved[0, k] += settings.gamma_scale_displacement * gamma(
                settings, memory, settings.gamma_shape
            )
            moved[1, k] += settings.gamma_scale_velocity * gamma(
                settings, memory, settings.gamma_shape
            )
    copy_vector(current[WEIGHT], moved[WEIGHT])
    return True


@compiled
def _take_apart(
    weights: NDArray[np.float64],
    values: NDArray[np.float64],
    mean: float,
    apart: NDArray[np.float64],
    weighted: NDArray[np.float64],
) -> None:
    """Deviations from the mean, and times the weights; 0 where there is no weight."""
    for k in range(weights.shape[0]):
        apart[k] = values[k] - mean if weights[k] > 0.0 else 0.0
        weighted[k] = weights[k] * apart[k]


@compiled
def _expect(settings: Any, memory: Any, particles: NDArray[np.float64]) -> None:
    """Weighted mean and covariance of the particles' readings: the predicted measurement."""
    mean, curvature = memory.predicted_measurement, memory.curvature
    clear_matrix(memory.sensitivity)
    moved, weights, forces = particles[MOVED:BEFORE], particles[SHARE], particles[FORCE]
    weights_of(moved[WEIGHT], weights)
    particle_models.measure(settings, memory, moved[:7], forces)
    mean[0] = total_product(weights, moved[0])
    mean[1] = total_product(weights, forces)
    first, second, weighted = particles[BEFORE], particles[APART], particles[WEIGHTED]
    _take_apart(weights, moved[0], mean[0], first, weighted)
    curvature[0, 0] = total_product(weighted, first)
    _take_apart(weights, forces, mean[1], second, weighted)
    curvature[1, 1] = total_product(weighted, second)
    curvature[0, 1] = curvature[1, 0] = total_product(weighted, first)


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
    logarithms = particles[MOVED + WEIGHT]
    copy_vector(logarithms, particles[BEFORE])
    for i in range(first_channel, 2):
        if memory.present[i] == 0:
            continue
        expected = particles[MOVED if i == 0 else FORCE]
        reading, half = memory.measurement[i], 0.5 / (scale * memory.measurement_noise[i])
        for k in range(logarithms.shape[0]):
            residual = reading - expected[k]
            logarithms[k] -= half * residual * residual


@compiled
def summarise(memory: Any, particles: NDArray[np.float64]) -> None:
    """Weighted mean and covariance of the particles as the updated state and covariance."""
    state, covariance = memory.updated_state, memory.updated_covariance
    weights, weighted = particles[SHARE], particles[WEIGHTED]
    moved, apart = particles[MOVED:], particles[NORMALS:]
    for i in range(7):
        state[i] = total_product(weights, moved[i])
        _take_apart(weights, moved[i], state[i], apart[i], weighted)
        for j in range(i + 1):
            covariance[i, j] = covariance[j, i] = total_product(weighted, apart[j])


@compiled
def _resample(settings: Any, memory: Any, particles: NDArray[np.float64]) -> None:
    """Draw the particles anew in proportion to their weights, which are equal afterwards."""
    places, moved, count = particles[WEIGHTED], particles[MOVED:], particles.shape[1]
    draw_places(settings, memory, particles[SHARE], places)
    for i in range(7):
        drawn, source = particles[i], moved[i]
        for k in range(count):
            drawn[k] = source[int(places[k])]
    equal = -math.log(count)
    for k in range(count):
        particles[WEIGHT, k] = equal


@compiled
def _roughen(settings: Any, memory: Any, particles: NDArray[np.float64]) -> None:
    """Jitter the parameters by a share of their range, which shrinks with more particles."""
    share = settings.roughening * float(particles.shape[1]) ** (-0.25)  # four parameters
    last = end_of_parameters(settings.contact_model)
    normals = particles[NORMALS : NORMALS + last - 3]
    fill_normal(settings, memory, normals.reshape(-1))
    for i in range(3, last):
        span = largest(particles[i]) - smallest(particles[i])
        add_scaled(share * span, normals[i - 3], particles[i])


@compiled
def _use(settings: Any, memory: Any, time: float, particles: NDArray[np.float64]) -> int:
    """Move, weigh and resample the particles; the decision on the sample."""
    current, moved = particles[:KEPT], particles[MOVED : MOVED + KEPT]
    normals = particles[NORMALS : NORMALS + 7]
    fill_normal(settings, memory, normals.reshape(-1))
    by_motion = settings.proposal == MOTION
    elapsed = min(memory.elapsed, settings.longest_gap)
    state_space.process_noise(settings, elapsed, memory.process_noise)
    if memory.restart != 0 or memory.begun == 0:
        memory.restart = 1
        restart_motion(settings, memory)
        if not _draw_prior(memory, normals, moved):
            return NUMERICAL
    elif not _move(settings, memory, current, normals, moved, by_motion):
        return NUMERICAL
    if by_motion:
        predict_motion(settings, memory)
        state, covariance = memory.predicted_state, memory.predicted_covariance
        if not draw_motion(memory, state, covariance, normals, moved):
            return NUMERICAL
    policy.prepare(settings, memory)
    _expect(settings, memory, particles)
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
        # The same numbers again: each particle's motion is corrected, none is drawn twice.
        if not draw_motion(memory, state, covariance, normals, moved):
            return NUMERICAL
        copy_vector(state, memory.predicted_state)  # `summarise` needs the room
        copy_matrix(covariance, memory.predicted_covariance)
        particle_models.measure(settings, memory, moved[:7], particles[FORCE])
    _weigh(settings, memory, particles, 1 if by_motion else 0)
    weights = particles[SHARE]
    power = flatten(particles[BEFORE], moved[WEIGHT], weights, settings.surviving_share)
    if math.isnan(power):
        return NUMERICAL
    particle_models.constrain(settings, moved[:7])
    summarise(memory, particles)
    decision = commit(settings, memory, time)
    if decision != ACCEPTED:
        return decision
    memory.begun = 1
    memory.change_detected = 0
    copy_matrix(moved, current)
    if by_motion:
        copy_vector(memory.predicted_state, memory.motion_state)
        copy_matrix(memory.predicted_covariance, memory.motion_covariance)
    if effective_sample_size(weights) < settings.resampling_threshold * weights.shape[0]:
        _resample(settings, memory, particles)
        _roughen(settings, memory, particles)
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
        particles: the particles and scratch, shape (PLANES, count); changed.
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
        say_range(settings, samples[k, 2], rows[k])
