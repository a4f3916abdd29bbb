"""Figures of merit of an estimate, in the order of trust: truth, consistency, prediction.

The force rebuilt from the posterior is left out on purpose: a filter with enough gain drives it to
zero while its parameters mean nothing. Errors of K and B are taken in logarithms (relative error),
those of the exponents as they are.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaincinv

FloatArray = NDArray[np.float64]


def log_parameter_error(estimated: FloatArray, true: FloatArray) -> FloatArray:
    """Error of ln K, ln B, n, p, shape (..., 4), from K, B, n, p of the same shape."""
    return np.concatenate(
        (np.log(estimated[..., :2] / true[..., :2]), estimated[..., 2:] - true[..., 2:]), axis=-1
    )


def relative_parameter_error(estimated: FloatArray, true: FloatArray) -> FloatArray:
    """|estimate / truth - 1| of K, B, n, p, shape (..., 4)."""
    error: FloatArray = np.abs(estimated / true - 1.0)
    return error


def log_parameter_covariance(parameters: FloatArray, covariance: FloatArray) -> FloatArray:
    """Covariance of ln K, ln B, n, p from that of K, B, n, p; shape (..., 4, 4)."""
    scale = np.ones_like(parameters)
    scale[..., :2] = 1.0 / parameters[..., :2]
    result: FloatArray = covariance * scale[..., :, None] * scale[..., None, :]
    return result


def nees(estimated: FloatArray, covariance: FloatArray, true: FloatArray) -> FloatArray:
    """Normalised estimation error squared of the four parameters; mean 4 when honest.

    Bar-Shalom, Li and Kirubarajan, Estimation with Applications to Tracking and Navigation, Eq.
    5.4.2-3. Taken in ln K, ln B, n, p, where the errors are closest to Gaussian.

    Args:
        estimated: K, B, n, p, shape (..., 4).
        covariance: Their covariance, shape (..., 4, 4).
        true: True K, B, n, p, shape (..., 4).

    Returns:
        NEES, shape (...,); NaN where the covariance is unknown or singular (a parameter held
        fixed).
    """
    error = log_parameter_error(estimated, true)
    weight = log_parameter_covariance(estimated, covariance)
    with np.errstate(invalid="ignore"):
        sign, _ = np.linalg.slogdet(weight)
    regular = sign > 0.0
    weight = np.where(regular[..., None, None], weight, np.eye(4))
    solved = np.linalg.solve(weight, error[..., None])[..., 0]
    result: FloatArray = np.where(regular, np.sum(error * solved, axis=-1), np.nan)
    return result


def chi_square_band(degrees: int, samples: int, probability: float = 0.999) -> tuple[float, float]:
    """Band in which the mean of ``samples`` independent chi-square values lies.

    Args:
        degrees: Degrees of freedom of each value.
        samples: Number of independent values averaged.
        probability: Probability that the mean is inside.
    """
    tail = 0.5 * (1.0 - probability)
    freedom = degrees * samples
    return (
        float(2.0 * gammaincinv(0.5 * freedom, tail)) / samples,
        float(2.0 * gammaincinv(0.5 * freedom, 1.0 - tail)) / samples,
    )


def settling_time(
    time_s: FloatArray, error: FloatArray, tolerance: float, start_s: float = 0.0
) -> float:
    """Time after ``start_s`` from which all columns of ``error`` stay within ``tolerance``.

    Args:
        time_s: Instants, shape (N,).
        error: Absolute relative errors, shape (N, M).
        tolerance: Limit on each column.
        start_s: Instant from which the time counts; earlier samples are ignored.

    Returns:
        Seconds; 0 if always within, infinity if the last sample is outside.
    """
    considered = time_s >= start_s
    outside = np.flatnonzero(~(np.max(error[considered], axis=1) <= tolerance))
    if outside.size == 0:
        return 0.0
    times = time_s[considered]
    if outside[-1] + 1 >= times.size:
        return float("inf")
    return float(times[outside[-1] + 1] - start_s)
