"""Weights of particles: normalising their logarithms, effective sample size, systematic resampling.

Particles are rows of an array; the last column holds the logarithm of the weight, the last but one
that before the present sample.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hc_estimator.compilation import compiled
from hc_estimator.random_numbers import uniform
from hc_estimator.specification import ParameterSpecification

RESAMPLING_THRESHOLD = ParameterSpecification(
    "resampling_threshold",
    "float",
    0.5,
    "Resample when the effective sample size falls below this share of the particles; 1 "
    "resamples at every sample, as paper C does.",
    minimum=0.0,
    maximum=1.0,
)
SURVIVING_SHARE = ParameterSpecification(
    "surviving_share",
    "float",
    0.5,
    "No sample may reduce the effective sample size below this share of what it was: its "
    "likelihood is flattened as far as needed. 0 takes every likelihood as it is.",
    minimum=0.0,
    maximum=0.99,
)


@compiled
def normalise(particles: NDArray[np.float64]) -> bool:
    """Shift the logarithms of the weights so that the weights add up to 1.

    Args:
        particles: shape (count, columns), log weights in the last column.

    Returns:
        False if no particle has a finite weight.
    """
    last = particles.shape[1] - 1
    largest = -math.inf
    for k in range(particles.shape[0]):
        if particles[k, last] > largest:
            largest = particles[k, last]
    if not math.isfinite(largest):
        return False
    total = 0.0
    for k in range(particles.shape[0]):
        if math.isnan(particles[k, last]):
            particles[k, last] = -math.inf
        total += math.exp(particles[k, last] - largest)
    shift = largest + math.log(total)
    for k in range(particles.shape[0]):
        particles[k, last] -= shift
    return True


@compiled
def effective_sample_size(particles: NDArray[np.float64]) -> float:
    """1 over the sum of the squared normalised weights: between 1 and the number of particles."""
    last = particles.shape[1] - 1
    total = 0.0
    for k in range(particles.shape[0]):
        total += math.exp(2.0 * particles[k, last])
    return 1.0 / total


@compiled
def resample(
    settings: Any, memory: Any, particles: NDArray[np.float64], drawn: NDArray[np.float64]
) -> None:
    """Systematic resampling (Kitagawa 1996): equal weights afterwards, one random number.

    Args:
        settings: settings record (seed).
        memory: memory record (count of random numbers).
        particles: normalised particles, shape (count, columns); replaced by the drawn ones.
        drawn: scratch, shape (count, columns).
    """
    count, last = particles.shape[0], particles.shape[1] - 1
    position = uniform(settings, memory) / count
    source = 0
    cumulated = math.exp(particles[0, last])
    for k in range(count):
        while cumulated < position and source < count - 1:
            source += 1
            cumulated += math.exp(particles[source, last])
        for c in range(last):
            drawn[k, c] = particles[source, c]
        position += 1.0 / count
    equal = -math.log(count)
    for k in range(count):
        for c in range(last):
            particles[k, c] = drawn[k, c]
        particles[k, last] = equal


@compiled
def _flattened(particles: NDArray[np.float64], k: int, power: float) -> float:
    """Log weight of a particle with its last likelihood to a power; -inf if it has none."""
    old, new = particles[k, -2], particles[k, -1]
    if old == -math.inf or math.isnan(new):
        return -math.inf
    if power == 1.0:
        return new  # type: ignore[no-any-return]
    if new == -math.inf:
        return -math.inf
    return old + power * (new - old)  # type: ignore[no-any-return]


@compiled
def flatten(particles: NDArray[np.float64], smallest_share: float) -> float:
    """Raise the likelihoods of one sample to a power below 1 if they would leave few particles.

    A precise sensor can kill all particles but one in a single sample, and what one particle
    knows no resampling can spread again. The power is chosen (by bisection) such that the
    effective sample size keeps at least the given share of what it was; the information given up
    comes back with the samples that follow.

    Args:
        particles: shape (count, columns); the log weights with the sample's log likelihoods
            added in the last column (normalised on return), the normalised ones before the sample
            in the last but one.
        smallest_share: share of the effective sample size that is kept.

    Returns:
        The power, between 0 and 1; NaN if no particle has a finite weight.
    """
    count, last = particles.shape[0], particles.shape[1] - 1
    target = 0.0
    for k in range(count):
        target += math.exp(2.0 * particles[k, last - 1])
    target = smallest_share / target
    lower, upper, power = -60.0, 0.0, 1.0  # binary logarithms of the power
    for trial in range(14):
        largest = -math.inf
        for k in range(count):
            largest = max(largest, _flattened(particles, k, power))
        if not math.isfinite(largest):
            return math.nan
        first = 0.0
        second = 0.0
        for k in range(count):
            weight = math.exp(_flattened(particles, k, power) - largest)
            first += weight
            second += weight * weight
        if first * first >= target * second:
            if trial == 0:
                break
            lower = math.log2(power)
        else:
            upper = math.log2(power)
        power = 2.0 ** (0.5 * (lower + upper))
    if power < 1.0:
        power = 2.0**lower
    for k in range(count):
        particles[k, last] = _flattened(particles, k, power)
    if not normalise(particles):
        return math.nan
    return power
