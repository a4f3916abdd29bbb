"""`rbpf`: the Rao-Blackwellised particle filter, as a mixture of Gaussians.

Given the exponents n and p, the force is linear in K and B. So the prior of n and p is sampled;
each particle carries the Gaussian of [d, v, a, K, B] given its exponents, kept by an extended
Kalman filter that is linear in all but displacement and velocity (both well measured), and no
first guess of K or B can lead it astray. Points alone can never resolve exponents that the data
fix a thousand times better than the prior; each particle therefore stands for a small Gaussian
around its exponents (a kernel), which its filter sharpens together with the rest. The weights are
the likelihoods; resampling drops the hypotheses that the data refuted.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hc_estimator.adaptation import change_detection, difference_noise, policy, tempering
from hc_estimator.compilation import compiled
from hc_estimator.correction import commit, gate, innovate
from hc_estimator.filters.mixture_particle import (
    BEFORE,
    COVARIANCE,
    COVARIANCE_END,
    SHARE,
    SIZE,
    STATE,
    WEIGHT,
    linearise,
    use_displacement,
    use_force,
)
from hc_estimator.linear_algebra import (
    cholesky,
    clear_matrix,
    clear_vector,
    copy_matrix,
    copy_vector,
)
from hc_estimator.random_numbers import SPECIFICATIONS as RANDOM_SPECIFICATIONS
from hc_estimator.random_numbers import normal
from hc_estimator.recovery import recover
from hc_estimator.report import say_range, write_row
from hc_estimator.resampling import (
    RESAMPLING_THRESHOLD,
    SURVIVING_SHARE,
    draw_places,
    effective_sample_size,
    flatten,
)
from hc_estimator.screening import ACCEPTED, NUMERICAL, screen
from hc_estimator.specification import ParameterSpecification
from hc_estimator.state_space import registry as state_space

SMALLEST_PARAMETER = 1e-9  # K and B are reported no smaller (their logarithm is the state)

SPECIFICATIONS = (
    ParameterSpecification(
        "particle_count",
        "int",
        60,
        "Number of particles.",
        minimum=2,
        maximum=100000,
        runtime=False,
    ),
    RESAMPLING_THRESHOLD,
    SURVIVING_SHARE,
    ParameterSpecification(
        "kernel_share",
        "float",
        0.1,
        "Share of the prior variance of the exponents that each particle keeps as its own kernel; "
        "the rest is spread over the particles.",
        minimum=0.0,
        maximum=1.0,
        runtime=False,
    ),
    *RANDOM_SPECIFICATIONS,
    *policy.NOISE_SPECIFICATIONS,
    policy.NOISE_ADAPTATION,
    *tempering.SPECIFICATIONS,
    *difference_noise.SPECIFICATIONS,
    *change_detection.SPECIFICATIONS,
)


@compiled
def _draw_parameters(settings: Any, memory: Any, particles: NDArray[np.float64]) -> None:
    """Draw exponents from the prior and set K and B of each particle to the first guess."""
    share = settings.kernel_share
    spread = math.sqrt(1.0 - share)
    deviations = memory.conditional_slope
    deviations[3] = settings.initial_stiffness * settings.initial_stiffness_log_std
    deviations[4] = settings.initial_damping * settings.initial_damping_log_std
    deviations[5] = settings.initial_displacement_exponent_std
    deviations[6] = settings.initial_velocity_exponent_std
    for k in range(particles.shape[0]):
        row = particles[k]
        row[STATE + 3] = settings.initial_stiffness
        row[STATE + 4] = settings.initial_damping
        row[STATE + 5] = settings.initial_displacement_exponent + (
            spread * deviations[5] * normal(settings, memory)
        )
        row[STATE + 6] = settings.initial_velocity_exponent + (
            spread * deviations[6] * normal(settings, memory)
        )
        covariance = row[COVARIANCE:COVARIANCE_END].reshape(SIZE, SIZE)
        for i in range(3, SIZE):
            for j in range(SIZE):
                covariance[i, j] = 0.0
                covariance[j, i] = 0.0
            covariance[i, i] = deviations[i] * deviations[i]
        covariance[5, 5] *= share
        covariance[6, 6] *= share
        row[WEIGHT] = -math.log(particles.shape[0])


@compiled
def _start_motion(settings: Any, memory: Any, particles: NDArray[np.float64]) -> None:
    """Forget the motion of each particle: at the measured displacement, at rest, wide."""
    for k in range(particles.shape[0]):
        row = particles[k]
        row[STATE] = memory.measurement[0]
        row[STATE + 1] = 0.0
        row[STATE + 2] = 0.0
        covariance = row[COVARIANCE:COVARIANCE_END].reshape(SIZE, SIZE)
        for i in range(3):
            for j in range(SIZE):
                covariance[i, j] = 0.0
                covariance[j, i] = 0.0
        covariance[0, 0] = settings.initial_displacement_std**2
        covariance[1, 1] = settings.initial_velocity_std**2
        covariance[2, 2] = settings.initial_acceleration_std**2


@compiled
def _move(settings: Any, memory: Any, particles: NDArray[np.float64]) -> None:
    """Predict each particle over memory.elapsed (the motion model of `kinematic`)."""
    elapsed = memory.elapsed
    half = 0.5 * elapsed * elapsed
    noise = settings.jerk_density * elapsed
    for k in range(particles.shape[0]):
        row = particles[k]
        row[STATE] += elapsed * row[STATE + 1] + half * row[STATE + 2]
        row[STATE + 1] += elapsed * row[STATE + 2]
        covariance = row[COVARIANCE:COVARIANCE_END].reshape(SIZE, SIZE)
        for j in range(SIZE):
            covariance[0, j] += elapsed * covariance[1, j] + half * covariance[2, j]
            covariance[1, j] += elapsed * covariance[2, j]
        for i in range(SIZE):
            covariance[i, 0] += elapsed * covariance[i, 1] + half * covariance[i, 2]
            covariance[i, 1] += elapsed * covariance[i, 2]
        covariance[0, 0] += noise * elapsed**4 / 20.0
        covariance[1, 1] += noise * elapsed**2 / 3.0
        covariance[2, 2] += noise
        for i in range(3):
            for j in range(i):
                coupling = noise * elapsed / 2.0
                if i == 1:
                    coupling = noise * elapsed**3 / 8.0
                elif j == 0:
                    coupling = noise * elapsed**2 / 6.0
                covariance[i, j] += coupling
                covariance[j, i] += coupling
        if not state_space.is_held(settings, 0):
            covariance[3, 3] += settings.stiffness_log_walk * elapsed * row[STATE + 3] ** 2
        if not state_space.is_held(settings, 1):
            covariance[4, 4] += settings.damping_log_walk * elapsed * row[STATE + 4] ** 2
        if not state_space.is_held(settings, 2):
            covariance[5, 5] += settings.displacement_exponent_walk * elapsed
        if not state_space.is_held(settings, 3):
            covariance[6, 6] += settings.velocity_exponent_walk * elapsed


@compiled
def _expect(settings: Any, memory: Any, particles: NDArray[np.float64]) -> None:
    """Mean and covariance of the readings that the mixture of all particles predicts."""
    mean, curvature = memory.predicted_measurement, memory.curvature
    clear_matrix(memory.sensitivity)
    d = force = dd = df = ff = 0.0
    first_displacement = first_force = math.nan
    for k in range(particles.shape[0]):
        row = particles[k]
        weight = math.exp(row[WEIGHT])
        if weight == 0.0:
            continue
        predicted = linearise(settings, memory, row)
        if math.isnan(first_force):
            first_displacement, first_force = row[STATE], predicted
        covariance = row[COVARIANCE:COVARIANCE_END].reshape(SIZE, SIZE)
        slope = memory.conditional_slope
        own_df = 0.0
        own_ff = 0.0
        for i in range(SIZE):
            own_df += slope[i] * covariance[i, 0]
            for j in range(SIZE):
                own_ff += slope[i] * covariance[i, j] * slope[j]
        # Sums of deviations from one particle lose no digits.
        x, y = row[STATE] - first_displacement, predicted - first_force
        d += weight * x
        force += weight * y
        dd += weight * (x * x + covariance[0, 0])
        df += weight * (x * y + own_df)
        ff += weight * (y * y + own_ff)
    mean[0] = first_displacement + d
    mean[1] = first_force + force
    curvature[0, 0] = max(dd - d * d, 0.0)
    curvature[0, 1] = curvature[1, 0] = df - d * force
    curvature[1, 1] = max(ff - force * force, 0.0)


@compiled
def _weigh(settings: Any, memory: Any, particles: NDArray[np.float64]) -> None:
    """Update each particle with what was read and multiply its weight.

    A particle whose covariance is none any more gets no weight.
    """
    factor = memory.factor
    for k in range(particles.shape[0]):
        row = particles[k]
        row[BEFORE] = row[WEIGHT]
        covariance = row[COVARIANCE:COVARIANCE_END].reshape(SIZE, SIZE)
        if not cholesky(covariance, factor):
            row[WEIGHT] = -math.inf
            continue
        if memory.present[0] != 0:
            row[WEIGHT] += use_displacement(memory, row, memory.measurement_noise[0])
        if memory.present[1] != 0:
            row[WEIGHT] += use_force(settings, memory, row, memory.measurement_noise[1])
        for i in range(SIZE):
            for j in range(i + 1):
                element = 0.0
                for m in range(SIZE):
                    element += factor[i, m] * factor[j, m]
                covariance[i, j] = element
                covariance[j, i] = element


@compiled
def _summarise(memory: Any, particles: NDArray[np.float64]) -> None:
    """Mean and covariance of the mixture as a state of `kinematic`: ln K, ln B by the delta method.

    Fills memory.updated_state and memory.updated_covariance.
    """
    mean, covariance = memory.updated_state, memory.updated_covariance
    clear_vector(mean)
    clear_matrix(covariance)
    for k in range(particles.shape[0]):
        weight = math.exp(particles[k, WEIGHT])
        if weight == 0.0:
            continue
        for i in range(SIZE):
            mean[i] += weight * particles[k, STATE + i]
    for k in range(particles.shape[0]):
        row = particles[k]
        weight = math.exp(row[WEIGHT])
        if weight == 0.0:
            continue
        own = row[COVARIANCE:COVARIANCE_END].reshape(SIZE, SIZE)
        for i in range(SIZE):
            for j in range(i + 1):
                apart = (row[STATE + i] - mean[i]) * (row[STATE + j] - mean[j])
                covariance[i, j] += weight * (own[i, j] + apart)
    for i in range(SIZE):
        for j in range(i):
            covariance[j, i] = covariance[i, j]
    for i in range(3, 5):
        scale = 1.0 / max(mean[i], SMALLEST_PARAMETER)
        mean[i] = -math.log(scale)
        for j in range(SIZE):
            covariance[i, j] *= scale
            covariance[j, i] *= scale


@compiled
def _resample(
    settings: Any,
    memory: Any,
    particles: NDArray[np.float64],
    drawn: NDArray[np.float64],
) -> None:
    """Draw particles in proportion to their weights, which are equal afterwards."""
    count = particles.shape[0]
    places = particles[:, BEFORE]
    draw_places(settings, memory, particles[:, SHARE], places)
    equal = -math.log(count)
    for k in range(count):
        copy_vector(particles[int(places[k])], drawn[k])
        drawn[k, WEIGHT] = equal


@compiled
def _use(settings: Any, memory: Any, time: float, particles: NDArray[np.float64]) -> int:
    """Move, weigh and resample the particles; the decision on the sample."""
    count = particles.shape[0] // 2
    current, moved = particles[:count], particles[count:]
    copy_matrix(current, moved)
    if memory.begun == 0:
        _draw_parameters(settings, memory, moved)
    if memory.restart != 0:
        _start_motion(settings, memory, moved)
    else:
        _move(settings, memory, moved)
    policy.prepare(settings, memory)
    _expect(settings, memory, moved)
    if not innovate(memory):
        return NUMERICAL
    decision = gate(settings, memory)
    if decision != ACCEPTED:
        return decision
    _weigh(settings, memory, moved)
    weights, share = moved[:, SHARE], settings.surviving_share
    if math.isnan(flatten(moved[:, BEFORE], moved[:, WEIGHT], weights, share)):
        return NUMERICAL
    for k in range(count):
        state_space.constrain(settings, moved[k, :SIZE])
    _summarise(memory, moved)
    decision = commit(settings, memory, time)
    if decision != ACCEPTED:
        return decision
    copy_matrix(moved, current)
    memory.begun = 1
    if effective_sample_size(weights) < settings.resampling_threshold * count:
        _resample(settings, memory, moved, current)
    memory.change_detected = 0
    policy.learn_noise(settings, memory)
    if policy.is_touching(memory):
        tempering.count_sample(memory)
        if change_detection.detect(settings, memory):
            memory.change_detected = 1
            _draw_parameters(settings, memory, current)
            tempering.restart(memory)
            change_detection.restart(memory)
    return decision


@compiled
def run(
    settings_array: Any,
    memory_array: Any,
    particles: NDArray[np.float64],
    samples: NDArray[np.float64],
    rows: NDArray[np.float64],
) -> None:
    """Run the filter over samples; arguments as in `filters.sir_pf.run`."""
    settings, memory = settings_array[0], memory_array[0]
    for k in range(samples.shape[0]):
        time = samples[k, 0]
        decision = screen(settings, memory, time, samples[k, 1], samples[k, 2])
        if decision == ACCEPTED:
            decision = _use(settings, memory, time, particles)
        recover(settings, memory, time, decision)
        write_row(settings, memory, decision, rows[k])
        say_range(settings, samples[k, 2], rows[k])
