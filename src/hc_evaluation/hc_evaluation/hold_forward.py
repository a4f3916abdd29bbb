"""Hold-forward error: freeze an estimate, and predict the force over the next half second.

The honest score where no truth is known. The displacement of the recording is given to the
prediction, its force is not. What an estimate says about the channels at the time of freezing is
part of it: F(t + h) = law(d(t + h - delay) - contact position, v(t + h - delay)) + force zero.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_filter

from hc_estimator import EstimateSeries
from hc_estimator.contact.arrays import force_of

FloatArray = NDArray[np.float64]

HORIZON_S = 0.5
START_S = 1.5
STRIDE_S = 0.05


@dataclass(frozen=True)
class Frozen:
    """What is frozen: parameters and channels, after each sample or for all of a recording.

    Attributes:
        parameters: K, B, n, p, shape (N, 4) or (4,).
        channel_delay: by how much the force is late [s], shape (N,) or a number.
        contact_position: displacement reading at contact [mm], shape (N,) or a number.
        force_zero: force reading without contact [N], shape (N,) or a number.
    """

    parameters: FloatArray
    channel_delay: FloatArray | float = 0.0
    contact_position: FloatArray | float = 0.0
    force_zero: FloatArray | float = 0.0

    @classmethod
    def of(cls, series: EstimateSeries) -> Frozen:
        """What an estimator said after each sample; what it does not estimate counts as 0."""
        return cls(
            series.parameters,
            np.nan_to_num(series.channel_delay),
            np.nan_to_num(series.contact_position),
            np.nan_to_num(series.force_zero),
        )

    def at(self, origin: int) -> tuple[FloatArray, float, float, float]:
        """Parameters, shape (4,), delay, contact position and zero after one sample."""
        parameters = np.asarray(self.parameters)
        return (
            parameters if parameters.ndim == 1 else parameters[origin],
            _at(self.channel_delay, origin),
            _at(self.contact_position, origin),
            _at(self.force_zero, origin),
        )


def _at(values: FloatArray | float, origin: int) -> float:
    array = np.asarray(values)
    return float(array) if array.ndim == 0 else float(array[origin])


def smooth_motion(
    displacement_mm: FloatArray, rate_hz: float, window_s: float = 0.06, order: int = 3
) -> tuple[FloatArray, FloatArray]:
    """Displacement and velocity of a recording, by a centred Savitzky-Golay filter.

    Args:
        displacement_mm: Evenly sampled readings, shape (N,).
        rate_hz: Sampling rate.
        window_s: Length of the filter; at least seven samples are used.
        order: of its polynomials.

    Returns:
        Displacement [mm] and velocity [mm/s], shapes (N,).
    """
    length = max(7, 2 * round(0.5 * window_s * rate_hz) + 1)
    return (
        savgol_filter(displacement_mm, length, order),
        savgol_filter(displacement_mm, length, order, deriv=1, delta=1.0 / rate_hz),
    )


def hold_forward_errors(
    time_s: FloatArray,
    displacement: FloatArray,
    velocity: FloatArray,
    force_n: FloatArray,
    estimate: Frozen | FloatArray,
    *,
    horizon_s: float = HORIZON_S,
    start_s: float = START_S,
    stride_s: float = STRIDE_S,
    adhesive: bool = False,
) -> tuple[FloatArray, FloatArray]:
    """Force errors when an estimate is frozen and the next half second is predicted.

    Args:
        time_s: Evenly spaced instants, shape (N,).
        displacement: Smoothed displacement readings [mm], shape (N,).
        velocity: Smoothed velocity [mm/s], shape (N,).
        force_n: Measured force, shape (N,); instants where it is NaN do not count.
        estimate: What is frozen; an array is K, B, n, p, shape (N, 4) or (4,), alone.
        horizon_s: How far each frozen estimate predicts.
        start_s: First instant at which an estimate is frozen.
        stride_s: Time between two frozen estimates.
        adhesive: Whether the law that predicts may pull.

    Returns:
        Instants of freezing, shape (M,), and the RMS force error over the horizon of each. Samples
        whose displacement at the delayed time lies outside the recording do not count.
    """
    frozen = estimate if isinstance(estimate, Frozen) else Frozen(estimate)
    step = float(np.median(np.diff(time_s)))
    horizon = round(horizon_s / step)
    stride = max(1, round(stride_s / step))
    first = int(np.searchsorted(time_s, time_s[0] + start_s))
    origins = np.arange(first, time_s.size - horizon, stride)
    errors = np.empty(origins.size)
    for row, origin in enumerate(origins):
        parameters, delay, contact, zero = frozen.at(int(origin))
        ahead = slice(origin + 1, origin + 1 + horizon)
        depth, speed, measured = displacement[ahead], velocity[ahead], force_n[ahead]
        if delay != 0.0:
            instants = time_s[ahead] - delay
            inside = (instants >= time_s[0]) & (instants <= time_s[-1])
            depth = np.interp(instants[inside], time_s, displacement)
            speed = np.interp(instants[inside], time_s, velocity)
            measured = measured[inside]
        predicted = force_of(depth - contact, speed, parameters, adhesive=adhesive) + zero
        there = ~np.isnan(measured)
        square = np.mean((measured - predicted)[there] ** 2) if there.any() else np.nan
        errors[row] = np.sqrt(square)
    return time_s[origins], errors


def hold_forward_rms(
    time_s: FloatArray,
    displacement: FloatArray,
    velocity: FloatArray,
    force_n: FloatArray,
    estimate: Frozen | FloatArray,
    *,
    start_s: float = START_S,
) -> float:
    """Root mean square of `hold_forward_errors` [N], NaN if one is; the arguments are the same."""
    errors = hold_forward_errors(
        time_s, displacement, velocity, force_n, estimate, start_s=start_s
    )[1]
    return float(np.sqrt(np.mean(errors**2)))
