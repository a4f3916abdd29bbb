"""Tissue that holds a tool on its way out: it sticks to it, or grips a needle."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from hc_estimator.stream.readings import LEAST_SAMPLES, noise, robust_range
from hc_estimator.stream.together import together

Array = NDArray[np.float64]

IN_THE_AIR: Final = 0.1
"""Of the readings, those with the least depth, which tell the force's zero."""
CLEAR: Final = 6.0
"""Times the force's noise."""
LEAST_SHARE: Final = 0.05
"""Of the force's range: a filter's ringing is less."""
FEWEST: Final = 0.005
"""Of the readings that pull, for it to be no spike."""
OUTWARD: Final = 0.8
"""Of the readings that pull, those on ways out: what friction or a zero does is on all ways."""
FAR: Final = 0.25
"""Of the readings, those so far out that the tissue has let go of the tool."""
STILL: Final = 0.3
"""Of those on ways out, which pull all the same: that is friction of what guides the tool."""
_SMOOTH: Final = 9
"""Readings in the mean that tells which way the tool goes."""


def sticking_line(time_s: Array, displacement_mm: Array, force_n: Array) -> str:
    """Say that the tool is pulled as it leaves the tissue; nothing where it is not.

    Args:
        time_s: stamps [s], shape (n,).
        displacement_mm: penetration [mm], shape (n,); NaN where there is no reading.
        force_n: contact force [N], shape (n,); NaN where there is no reading.
    """
    _stamps, depth, newtons = together(time_s, displacement_mm, force_n)
    if len(newtons) < LEAST_SAMPLES:
        return ""
    air = newtons[depth <= np.quantile(depth, IN_THE_AIR)]
    low_n, zero_n, high_n = np.quantile(air, (0.05, 0.5, 0.95)).tolist()
    least, most = robust_range(newtons)
    enough_n = max(CLEAR * noise(newtons), LEAST_SHARE * (most - least))
    if high_n - low_n > enough_n:  # it stays in the tissue
        return ""
    pulls = newtons < zero_n - enough_n
    if np.mean(pulls) < FEWEST:
        return ""
    way = np.gradient(np.convolve(depth, np.full(_SMOOTH, 1.0 / _SMOOTH), "same"))
    far = (way < 0.0) & (depth <= np.quantile(depth, FAR))
    if np.mean(way[pulls] < 0.0) < OUTWARD or np.mean(pulls[far]) > STILL:
        return ""
    pull_n = zero_n - float(np.quantile(newtons[pulls], 0.05))
    return (
        f"the tool is pulled by up to {pull_n:.2g} N on its way out: tissue that sticks to it, or "
        "grips it (a needle), which the contact law has not; wet or clean the tool, or take ways "
        "in alone (--contact-model adhesive is for tissue that pulls as it pushes)"
    )
