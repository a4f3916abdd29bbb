"""The particle filter as one writes it in numpy: all particles of a sample in one expression.

Sampling, importance, resampling (Gordon, Salmond and Smith 1993) with the states, process noise
and sensor noise of `plain_ukf`: particles are moved with process noise, weighted with the
likelihood of both readings, and drawn anew (systematically) once the effective sample size is
below half their number. Nothing adaptive, no roughening, no checks.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hc_evaluation.rivals.packages import measure, move
from hc_evaluation.rivals.plain_ukf import STATES, Runner, start

Array = NDArray[np.float64]


def numpy_particles(count: int, seed: int = 1) -> Runner:
    """Return the filter, which begins afresh with each call.

    Args:
        count: number of particles.
        seed: of what is drawn.
    """
    first, spread, process, noise = start()
    root = np.linalg.cholesky(process)
    precisions = 1.0 / np.diag(noise)

    def run(samples: Array) -> Array:
        generator = np.random.default_rng(seed)
        particles = generator.multivariate_normal(first, spread, count).T
        logarithms = np.zeros(count)
        states = np.empty((len(samples), STATES))
        for number, reading in enumerate(samples):
            particles = move(particles) + root @ generator.standard_normal((STATES, count))
            logarithms -= 0.5 * (precisions @ (reading[:, np.newaxis] - measure(particles)) ** 2)
            weights = np.exp(logarithms - logarithms.max())
            weights /= weights.sum()
            states[number] = particles @ weights
            if 1.0 / (weights @ weights) < 0.5 * count:
                places = (np.arange(count) + generator.random()) / count
                chosen = np.searchsorted(np.cumsum(weights), places)
                particles = particles[:, np.minimum(chosen, count - 1)]
                logarithms = np.zeros(count)
        return states

    return run
