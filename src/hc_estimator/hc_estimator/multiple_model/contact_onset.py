"""Where and at which reading does the force begin? Zeros that the first touch contradicts.

The hypotheses take both zeros as the user gave them. Before the first touch, and in it, two things
can be seen without any parameter of the tissue (ours; `hc bench accuracy delay` and `possible`):

- While the tool travels and the force stays the same, the tool is in the air, and the mean of the
  force there is its zero (`contact_level`).
- A force that comes while the tool goes deeper begins where it was last not felt; as long as the
  delay is not known, anywhere where the tool was up to 60 ms before and after. If that is before
  the zero, or so far behind it that no exponent up to `STEEPEST` would have hidden the force until
  there, the contact position is where it began. If it was there before the zero from the start, and
  grows with depth, its slope says about where.

Both are looked for until the first contact that agrees with them; what moves later on is for the
hypothesis of a moving surface. What was remembered in the old zeros is moved (`zero_moves`).

A force that steps and then stays the same while the tool goes deeper is no contact, and one that
steps while the tool rests is none either: a sensor was tared, or its cable moved. A contact grows.
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.linear_algebra import clear_vector
from hc_estimator.multiple_model import (
    air_window,
    contact_level,
    contact_rise,
    moving_delay,
    place_delay,
    position_step,
    raw_readings,
    zero_fit,
    zero_moves,
)
from hc_estimator.multiple_model import grid as grids
from hc_estimator.multiple_model.air_window import SIGNIFICANT, SMALLEST_ZERO
from hc_estimator.multiple_model.contact_level import LATEST, STEEPEST, SURELY
from hc_estimator.multiple_model.contact_rise import LARGEST_SHIFT
from hc_estimator.multiple_model.delay_records import RAW
from hc_estimator.multiple_model.hypotheses import DEPTH, SURFACE_ROW, VELOCITY, is_tried

SURE = 5.0  # deviations of the force sensor beyond which there is a force
CAME_DOWN, BETWEEN = 1, 2  # where the tool was seen in the air; see `records`
IN_A_ROW = 3  # readings that must say so
FEW, MANY = 2, 10  # readings below what is sure, and of a level beyond it
GROWTH = 1.5  # of the force since it was first sure
LARGEST_DELAY = 0.06  # of the channels while it is not known [s]
# Of the contact position from the zero; and largest deviation of the tool's place [mm].
LEAST_DISTANCE = 0.1
SPAN = 8  # readings over which the speed is taken in looking back
# Deviation of the contact position, as a share of the way that the tool has gone in since then.
HALF_WAY = 0.5  # the force became sure in between
GUESSED = 0.35  # extrapolated with an exponent that is not known
CLOSEST = 0.2  # smallest [mm]


@compiled
def reset(bank: Any) -> None:
    """Both zeros are as they were given."""
    onset = bank.onset
    clear_vector(onset.zero)
    onset.doubted = 0
    onset.force_deviation = math.nan
    position_step.reset(bank.gate)
    for m in range(bank.rows.shape[0]):
        bank.rows[m].position_deviation = 0.0
    zero_fit.reset(bank.zeros)
    restart(onset)


@compiled
def restart(onset: Any) -> None:
    """Look for the first touch anew; what was found of the zeros stays in use."""
    onset.decided = 0
    onset.looked_back = 0
    onset.about_time = math.nan
    onset.free = 0
    onset.low = 0
    onset.in_air = 0
    onset.force_seen = 0
    onset.touched = 0
    onset.contradictions = 0
    onset.first_force = 0.0
    air_window.clear(onset.window)
    air_window.clear(onset.rise)
    contact_level.reset(onset)


@compiled
def learn(settings: Any, bank: Any, time: float) -> bool:
    """Take the sample's force; True if a zero is to move by onset.shift (see `zero_moves`).

    Args:
        settings: settings record.
        bank: its record `onset` is changed.
        time: of the reading [s].
    """
    onset = bank.onset
    if onset.decided != 0 or bank.calibrated == 0:
        return False
    if moving_delay.has_moved(bank.moving, bank.tool.contact_clock):
        onset.decided = 1  # where a surface is that moves says its row, and no rise of the force
        return False
    onset.shift[0] = 0.0
    onset.shift[1] = 0.0
    if onset.looked_back == 0:
        onset.looked_back = 1
        return _look_back(settings, bank)
    row = bank.rows[bank.judge.chosen]
    state, variance = row.state, row.covariance[DEPTH, DEPTH]
    if bank.clock.present[1] == 0 or not variance < LEAST_DISTANCE * LEAST_DISTANCE:
        return False
    force, deviation = bank.clock.measurement[1], math.sqrt(variance)
    return _take(settings, bank, state[DEPTH], state[VELOCITY], force, deviation, time)


@compiled
def _look_back(settings: Any, bank: Any) -> bool:
    """Take the readings that came before the noise of the sensors was known."""
    finder, deviation = bank.delay, math.sqrt(bank.sensor_noise[0])
    count = finder.raw_count
    first = raw_readings.oldest(finder, 0)
    place = first
    for k in range(raw_readings.oldest(finder, 1), count[1]):
        time = finder.raw_time[1, k % RAW]
        while place + 1 < count[0] and finder.raw_time[0, (place + 1) % RAW] <= time:
            place += 1
        before = max(place - SPAN, first)
        after = min(before + SPAN, count[0] - 1)
        if before >= after or finder.raw_time[0, place % RAW] > time:
            continue
        way = finder.raw_value[0, after % RAW] - finder.raw_value[0, before % RAW]
        elapsed = finder.raw_time[0, after % RAW] - finder.raw_time[0, before % RAW]
        displacement = finder.raw_value[0, place % RAW]
        force = finder.raw_value[1, k % RAW]
        if _take(settings, bank, displacement, way / elapsed, force, deviation, time):
            return True
    return False


@compiled
def _take(
    settings: Any,
    bank: Any,
    displacement: float,
    velocity: float,
    force: float,
    deviation: float,
    time: float,
) -> bool:
    """Take a reading of the force, and where the tool was; True if a zero is to move."""
    onset, noise = bank.onset, bank.sensor_noise
    sure = SURE * math.sqrt(noise[1])
    side = contact_level.leaves(onset, displacement, velocity, force, time, noise[1])
    if side != 0:
        is_air = contact_level.is_air(onset, noise, sure)
        if is_air or contact_level.is_step(onset, noise, side, displacement):
            air_window.clear(onset.rise)
        else:
            contact_level.note(onset)
            if side > 0 and contact_rise.was_level(onset):
                air_window.clear(onset.rise)
        if side > 0 and not is_air and contact_level.is_floor(onset, noise, sure):
            onset.shift[1] = onset.floor
            onset.force_deviation = math.sqrt(onset.floor_variance)
            restart(onset)
            onset.looked_back = 1
            onset.in_air = BETWEEN
            return True
        air_window.clear(onset.window)
        if is_air and side > 0:
            onset.in_air = CAME_DOWN
            onset.free = 1
            onset.free_at = onset.inside_at
            onset.free_time = onset.inside_time
            level = onset.inside.mean[1]
            if abs(level) > max(SIGNIFICANT * onset.level_deviation, SMALLEST_ZERO * sure / SURE):
                onset.shift[1] = level
                onset.force_deviation = onset.level_deviation
                onset.force_seen = 0  # what was taken for a force was this zero
                onset.touched = 0
                return True
    # One reading below that of many beyond is noise: the tool was not free there.
    is_level = onset.window.count >= IN_A_ROW and onset.window.mean[1] >= sure
    if is_level and onset.low <= FEW and onset.window.count >= MANY:
        onset.free = 0  # nor was it at the very first ones
    if force < sure and not is_level:
        onset.low += 1
        onset.contradictions = 0
        onset.first_force = 0.0
        if onset.force_seen != 0:
            onset.touched = 1
        if onset.in_air != CAME_DOWN:  # else the place where the force left its mean is closer
            onset.free = 1
            onset.free_at = displacement
            onset.free_time = time
        return False
    if onset.first_force == 0.0:
        onset.first_force = force
        onset.first_time = time
    if force < SURELY * sure or not is_tried(settings, SURFACE_ROW):
        return False
    if contact_level.is_open(onset, time):
        return False
    onset.force_seen = 1
    near = LEAST_DISTANCE + SURE * deviation
    distance, lowest, highest = near, onset.free_at, displacement
    late = place_delay.may_be_late(settings, bank.place) and not place_delay.is_known(bank.delay)
    if late:
        distance += LARGEST_DELAY * abs(velocity)
    if onset.free == 0:
        surely = displacement < -distance or onset.rise.count >= IN_A_ROW
        rises = surely and contact_rise.rises(onset, displacement, force)
        # A force that is leaving what it was in the air rises as well: that is said first.
        if rises and onset.upward == 0.0:
            onset.decided = 1
            onset.shift[0] = contact_rise.extrapolated(onset)
            onset.position_deviation = GUESSED * (onset.rise.mean[0] - onset.shift[0])
            return True
        return False
    if time - onset.free_time > LATEST:
        return False
    if late:
        if not _look_about(onset, bank.delay, displacement):
            return False
        lowest, highest = onset.about[0], onset.about[1]
    if _contradicts(onset, displacement, force, sure, near, lowest, highest):
        onset.contradictions += 1
    else:
        onset.contradictions = 0
        # Elsewhere it may have begun anywhere in between, or the delay is not known yet.
        if abs(onset.free_at) < near and displacement > distance:
            onset.decided = 1
    if onset.contradictions < IN_A_ROW or force < GROWTH * onset.first_force:
        return False
    onset.decided = 1
    if abs(onset.free_at) > LARGEST_SHIFT:
        return False
    onset.shift[0] = onset.free_at
    onset.position_deviation = max(CLOSEST, HALF_WAY * (displacement - lowest))
    return True


@compiled
def _look_about(onset: Any, finder: Any, displacement: float) -> bool:
    """Note where the tool was when the force was last not felt, and first was, at any delay.

    Long ago, it went slowly: then the places of those readings will do.

    Returns:
        False as long as that is still to be read.
    """
    if onset.about_time != onset.first_time:
        lowest = grids.places_about(finder, onset.free_time, LARGEST_DELAY)[0]
        highest = grids.places_about(finder, onset.first_time, LARGEST_DELAY)[1]
        if math.isnan(lowest) or math.isnan(highest):
            return False
        onset.about[0] = lowest if math.isfinite(lowest) else onset.free_at
        onset.about[1] = highest if math.isfinite(highest) else displacement
        onset.about_time = onset.first_time
    return True


@compiled
def _contradicts(
    onset: Any,
    displacement: float,
    force: float,
    sure: float,
    near: float,
    lowest: float,
    highest: float,
) -> bool:
    """True if a force cannot be here if the contact begins at the zero, give or take a distance.

    Args:
        onset: its record.
        displacement: of now [mm].
        force: of now [N].
        sure: beyond which there is a force [N].
        near: the distance [mm].
        lowest: place at which it was last not felt, at least [mm].
        highest: place at which it was first felt, at most [mm].
    """
    if displacement <= onset.free_at:
        return False
    if highest < -near:
        return True
    # Later on a force is absent where the tool leaves faster than the tissue follows.
    if onset.in_air != CAME_DOWN or onset.touched != 0 or lowest < near:
        return False
    # No law through the zero that stays below the noise up to there rises so until here.
    return bool(force > SURELY * sure * (displacement / lowest) ** STEEPEST)


@compiled
def take_back(bank: Any) -> None:
    """A law that explains nothing: the zeros that were found are doubted, and given up for good.

    Where none was found yet the search goes on: a zero may be what the law does not explain.
    """
    onset = bank.onset
    if onset.decided == 0 and onset.zero[0] == 0.0 and onset.zero[1] == 0.0:
        return
    for i in range(2):
        onset.shift[i] = -onset.zero[i]
    zero_moves.move(bank)
    reset(bank)
    onset.decided = 1
    onset.doubted = 1
