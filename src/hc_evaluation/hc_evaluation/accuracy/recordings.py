"""The real recordings: where they are, what a batch fit finds in them, what can be predicted.

They are not part of the project (licences); they are read from the shared folder beside it, or
from where the environment variable HC_SHARED_DATA points.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from hc_estimator.contact.arrays import hunt_crossley_force
from hc_evaluation.hold_forward import smooth_motion

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Recording:
    """One recording and how it is to be read.

    Attributes:
        name: Name for tables.
        file: File name in the data folder.
        contact_mm: Displacement at contact, subtracted from the readings.
        model_fits: True if the contact law describes it, so that K and n are comparable.
        palpation: True for the robot's palpations, False for the slow material tests.
        deepest_mm: Readings are used until the displacement first exceeds this.
        elastic: True where the tool moves at one slow speed: K and B cannot be told apart, and
            what is compared is the stiffness K + B v^p at that speed.
    """

    name: str
    file: str
    contact_mm: float
    model_fits: bool
    palpation: bool = True
    deepest_mm: float = float("inf")
    elastic: bool = False


RECORDINGS = (
    Recording("sine_soft", "palpation_sine_soft.csv", 0.0, True),
    Recording("sine_hard", "palpation_sine_hard.csv", 0.0, True),
    Recording("sine_horse_raw", "palpation_sine_horse_raw.csv", 0.0, True),
    Recording("sine_horse_aligned", "palpation_sine_horse_aligned.csv", 0.0, True),
    Recording("press_triangle", "palpation_press_triangle.csv", 6.0, True),
    Recording("press_triangle_unzeroed", "palpation_press_triangle.csv", 0.0, False),
    Recording(
        "silicone_soft_6mm", "silicone_compression_EF10_50T.csv", 0.0, True, False, 6.0, True
    ),
    Recording("silicone_hard_6mm", "silicone_compression_EF50_0T.csv", 0.0, True, False, 6.0, True),
    Recording("silicone_soft", "silicone_compression_EF10_50T.csv", 0.0, False, False),
    Recording("silicone_hard", "silicone_compression_EF50_0T.csv", 0.0, False, False),
    Recording("ramp_hold_1", "tissue_ramp_hold_1.csv", 0.0, False, False),
    Recording("ramp_hold_2", "tissue_ramp_hold_2.csv", 0.0, False, False),
)


def data_folder() -> Path | None:
    """The folder with the recordings, or None where it is absent."""
    given = os.environ.get("HC_SHARED_DATA")
    if given:
        folder = Path(given)
        return folder if folder.is_dir() else None
    for parent in Path(__file__).resolve().parents:
        folder = parent.parent / "shared" / "data"
        if folder.is_dir():
            return folder
    return None


def load(folder: Path, recording: Recording) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Read time [s], displacement from contact [mm] and force [N], each of shape (N,).

    Raises:
        ValueError: the file is missing or not in the expected form.
    """
    path = folder / recording.file
    try:
        table = np.loadtxt(path, delimiter=",", skiprows=1, ndmin=2)
    except OSError as error:
        raise ValueError(f"cannot read the recording {path}: {error}") from error
    if table.shape[1] != 3:
        raise ValueError(f"the recording {path} has {table.shape[1]} columns instead of 3")
    beyond = np.flatnonzero(table[:, 1] > recording.deepest_mm)
    if beyond.size:
        table = table[: beyond[0]]
    time, displacement, force = table.T
    return (
        np.ascontiguousarray(time),
        displacement - recording.contact_mm,
        np.ascontiguousarray(force),
    )


@dataclass(frozen=True)
class BatchFit:
    """Least-squares fit over a whole recording.

    Attributes:
        parameters: K, B, n, p, shape (4,).
        residual_rms: Root mean square of the force residual in contact [N].
    """

    parameters: FloatArray
    residual_rms: float


def batch_fit(
    displacement: FloatArray,
    velocity: FloatArray,
    force: FloatArray,
    *,
    velocity_exponent: float | None = None,
    guess: FloatArray | None = None,
) -> BatchFit:
    """Fit K, B, n (and p, unless it is given) to the samples in contact.

    The result knows the future and needs no model of noise: a floor for every causal estimator of
    the same contact law.

    Args:
        displacement: Smoothed penetration [mm], shape (N,).
        velocity: Smoothed velocity [mm/s], shape (N,).
        force: Measured force [N], shape (N,).
        velocity_exponent: p; None lets the fit choose it between 0.3 and 2.
        guess: K, B, n, p to start from, shape (4,).

    Returns:
        The fit.
    """
    touching = displacement > 0.0
    depth, speed, measured = displacement[touching], velocity[touching], force[touching]
    start = np.array([1.0, 0.02, 1.5, 1.0]) if guess is None else guess
    x0 = [np.log(start[0]), np.log(start[1]), start[2]]
    lower, upper = [-20.0, -20.0, 0.5], [8.0, 5.0, 6.0]
    if velocity_exponent is None:
        x0.append(start[3])
        lower.append(0.3)
        upper.append(2.0)

    def parameters_of(x: FloatArray) -> FloatArray:
        p = velocity_exponent if velocity_exponent is not None else x[3]
        return np.array([np.exp(x[0]), np.exp(x[1]), x[2], p])

    def residual(x: FloatArray) -> FloatArray:
        result: FloatArray = hunt_crossley_force(depth, speed, parameters_of(x)) - measured
        return result

    x0 = list(np.clip(x0, np.array(lower) + 1e-6, np.array(upper) - 1e-6))
    solution = least_squares(residual, x0, bounds=(lower, upper), x_scale="jac")
    return BatchFit(parameters_of(solution.x), float(np.sqrt(np.mean(solution.fun**2))))


def causal_fit(
    time: FloatArray,
    displacement: FloatArray,
    velocity: FloatArray,
    force: FloatArray,
    *,
    start_s: float,
    stride_s: float = 0.05,
) -> FloatArray:
    """Fit anew at every stride to the samples so far: what can be known at that time.

    Args:
        time: Instants [s], shape (N,).
        displacement: Smoothed penetration [mm], shape (N,).
        velocity: Smoothed velocity [mm/s], shape (N,).
        force: Measured force [N], shape (N,).
        start_s: Time since the first sample of the first fit.
        stride_s: Time between two fits.

    Returns:
        K, B, n, p in force after each sample, shape (N, 4); NaN before the first fit. p is 1.
    """
    step = float(np.median(np.diff(time)))
    stride = max(1, round(stride_s / step))
    first = int(np.searchsorted(time, time[0] + start_s))
    parameters = np.full((time.size, 4), np.nan)
    guess: FloatArray | None = None
    for origin in range(first, time.size, stride):
        known = slice(0, origin + 1)
        fit = batch_fit(
            displacement[known], velocity[known], force[known], velocity_exponent=1.0, guess=guess
        )
        guess = fit.parameters
        parameters[origin : origin + stride] = fit.parameters
    return parameters


def contact_start(time: FloatArray, force: FloatArray) -> float:
    """Seconds from the first sample until the force first exceeds 5 % of its maximum."""
    return float(time[int(np.argmax(force > 0.05 * force.max()))] - time[0])


def smoothed(time: FloatArray, displacement: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Smoothed displacement and velocity of a recording, shapes (N,)."""
    rate = 1.0 / float(np.median(np.diff(time)))
    return smooth_motion(displacement, rate)
