"""Play between where the position is read and the tip: a gear, a cable, a tendon with backlash.

At each turn the position moves on by the play before the tip follows, whatever the speed. For a
law that looks like a force that is late, and none is late by a distance: so each width is tried on
the law itself. (Backlash as an operator: Tao and Kokotovic, Adaptive Control of Systems with
Actuator and Sensor Nonlinearities, 1996.)
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from hc_evaluation.channels import ChannelDiagnosis, diagnose_channels

Array = NDArray[np.float64]

MOST_NOISES: Final = 1.5
"""What the law may leave of the force with the play taken off, for it to fit."""
LEAST_GAIN: Final = 4.0
"""Times by which it leaves less than with a delay and other zeros, beyond the noise and by mean
square."""
LEAST_SHARE: Final = 0.01
LARGEST_SHARE: Final = 0.4
"""Of the stroke."""
_COARSE: Final = 8
_FINE: Final = 10
_ROWS: Final = 4000
"""That a width is tried on."""
_GOLDEN: Final = (5.0**0.5 - 1.0) / 2.0


def behind_play(position_mm: Array, play_mm: float) -> Array:
    """Return where the tip is behind a play of this width [mm], shape (n,); NaN stays where it is.

    Args:
        position_mm: what is read [mm], shape (n,).
        play_mm: whole width [mm].
    """
    tips = np.full(len(position_mm), np.nan)
    there = np.flatnonzero(np.isfinite(position_mm))
    if not len(there):
        return tips
    half, tip = 0.5 * play_mm, float(position_mm[there[0]])
    followed = []
    for place in position_mm[there].tolist():
        tip = min(max(tip, place - half), place + half)
        followed.append(tip)
    tips[there] = followed
    return tips


def find_play(even: tuple[Array, Array, Array], found: ChannelDiagnosis) -> float:
    """Return the width of the play that explains what a delay and zeros do not [mm]; 0 for none.

    Args:
        even: evenly spaced stamps [s], penetration [mm] and force [N], each of shape (n,).
        found: what the law leaves with a delay and other zeros.
    """
    looks_late = "delay" in found.clear_faults and found.delay_s > 0.0
    if not looks_late or found.residual_rms_n <= MOST_NOISES * found.noise_n:
        return 0.0
    time_s, position_mm, force_n = even
    every = max(1, len(time_s) // _ROWS)
    stroke_mm = float(np.ptp(position_mm))

    def judged(play_mm: float) -> tuple[float, float]:
        """Return what the law leaves at the force's own stamps [N], and the noise [N]."""
        tips = behind_play(position_mm, play_mm)[::every]
        try:
            tried = diagnose_channels(time_s[::every], tips, force_n[::every])
        except ValueError:  # nothing moves any more
            return float("inf"), 0.0
        return tried.residual_rms_without_n, tried.noise_n

    widths = np.linspace(0.0, LARGEST_SHARE, _COARSE + 1)[1:] * stroke_mm
    rests = [judged(width)[0] for width in widths]
    best = int(np.argmin(rests))
    low = widths[best - 1] if best else 0.0
    high = widths[min(best + 1, _COARSE - 1)]
    play_mm = _least(lambda width: judged(width)[0], low, high)
    rest_n, noise_n = judged(play_mm)
    here, with_faults = (max(n**2 - noise_n**2, 0.0) for n in (rest_n, found.residual_rms_n))
    explains = rest_n < MOST_NOISES * noise_n and LEAST_GAIN * here < with_faults
    return play_mm if explains and play_mm > LEAST_SHARE * stroke_mm else 0.0


def _least(of: Callable[[float], float], low: float, high: float) -> float:
    """Return where a function with one valley is least, by golden sections."""
    one, other = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
    at_one, at_other = of(one), of(other)
    for _ in range(_FINE):
        if at_one < at_other:
            high, other, at_other = other, one, at_one
            one = high - _GOLDEN * (high - low)
            at_one = of(one)
        else:
            low, one, at_one = one, other, at_other
            other = low + _GOLDEN * (high - low)
            at_other = of(other)
    return 0.5 * (low + high)
