"""Settings that change while the rig runs: each glides to its target without a jump.

The glide is a critically damped second-order response, advanced exactly, so that value and slope
stay continuous and the result does not depend on the sample rate.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hc_sim_rig.compilation import inlined
from hc_sim_rig.layout import TUNE_RATE, TUNE_TARGET, TUNE_VALUE

SETTLED = 1e-9
"""Part of the way (relative to the target's size) at which a glide ends on its target."""


@inlined
def glide(tunables: NDArray[np.float64], transition_rate: float, step: float) -> None:
    """Advance all settings by one step.

    Args:
        tunables: (T, 3) array of value, slope and target, changed in place.
        transition_rate: natural frequency of the glide [1/s]; 0 takes targets at once.
        step: time step [s].
    """
    decay = math.exp(-transition_rate * step)
    for k in range(tunables.shape[0]):
        target = tunables[k, TUNE_TARGET]
        distance = tunables[k, TUNE_VALUE] - target
        slope = tunables[k, TUNE_RATE]
        if distance == 0.0 and slope == 0.0:
            continue
        if transition_rate <= 0.0:
            tunables[k, TUNE_VALUE] = target
            tunables[k, TUNE_RATE] = 0.0
            continue
        drive = slope + transition_rate * distance
        distance = (distance + drive * step) * decay
        slope = (slope - transition_rate * drive * step) * decay
        small = SETTLED * (1.0 + abs(target))
        if abs(distance) < small and abs(slope) < small * transition_rate:
            distance = 0.0
            slope = 0.0
        tunables[k, TUNE_VALUE] = target + distance
        tunables[k, TUNE_RATE] = slope
