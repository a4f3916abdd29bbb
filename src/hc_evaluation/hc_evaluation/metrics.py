"""Figures of merit of an estimate, in the order of trust: truth, consistency, prediction.

The force rebuilt from the posterior is left out on purpose: a filter with enough gain drives it to
zero while its parameters mean nothing. Errors of K and B are taken in logarithms (relative error),
those of the exponents as they are.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_filter
from scipy.stats import chi2

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


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
        NEES, shape (...,).
    """
    error = log_parameter_error(estimated, true)
    weight = log_parameter_covariance(estimated, covariance)
    solved = np.linalg.solve(weight, error[..., None])[..., 0]
    result: FloatArray = np.sum(error * solved, axis=-1)
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
        float(chi2.ppf(tail, freedom)) / samples,
        float(chi2.ppf(1.0 - tail, freedom)) / samples,
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


def smooth_motion(
    displacement_mm: FloatArray, rate_hz: float, window_s: float = 0.06
) -> tuple[FloatArray, FloatArray]:
    """Displacement and velocity of a recording, by a centred cubic Savitzky-Golay filter.

    Args:
        displacement_mm: Evenly sampled readings, shape (N,).
        rate_hz: Sampling rate.
        window_s: Length of the filter; at least seven samples are used.

    Returns:
        Displacement [mm] and velocity [mm/s], shapes (N,).
    """
    length = max(7, 2 * round(0.5 * window_s * rate_hz) + 1)
    return (
        savgol_filter(displacement_mm, length, 3),
        savgol_filter(displacement_mm, length, 3, deriv=1, delta=1.0 / rate_hz),
    )


def hold_forward_errors(
    time_s: FloatArray,
    displacement: FloatArray,
    velocity: FloatArray,
    force_n: FloatArray,
    parameters: FloatArray,
    *,
    horizon_s: float = 0.5,
    start_s: float = 1.5,
    stride_s: float = 0.05,
) -> tuple[FloatArray, FloatArray]:
    """Force errors when the parameters are frozen and the next half second is predicted.

    Args:
        time_s: Instants, shape (N,).
        displacement: Smoothed displacement [mm], shape (N,).
        velocity: Smoothed velocity [mm/s], shape (N,).
        force_n: Measured force, shape (N,).
        parameters: Estimated K, B, n, p after each sample, shape (N, 4); or (4,) for a batch fit.
        horizon_s: How far each frozen estimate predicts.
        start_s: First instant at which an estimate is frozen.
        stride_s: Time between two frozen estimates.

    Returns:
        Instants of freezing, shape (M,), and the RMS force error over the horizon of each.
    """
    step = float(np.median(np.diff(time_s)))
    horizon = round(horizon_s / step)
    stride = max(1, round(stride_s / step))
    first = int(np.searchsorted(time_s, time_s[0] + start_s))
    origins = np.arange(first, time_s.size - horizon, stride)
    errors = np.empty(origins.size)
    depth = np.maximum(displacement, 0.0)
    for row, origin in enumerate(origins):
        stiffness, damping, n, p = parameters if parameters.ndim == 1 else parameters[origin]
        ahead = slice(origin + 1, origin + 1 + horizon)
        speed = velocity[ahead]
        dashpot = np.sign(speed) * np.abs(speed) ** p
        predicted = np.where(
            depth[ahead] > 0.0, depth[ahead] ** n * (stiffness + damping * dashpot), 0.0
        )
        errors[row] = np.sqrt(np.mean((force_n[ahead] - predicted) ** 2))
    return time_s[origins], errors
