"""Faults that are none: damping that is the same at every depth, as Kelvin and Voigt have it.

The Hunt-Crossley law has no damping where the depth is next to none. Where a tissue, or more often
a simulator, has (F = K d + B v), delays and zeros bend the law to it for the most part. A tool that
goes out faster than the tissue comes back is let go of while it is below the surface: the force is
zero there, and not K d + B v.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_filter

from hc_evaluation.channels import ChannelDiagnosis

Array = NDArray[np.float64]

LEAST_DEPTH_MM: Final = 0.05
FEWEST_ROWS: Final = 100
SLOPE_S: Final = 0.03
"""Width of the parabolas that say the velocity."""
MOST_NOISES: Final = 1.5
"""What the other law may leave, for it to fit."""
LEAST_GAIN: Final = 4.0
"""Times by which it leaves less, beyond the noise and by mean square."""


_ROUNDS: Final = 10
"""In which it is settled where the tissue has let go of the tool."""


class Instead(NamedTuple):
    """What F = K d + B v says of a recording.

    Attributes:
        words: a sentence; empty if it does not explain what the faults are to explain.
        far_better: whether it explains far more than the faults do.
    """

    words: str
    far_better: bool


def damping_at_every_depth(even: tuple[Array, Array, Array], found: ChannelDiagnosis) -> Instead:
    """Ask whether F = K d + B v explains a recording without the faults that were found.

    Args:
        even: evenly spaced stamps [s], penetration [mm] and force [N], each of shape (n,).
        found: the faults, and what the Hunt-Crossley law leaves with them and without.
    """
    time, depth, force = even
    step = float(np.median(np.diff(time)))
    width = 2 * max(round(0.5 * SLOPE_S / step), 1) + 1
    inside = depth > LEAST_DEPTH_MM
    if depth.size < width or np.count_nonzero(inside) < FEWEST_ROWS:
        return Instead("", far_better=False)
    velocity = savgol_filter(depth, width, 2, deriv=1, delta=step)
    stiffness, damping, rest_n = _unilateral(depth[inside], velocity[inside], force[inside])
    here, with_faults, without = (
        max(n**2 - found.noise_n**2, 0.0)
        for n in (rest_n, found.residual_rms_n, found.residual_rms_without_n)
    )
    fits = rest_n < MOST_NOISES * found.noise_n and LEAST_GAIN * here < without
    if not (fits and stiffness > 0.0 and damping > 0.0):
        return Instead("", far_better=False)
    words = (
        "the damping seems to be the same at every depth, and nothing else to be wrong: "
        f"F = {stiffness:.3g} d + {damping:.3g} v (Kelvin and Voigt) leaves {1e3 * rest_n:.3g} mN, "
        f"the Hunt-Crossley law {1e3 * found.residual_rms_without_n:.3g} mN: estimate with "
        "--contact-model kelvin_voigt"
    )
    return Instead(words, far_better=LEAST_GAIN * here < with_faults)


def _unilateral(depth: Array, velocity: Array, force: Array) -> tuple[float, float, float]:
    """Fit F = max(0, K d + B v) to readings below the surface; return K, B and what is left (RMS).

    Where the tissue has let go of the tool is asked again of every fit.
    """
    columns = np.stack([depth, velocity], axis=1)
    holds = force > 0.0
    law: Array = np.zeros(2)
    for _ in range(_ROUNDS):
        if np.count_nonzero(holds) < FEWEST_ROWS:
            break
        law = np.asarray(np.linalg.lstsq(columns[holds], force[holds], rcond=None)[0], np.float64)
        before, holds = holds, columns @ law > 0.0
        if np.array_equal(before, holds):
            break
    rest = force - np.maximum(columns @ law, 0.0)
    return float(law[0]), float(law[1]), float(np.sqrt(np.mean(rest**2)))
