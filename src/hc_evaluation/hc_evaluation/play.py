"""Play as an operator: what follows moves only once it is touched at either end of a gap.

A gear, a cable or a tendon with backlash, and a spring that remembers, alike (Tao and Kokotovic,
Adaptive Control of Systems with Actuator and Sensor Nonlinearities, 1996).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def behind_play(leads: Array, width: float) -> Array:
    """Return what follows behind a play, shape (n,); NaN stays where it is.

    Args:
        leads: what leads, shape (n,).
        width: of the whole gap, in its unit.
    """
    behind = np.full(len(leads), np.nan)
    there = np.flatnonzero(np.isfinite(leads))
    if not len(there):
        return behind
    half, place = 0.5 * width, float(leads[there[0]])
    followed = []
    for lead in leads[there].tolist():
        place = min(max(place, lead - half), lead + half)
        followed.append(place)
    behind[there] = followed
    return behind
