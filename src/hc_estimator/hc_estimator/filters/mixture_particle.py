"""One particle of `rbpf`: its row, and its Kalman filter of [d, v, a, K, B, n, p].

Extended in displacement and velocity, and in the exponents within the particle's own kernel. Where
it is updated it stands as the lower factor of its covariance, memory.factor.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hc_estimator.compilation import compiled
from hc_estimator.contact.hunt_crossley import SMALLEST_SPEED
from hc_estimator.contact.registry import contact_force, contact_gradient
from hc_estimator.memory import Field

# Columns of a particle.
STATE = 0  # d, v, a, K, B, n, p
COVARIANCE = 7  # 7x7, row-major
COVARIANCE_END = 56
BEFORE = 56  # logarithm of the weight before the sample
WEIGHT = 57  # the same after it
SHARE = 58  # the weight itself
COLUMNS = 59
SIZE = 7

SCRATCH = (
    Field("conditional_gain", np.float64, (SIZE,)),
    Field("conditional_seen", np.float64, (SIZE,)),
    Field("conditional_slope", np.float64, (SIZE,)),
)


@compiled
def linearise(settings: Any, memory: Any, row: NDArray[np.float64]) -> float:
    """Force of a particle; its derivatives by its states go to memory.conditional_slope."""
    force = contact_gradient(
        settings.contact_model,
        row[STATE],
        row[STATE + 1],
        row[STATE + 3],
        row[STATE + 4],
        row[STATE + 5],
        row[STATE + 6],
        memory.gradient,
    )
    slope = memory.conditional_slope
    slope[0] = memory.gradient[0]
    slope[1] = memory.gradient[1]
    slope[2] = 0.0
    for i in range(4):
        slope[3 + i] = memory.gradient[2 + i]
    if abs(row[STATE + 1]) >= SMALLEST_SPEED:
        return float(force)
    # Below it the gradient's force has the damping of that speed.
    return contact_force(
        settings.contact_model,
        row[STATE],
        row[STATE + 1],
        row[STATE + 3],
        row[STATE + 4],
        row[STATE + 5],
        row[STATE + 6],
    )


@compiled
def use_displacement(memory: Any, row: NDArray[np.float64], noise: float) -> float:
    """Update mean and factor of a particle with the displacement; its log likelihood.

    The displacement is the first state, so that only the first column of the lower factor knows
    it: scaling that column is the whole update, exactly.
    """
    factor = memory.factor
    residual = memory.measurement[0] - row[STATE]
    spread = factor[0, 0] * factor[0, 0] + noise
    gain = factor[0, 0] / spread
    scale = math.sqrt(noise / spread)
    for i in range(SIZE):
        row[STATE + i] += factor[i, 0] * gain * residual
        factor[i, 0] *= scale
    return -0.5 * float(residual * residual / spread + math.log(spread))


@compiled
def use_force(settings: Any, memory: Any, row: NDArray[np.float64], noise: float) -> float:
    """Update mean and factor of a particle with the force; its log likelihood.

    Potter's square-root update (Bierman, Factorization Methods for Discrete Sequential Estimation,
    1977, section II.6): whatever the rounding, factor times its transpose is a covariance.
    """
    factor, slope = memory.factor, memory.conditional_slope
    seen, gain = memory.conditional_seen, memory.conditional_gain
    residual = memory.measurement[1] - linearise(settings, memory, row)
    spread = noise
    for j in range(SIZE):
        seen[j] = 0.0
        for i in range(j, SIZE):
            seen[j] += factor[i, j] * slope[i]
        spread += seen[j] * seen[j]
    for i in range(SIZE):
        gain[i] = 0.0
        for j in range(i + 1):
            gain[i] += factor[i, j] * seen[j]
        row[STATE + i] += gain[i] * residual / spread
    share = 1.0 / (spread + math.sqrt(noise * spread))
    for i in range(SIZE):
        for j in range(SIZE):
            factor[i, j] -= gain[i] * seen[j] * share
    return -0.5 * float(residual * residual / spread + math.log(spread))
