"""Where and at which reading does the force begin? Zeros that the first touch contradicts.

The hypotheses take both zeros as the user gave them. Before the first touch, and in it, two things
can be seen without any parameter of the tissue (ours; `hc bench accuracy delay` and `possible`):

- While the tool travels and the force stays the same, the tool is in the air, and the mean of the
  force there is its zero. A tissue that pushed with as much would have pushed more, deeper.
- A force that comes while the tool goes deeper begins where it was last not felt. If that is before
  the zero, or so far behind it that no exponent up to `STEEPEST` would have hidden the force until
  there, the contact position is where it began.

Both are looked for until the first contact that agrees with them; later on `surface` hypotheses
follow what moves. What was remembered in the old zeros is moved to the new ones.
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.multiple_model.hypotheses import DEPTH, VELOCITY

SURE = 5.0  # deviations of the force sensor beyond which there is a force
IN_A_ROW = 3  # readings that must say so
FEWEST = 20  # readings in the air that make a mean
LEAST_TRAVEL = 0.5  # in the air [mm]
TRAVEL_DEVIATIONS = 20.0  # the same in deviations of the displacement sensor
SAME = 4.0  # deviations of the slope of the force over the way up to which it is none
CALMEST, WILDEST = 0.05, 4.0  # scatter of a working sensor in the air over its noise variance
SIGNIFICANT = 5.0  # deviations of the mean force from which on it is a zero that is off
SMALLEST_ZERO = 0.2  # deviations of a reading below which no zero is moved
STEEPEST = 3.0  # exponent of a tissue
SURELY = 2.0  # factor on the force that a law through the zero allows
LARGEST_DELAY = 0.06  # of the channels while it is not known [s]
LEAST_DISTANCE = 0.1  # of the contact position from the zero [mm]
LATEST = 3.0  # time from the last reading without force within which it must come [s]


@compiled
def reset(onset: Any) -> None:
    """Both zeros are as they were given."""
    for i in range(2):
        onset.zero[i] = 0.0
    onset.force_deviation = math.nan
    restart(onset)


@compiled
def restart(onset: Any) -> None:
    """Look for the first touch anew; what was found of the zeros stays in use."""
    onset.decided = 0
    onset.free = 0
    onset.in_air = 0
    onset.contradictions = 0
    _begin_window(onset)


@compiled
def _begin_window(onset: Any) -> None:
    onset.count = 0
    onset.outside = 0


@compiled
def learn(settings: Any, bank: Any, time: float) -> bool:
    """Take the sample's force; True if a zero is to move by onset.shift (see `move_zeros`).

    Args:
        settings: settings record.
        bank: its record `onset` is changed.
        time: of the reading [s].
    """
    onset, noise = bank.onset, bank.sensor_noise
    if onset.decided != 0 or bank.clock.present[1] == 0:
        return False
    row, force = bank.rows[bank.judge.chosen], bank.clock.measurement[1]
    displacement = row.state[DEPTH]
    sure = SURE * math.sqrt(noise[1])
    onset.shift[0] = 0.0
    onset.shift[1] = 0.0
    known = bank.calibrated != 0
    if known and _leaves_window(onset, displacement, force, time, sure):
        level = onset.mean[1]
        is_air = _is_air(onset, noise) and force > level
        _begin_window(onset)
        if is_air:
            onset.in_air = 1
            if abs(level) > max(SIGNIFICANT * onset.level_deviation, SMALLEST_ZERO * sure / SURE):
                onset.shift[1] = level
                onset.force_deviation = onset.level_deviation
                onset.free = 1
                onset.free_at = onset.inside_at
                onset.free_time = onset.inside_time
                return True
    if force < sure:
        onset.free = 1
        onset.free_at = displacement
        onset.free_time = time
        onset.contradictions = 0
        return False
    if onset.free == 0 or not known:
        return False
    if time - onset.free_time > LATEST:
        onset.free = 0
        return False
    if force < SURELY * sure:
        return False
    distance = LEAST_DISTANCE + SURE * math.sqrt(noise[0])
    if math.isnan(settings.channel_delay) and math.isnan(bank.delay.deviation):
        distance += LARGEST_DELAY * abs(row.state[VELOCITY])
    begun = onset.free_at
    if displacement > begun and displacement < -distance:
        onset.contradictions += 1
    elif onset.in_air != 0 and begun > distance and _is_too_steep(displacement, force, begun, sure):
        onset.contradictions += 1
    else:
        onset.contradictions = 0
        if displacement > max(STEEPEST * begun, distance):
            onset.decided = 1
    if onset.contradictions < IN_A_ROW:
        return False
    onset.decided = 1
    onset.shift[0] = begun
    return True


@compiled
def _leaves_window(onset: Any, displacement: float, force: float, time: float, sure: float) -> bool:
    """Take a reading into the window in which the force stays the same; True if it has left it."""
    mean, moment = onset.mean, onset.moment
    if onset.count > 0 and abs(force - mean[1]) > sure:
        onset.outside += 1
        return onset.outside >= IN_A_ROW  # type: ignore[no-any-return]
    onset.outside = 0
    if onset.count == 0:
        onset.lowest = displacement
        onset.highest = displacement
        mean[0] = displacement
        mean[1] = force
        for i in range(3):
            moment[i] = 0.0
        onset.count = 1
        return False
    onset.lowest = min(onset.lowest, displacement)
    onset.highest = max(onset.highest, displacement)
    onset.inside_at = displacement
    onset.inside_time = time
    onset.count += 1
    way, change = displacement - mean[0], force - mean[1]
    mean[0] += way / onset.count
    mean[1] += change / onset.count
    moment[0] += way * (displacement - mean[0])
    moment[1] += way * (force - mean[1])
    moment[2] += change * (force - mean[1])
    return False


@compiled
def _is_air(onset: Any, noise: Any) -> bool:
    """True if the tool travelled in the window and nothing pushed; notes the mean's deviation."""
    travel = onset.highest - onset.lowest
    if onset.count < FEWEST:
        return False
    if travel < max(LEAST_TRAVEL, TRAVEL_DEVIATIONS * math.sqrt(noise[0])):
        return False
    scatter = onset.moment[2] / (onset.count - 1)
    if scatter < CALMEST * noise[1] or scatter > WILDEST * noise[1]:
        return False
    onset.level_deviation = math.sqrt(scatter / onset.count)
    slope = onset.moment[1] / onset.moment[0]
    deviation = math.sqrt(scatter / onset.moment[0])
    if abs(slope) > SAME * deviation:
        return False
    # A tissue that pushed so would push at least in proportion to the depth.
    middle = onset.mean[0]
    return bool(
        middle <= 0.0
        or abs(onset.mean[1]) < SURE * onset.level_deviation
        or onset.mean[1] < 0.0
        or onset.mean[1] / middle > 2.0 * SAME * deviation
    )


@compiled
def _is_too_steep(displacement: float, force: float, begun: float, sure: float) -> bool:
    """True if no law through the zero that stays unfelt up to a depth rises so until now."""
    return force > SURELY * sure * (displacement / begun) ** STEEPEST and displacement > begun


@compiled
def move_zeros(bank: Any) -> None:
    """Move the zeros by onset.shift, and with them all readings that are remembered."""
    onset, finder, held = bank.onset, bank.delay, bank.held
    for i in range(2):
        shift = onset.shift[i]
        if shift == 0.0:
            continue
        onset.zero[i] += shift
        bank.noise[i].readings -= shift
        finder.raw_value[i] -= shift
        column = 0 if i == 0 else 3
        finder.grid[:, column] -= shift
        if (finder.delay > 0.0) == (i == 0):
            held.value -= shift
    displacement, force = onset.shift[0], onset.shift[1]
    for m in range(bank.rows.shape[0]):
        bank.rows[m].state[DEPTH] -= displacement
    bank.motion.first -= displacement
    bank.motion.states[:, 0] -= displacement
    onset.free_at -= displacement
    bank.given.predicted_force -= force
    bank.given.reconstructed_force -= force
