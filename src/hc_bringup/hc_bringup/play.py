"""Play between where the position is read and the tip: a gear, a cable, a tendon with backlash.

At each turn the position moves on by the play before the tip follows, whatever the speed. For a
law that looks like a force that is late, and none is late by a distance: so each width is tried on
the law itself.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from hc_bringup.tried_on_law import explains, least_between, left_by_law
from hc_evaluation.channels import ChannelDiagnosis
from hc_evaluation.play import behind_play

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
        tips = behind_play(position_mm, play_mm)[::every]
        return left_by_law(time_s[::every], tips, force_n[::every])

    widths = np.linspace(0.0, LARGEST_SHARE, _COARSE + 1)[1:] * stroke_mm
    rests = [judged(width)[0] for width in widths]
    best = int(np.argmin(rests))
    low = widths[best - 1] if best else 0.0
    high = widths[min(best + 1, _COARSE - 1)]
    play_mm = least_between(lambda width: judged(width)[0], low, high, _FINE)
    is_one = explains(judged(play_mm), found, MOST_NOISES, LEAST_GAIN)
    return play_mm if is_one and play_mm > LEAST_SHARE * stroke_mm else 0.0
