"""A width, a compliance: which one explains on the law itself what a delay and zeros do not?

`play` and `yielding` take each that is tried off the position, and ask what the law leaves then.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from hc_evaluation.channels import ChannelDiagnosis, diagnose_channels

Array = NDArray[np.float64]


def left_by_law(time_s: Array, tip_mm: Array, force_n: Array) -> tuple[float, float]:
    """Return what the law leaves at the force's own stamps [N], and the noise [N].

    Args:
        time_s: evenly spaced stamps [s], shape (n,).
        tip_mm: penetration with what is tried taken off [mm], shape (n,).
        force_n: contact force [N], shape (n,).
    """
    try:
        tried = diagnose_channels(time_s, tip_mm, force_n)
    except ValueError:  # nothing moves any more
        return float("inf"), 0.0
    return tried.residual_rms_without_n, tried.noise_n


def least_between(left: Callable[[float], float], low: float, high: float, tries: int) -> float:
    """Return where least is left between two bounds, after so many tries."""
    from scipy.optimize import minimize_scalar

    near = minimize_scalar(left, bounds=(low, high), method="bounded", options={"maxiter": tries})
    return float(near.x)


def explains(
    left: tuple[float, float], found: ChannelDiagnosis, most_noises: float, least_gain: float
) -> bool:
    """Whether what is left is noise, and much less than with a delay and other zeros.

    Args:
        left: by the law, and the noise; see `left_by_law`.
        found: what the law leaves with a delay and other zeros.
        most_noises: that may be left.
        least_gain: times by which less must be left, beyond the noise and by mean square.
    """
    rest_n, noise_n = left
    here, with_faults = (max(n**2 - noise_n**2, 0.0) for n in (rest_n, found.residual_rms_n))
    return rest_n < most_noises * noise_n and least_gain * here < with_faults
