"""Is the jerk density that the displacement shows too large, or too small?

A real motion is smoother than white jerk at the scale of one sample. Where the force tells the
velocity better than the displacement does, the bank's density is therefore too large, and the
normalised innovations too small; a slow factor corrects that. And where noise hides from the bank
how a tool moves (a hand that trembles at 8 Hz by no more than the noise), the density is too small,
a filter lags behind, and what the force is off by now it was off by some milliseconds ago: then the
factor rises above 1, for as long as the innovations of the force go together over 3 to 20 ms
(Mehra, IEEE Trans. Automatic Control 15, 1970). Only signs are counted, for their size says nothing
of it: a noise, a law or a zero that is wrong must not pass for a tool that moves more. What is off
for as long as a press lasts cancels in a difference of two means.

Where a tool turns, what was learnt of how calm it was is forgotten: with a density of a thirtieth a
filter lost a tool that set off after seconds of slow motion, and a misfit was said.
"""

from __future__ import annotations

from typing import Any

from hc_estimator.adaptation.motion_density import LARGEST_CORRECTION, SMALLEST_CORRECTION
from hc_estimator.compilation import compiled

CORRECTION_RATE = 0.05  # per sample
LARGEST_NIS = 4.0  # one spike must not move the factor
MORE, NO_MORE = 0.8, 0.4  # from which on the tool is said to move more, and down to which
RISING_RATE = 0.02  # of that logarithm above zero, per sample
# Share of the innovations that have the sign of the difference of the means, of which white ones
# have a half: with a zero that is off up to 0.51, with a tremor that is hidden 0.55 to 0.7.
WHITE = 0.51
MEANS = (0.004, 0.016)  # of the innovations [s]
FEWEST = (1.5, 6.0)  # readings in them
# Time that the longer mean may take [s]: with fewer readings it says nothing of a tremor.
LONGEST_MEAN = 0.1


@compiled
def correct(motion: Any, nis: float, innovation: float, elapsed: float) -> None:
    """Move the slow factor by the innovations of one sample.

    Args:
        motion: changed.
        nis: normalised innovation squared of both channels; its mean is 2 when the factor is right.
        innovation: of the force, in its deviations.
        elapsed: since the last one [s].
    """
    goes_on = innovation * (motion.means[0] - motion.means[1]) > 0.0
    for i in range(2):
        share = min(elapsed / MEANS[i], 1.0 / FEWEST[i])
        motion.means[i] += share * (innovation - motion.means[i])
    moved = motion.log_correction + CORRECTION_RATE * (min(0.5 * nis, LARGEST_NIS) - 1.0)
    if motion.log_correction > 0.0 or moved > 0.0:
        way = 1.0 - WHITE if goes_on and elapsed * FEWEST[1] < LONGEST_MEAN else -WHITE
        moved = max(motion.log_correction, 0.0) + RISING_RATE * way
    motion.log_correction = min(max(moved, SMALLEST_CORRECTION), LARGEST_CORRECTION)


@compiled
def moves_more(motion: Any, so_far: bool) -> bool:
    """True where the innovations say that the tool moves more than the displacement shows."""
    return bool(motion.log_correction > (NO_MORE if so_far else MORE))


@compiled
def forget_calm(motion: Any) -> None:
    """What was learnt of a tool that moved more smoothly than white jerk says nothing of a turn."""
    motion.log_correction = max(motion.log_correction, 0.0)
