"""A force that was there before the zero, and grows with the depth: where does it begin?

Of a tool that starts in contact nobody saw the onset; the slope of the force says about where it
is, for the exponent of a sphere. What the force was while it stayed the same is no part of its rise
(`contact_onset`; ours).
"""

from __future__ import annotations

from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.multiple_model import air_window
from hc_estimator.multiple_model.air_window import FEWEST

FEWEST_RISING = 8  # readings of a force before the zero that was never seen free
LEAST_RISE = 0.5  # of such a force, as a share of its mean
CLEAR = 8.0  # deviations of its slope
SPHERE = 1.5  # exponent (Hertz 1881)
LARGEST_SHIFT = 20.0  # of a contact position; one further off is not set up [mm]


@compiled
def rises(onset: Any, displacement: float, force: float) -> bool:
    """Take a force that was there before the zero; True if it clearly grows with depth."""
    rise = onset.rise
    mean, moment = rise.mean, rise.moment
    if rise.count == 0:
        onset.rise_lowest = force
        onset.rise_highest = force
    onset.rise_lowest = min(onset.rise_lowest, force)
    onset.rise_highest = max(onset.rise_highest, force)
    air_window.add(rise, displacement, force)
    if rise.count < FEWEST_RISING or moment[1] <= 0.0:
        return False
    if onset.rise_highest - onset.rise_lowest < LEAST_RISE * mean[1]:
        return False
    left = max(moment[2] - moment[1] * moment[1] / moment[0], 0.0) / (rise.count - 2)
    if not moment[1] * moment[1] > CLEAR**2 * left * moment[0]:
        return False
    beyond = mean[0] - extrapolated(onset)
    return bool(beyond < LARGEST_SHIFT)


@compiled
def extrapolated(onset: Any) -> float:
    """Where a force that rises so begins, for the exponent of a sphere on an elastic half space."""
    mean, moment = onset.rise.mean, onset.rise.moment
    return mean[0] - SPHERE * mean[1] / (moment[1] / moment[0])  # type: ignore[no-any-return]


@compiled
def was_level(onset: Any) -> bool:
    """True if the force stayed the same in the window, and rises from here.

    Else a straight line through a second at rest, and three readings of a quick press, begins
    millimetres above the tissue.
    """
    return bool(onset.inside.count >= FEWEST and air_window.stays_the_same(onset.inside))
