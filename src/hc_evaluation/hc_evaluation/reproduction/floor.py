"""What the start costs: the force error of a regression on all readings so far.

The Cramer-Rao bound is local: it takes the force to be linear in the parameters about the truth,
which it is not while they are hardly known. This floor is what an estimator reaches that has the
same first guess as ours, but knows the motion and the noise, keeps all readings and fits the
contact law to them anew at every instant (least squares with the first guess as a prior: the most
probable parameters). If a printed figure lies above it, the readings allow that figure, and an
estimator that misses it has itself to blame.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from hc_estimator import DEFAULT_FILTER, parameter_specifications
from hc_estimator.contact.arrays import hunt_crossley_force
from hc_evaluation.reproduction.signals import Signal

FloatArray = NDArray[np.float64]

EARLY = 30  # first samples that are each fitted anew
INSTANTS = 100  # later ones at which it is fitted, each a few percent of the run after the last
FROM_GUESS = 300  # samples up to which a second fit starts from the first guess
EVALUATIONS, FIRST_EVALUATIONS = 60, 200  # of the sum of squares at most
LOWEST, HIGHEST = -50.0, 50.0  # of an exponent or a logarithm during the search


def first_guess() -> tuple[FloatArray, FloatArray]:
    """Our default's first guess of ln K, ln B, n, p and its standard deviations, shape (4,)."""
    default = {s.name: s.default for s in parameter_specifications(DEFAULT_FILTER, "kinematic")}

    def value(name: str) -> float:
        return float(default[f"initial_{name}"])

    mean = [
        np.log(value("stiffness")),
        np.log(value("damping")),
        value("displacement_exponent"),
        value("velocity_exponent"),
    ]
    deviations = [
        value("stiffness_log_std"),
        value("damping_log_std"),
        value("displacement_exponent_std"),
        value("velocity_exponent_std"),
    ]
    return np.array(mean), np.array(deviations)


def _parameters(logarithmic: FloatArray) -> FloatArray:
    limited = np.clip(logarithmic, LOWEST, HIGHEST)
    return np.concatenate([np.exp(limited[:2]), limited[2:]])


def regression_error(signal: Signal) -> FloatArray:
    """Force error of the regression at every sample.

    Between two fits the later one is used, so that the floor is rather too low than too high.

    Args:
        signal: readings and truth of a Hunt-Crossley tissue.

    Returns:
        Force error [N], shape (N,).
    """
    count = signal.time_s.size
    later = np.geomspace(EARLY, count, INSTANTS).astype(int)
    instants = np.unique(np.concatenate([np.arange(1, min(EARLY, count)), later]))
    mean, deviations = first_guess()
    depth, velocity = signal.true_displacement, signal.true_velocity
    found, error, done = mean, np.zeros(count), 0
    for k in instants:

        def residuals(guess: FloatArray, k: int = int(k)) -> FloatArray:
            force = hunt_crossley_force(depth[:k], velocity[:k], _parameters(guess))
            misfit = np.clip((force - signal.force_n[:k]) / signal.force_noise_std[:k], -1e9, 1e9)
            return np.concatenate([misfit, (guess - mean) / deviations])

        fit = least_squares(residuals, found, method="lm", max_nfev=EVALUATIONS)
        if k < FROM_GUESS:
            other = least_squares(residuals, mean, method="lm", max_nfev=FIRST_EVALUATIONS)
            fit = min(fit, other, key=lambda f: float(f.cost))
        found = fit.x
        new = slice(done, int(k))
        force = hunt_crossley_force(depth[new], velocity[new], _parameters(found))
        error[new] = force - signal.true_force[new]
        done = int(k)
    return error


def regression_floor(signal: Signal) -> float:
    """RMS of that error over the whole run [N]."""
    return float(np.sqrt(np.mean(np.square(regression_error(signal)))))
