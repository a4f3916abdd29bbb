"""Where does the force stay the same while the tool moves, and is that the air?

A tissue that pushed with as much would have pushed more, deeper. The window in which the force
stays the same ends where a cumulative sum of its deviations says so (CUSUM; Page, Biometrika 41,
1954). After a contact it is the air where the force comes back to its floor (`contact_onset`;
ours).
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.multiple_model import air_window
from hc_estimator.multiple_model.air_window import FEWEST, SAME, SIGNIFICANT

# Two-sided cumulative sum of the force about its mean: in the air it passes once in 1e5 readings.
DRIFT = 0.5  # deviations
THRESHOLD = 12.0
LARGEST_TERM = 4.0  # one spike is no onset
SETTLING = 5  # readings in the mean before one can leave it
RESTING = 8.0  # deviations of the displacement sensor within which a tool is that rests
DOWN = 0.8  # share of its travel in the air below which the tool was when the force came
WILDEST = 4.0  # scatter of a working sensor in the air over its noise variance
SURELY = 2.0  # forces that are sure, one beyond doubt
FEWEST_AGAIN, LEAST_AGAIN = 10, 0.2  # readings and travel in the air between two contacts [mm]
FLOOR_SHARE = 0.05  # of the largest force, that a zero is off at most
STEEPEST = 3.0  # exponent of a tissue
LATEST = 3.0  # time within which a contact is waited for, or a second visit to the floor [s]
NOWHERE = 1e9  # [N]


@compiled
def reset(onset: Any) -> None:
    """No level of the force is known."""
    onset.highest_level = -NOWHERE
    onset.highest_at = 0.0
    onset.lowest_level = NOWHERE
    onset.floor = 0.0
    onset.floor_variance = 0.0


@compiled
def note(onset: Any) -> None:
    """Note the highest and the lowest level of the force: a floor that was higher is none."""
    window = onset.window
    if window.mean[1] > onset.highest_level:
        onset.highest_level = window.mean[1]
        onset.highest_at = window.mean[0]
    if window.count >= SETTLING:
        onset.lowest_level = min(onset.lowest_level, window.mean[1])


@compiled
def leaves(
    onset: Any, displacement: float, velocity: float, force: float, time: float, variance: float
) -> int:
    """Take a reading into the window in which the force stays the same.

    Returns:
        1 or -1 if the force has left the window upwards or downwards, else 0.
    """
    window, inside = onset.window, onset.inside
    if window.count == 0:
        onset.upward = 0.0
        onset.downward = 0.0
        air_window.clear(inside)
        onset.fastest = velocity
    if window.count >= SETTLING:
        term = (force - window.mean[1]) / math.sqrt(variance)
        term = min(max(term, -LARGEST_TERM), LARGEST_TERM)
        onset.upward = max(onset.upward + term - DRIFT, 0.0)
        onset.downward = max(onset.downward - term - DRIFT, 0.0)
    air_window.add(window, displacement, force)
    onset.fastest = max(onset.fastest, velocity)
    if onset.upward == 0.0:  # what came before an onset
        air_window.copy(window, inside)
        onset.air_slowing = onset.fastest - velocity
        onset.air_fastest = onset.fastest
        onset.inside_at = displacement
        onset.inside_time = time
        onset.inside_variance = variance  # a step makes the sensor seem noisier
    if onset.upward > THRESHOLD:
        return 1
    return -1 if onset.downward > THRESHOLD else 0


@compiled
def is_step(onset: Any, noise: Any, side: int, displacement: float) -> bool:
    """True if the force left the window as no tissue lets it: at rest, or down on the way down."""
    window = onset.window
    way = window.highest - window.lowest
    if window.count >= FEWEST and way <= RESTING * math.sqrt(noise[0]):
        return True
    return bool(side < 0 and displacement >= window.lowest + DOWN * way)


@compiled
def is_air(onset: Any, noise: Any, sure: float) -> bool:
    """True if the tool came down in the window and nothing pushed; notes the mean's deviation.

    Not after a contact, for there the force may stay the same where a tool retreats as fast as the
    tissue follows.

    Args:
        onset: its record.
        noise: variances of displacement and force [mm^2], [N^2].
        sure: beyond which there is a force [N].
    """
    inside, mean = onset.inside, onset.inside.mean
    way = inside.highest - inside.lowest
    if inside.count < FEWEST or not air_window.travels(inside, noise[0], air_window.LEAST_TRAVEL):
        return False
    if onset.highest_level > mean[1] + SURELY * sure:
        return False
    if onset.inside_at < onset.window.lowest + DOWN * way:
        return False
    if not air_window.is_calm(inside, onset.inside_variance, WILDEST):
        return False
    scatter = air_window.scatter_of(inside)
    onset.level_deviation = math.sqrt(scatter / inside.count)
    if not air_window.stays_the_same(inside):
        return False
    if mean[0] <= 0.0 or mean[1] < SIGNIFICANT * onset.level_deviation:
        return True
    # What a tissue pushes more with the depth, it may push less as the tool slows down.
    if onset.air_slowing * mean[0] > onset.air_fastest * way:
        return False
    # A tissue that pushed so would push at least in proportion to the depth.
    return air_window.would_show(inside, mean[1] / mean[0])


@compiled
def is_floor(onset: Any, noise: Any, sure: float) -> bool:
    """True if the force came down to this level twice and never lower, however hard it pushed.

    What only pushes cannot push less than nothing: that level is the force's zero, whether the tool
    was in the air or the tissue could not follow. A zero that is off makes the tissue seem to begin
    elsewhere, where a surface breathes another place each time: of taps on such a one the force was
    never seen free, for minutes, with nothing on the tool for a third of the time.

    Args:
        onset: its record; floor and floor_variance become those of both visits together.
        noise: variances of displacement and force [mm^2], [N^2].
        sure: beyond which there is a force [N].
    """
    inside, level = onset.inside, onset.inside.mean[1]
    # On the way back damping may hide what the depth does to a force.
    if inside.count < FEWEST_AGAIN or onset.inside_at - inside.lowest < LEAST_AGAIN:
        return False
    if not air_window.travels(inside, noise[0], LEAST_AGAIN):
        return False
    if onset.highest_level <= level + SURELY * sure or level > onset.lowest_level + sure:
        return False
    # A force within the noise is no reason to look for another zero.
    if not sure < abs(level) < FLOOR_SHARE * onset.highest_level:
        return False
    if not air_window.is_calm(inside, onset.inside_variance, WILDEST):
        return False
    if not air_window.stays_the_same(inside) or _may_be_tissue(onset, level):
        return False
    variance, before = air_window.scatter_of(inside) / inside.count, onset.floor_variance
    off = level - onset.floor
    again = before > 0.0 and off * off < SAME * SAME * (variance + before)
    share = before / (before + variance) if again else 1.0
    onset.floor += share * off
    onset.floor_variance = share * variance
    onset.floor_time = onset.inside_time
    return bool(again)


@compiled
def _may_be_tissue(onset: Any, level: float) -> bool:
    """True if a tissue that pushes so much might not have been seen to push more on the way.

    With the highest force where that was, the least slope of a law d^n with n up to `STEEPEST`.
    """
    inside, way = onset.inside, onset.highest_at - onset.inside.mean[0]
    if level < 0.0:
        return False
    if not way > 0.0:
        return True
    steps = (onset.highest_level / level) ** (1.0 / STEEPEST) - 1.0
    return not air_window.would_show(inside, STEEPEST * steps * level / way)


@compiled
def is_open(onset: Any, time: float) -> bool:
    """True if the force has been down to a level that is not zero, once, and not long ago."""
    return bool(onset.floor_variance > 0.0 and time - onset.floor_time < LATEST)
