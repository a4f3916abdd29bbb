"""What does the force read in the air by now? A sensor's zero that wanders, after the first touch.

A sensor that warms up or creeps takes its zero along (of a zero that had moved by half a per cent
of the largest force K was 1.6 % wrong, by two per cent 6 %). Wherever the tool leaves the tissue
again the zero is there to be read: where the row in charge says that the tool is surely outside,
and the force stays the same while the tool travels, for as long as it is outside. Readings of
several visits count together until their mean is significantly none: of taps that are outside for
80 ms each, and go no further than half a millimetre, as well. Then it is the zero from now
on; what was felt since the zero was known last has its share of it, by the time, and if it never
was, all of it: a sensor that nobody tared was off from the start. Where a driver tared meanwhile
it is a step; what did not fit since was that, and no error of the law. And by as much as it usually
moves from one visit to the next it is not known in between.

Not where the force changes with the place, or scatters more than the sensor does: the surface may
have moved, or the force may be late. (Ours; `contact_onset` does the same before the first touch.)
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.adaptation import noise_color
from hc_estimator.compilation import compiled
from hc_estimator.multiple_model import air_window, place_delay, zero_moves
from hc_estimator.multiple_model import search as searches
from hc_estimator.multiple_model.air_window import (
    FEWEST,
    LEAST_TRAVEL,
    SIGNIFICANT,
    SMALLEST_ZERO,
    WILDEST,
)
from hc_estimator.multiple_model.change import end_test
from hc_estimator.multiple_model.contact_onset import CAME_DOWN, LEAST_DISTANCE, SURE
from hc_estimator.multiple_model.hypotheses import DEPTH, SURFACE, VELOCITY
from hc_estimator.multiple_model.model_error import forget_misfit
from hc_estimator.multiple_model.records import STEPPED

SURELY = 3.0  # deviations of the depth
TOUCHED = 1.0  # time in contact after which the first touch is over [s]
SETTLING = 0.06  # time outside that is left to a force that is late, or to what sticks [s]
FINER = 0.5  # of a deviation at which a mean takes its place
LONGEST = 1.0  # of readings that are judged together [s]
FEWEST_CLEAR = 8  # readings that make a mean which is another zero than before, beyond doubt
AWAY = 4.0  # deviations of a reading from those before it, from which on it may be another zero
VISITS = 20.0  # whose mean square of what the zero was off counts
FORGETTING = 10.0  # time outside after which a mean begins anew [s]


@compiled
def reset(air: Any) -> None:
    """Nothing is known of the zero beyond what the first touch shows."""
    air.outside = 0.0
    air.travelled = 0
    air.known_at = math.nan
    air.confirmed = 0
    air.wander = 0.0
    air.visits = 0
    _forget(air)
    _begin(air)


@compiled
def _forget(air: Any) -> None:
    """Forget what the force was outside."""
    air.seen = 0
    air.seen_time = 0.0
    air.sum = 0.0


@compiled
def _begin(air: Any) -> None:
    """Begin another stretch outside."""
    air.time = 0.0
    air.away = 0
    air_window.clear(air.window)


@compiled
def learn(settings: Any, bank: Any, time: float) -> None:
    """Take the sample's force, and move the force's zero if it is another by now.

    Args:
        settings: settings record.
        bank: its record `air` is changed; where the zero moves, all that was remembered with it.
        time: where the sample belongs [s].
    """
    air, clock = bank.air, bank.clock
    if settings.find_zeros == 0 or bank.calibrated == 0:
        return
    # Before, it is for `contact_onset` to say.
    if bank.onset.decided == 0 and bank.tool.contact_clock < TOUCHED:
        return
    if math.isnan(air.known_at):
        air.known_at = time
    if clock.restart != 0:
        air.outside = 0.0
        air.travelled = 0
        _begin(air)
        return
    row = bank.rows[bank.judge.chosen]
    depth = row.state[DEPTH]
    if depth + SURELY * math.sqrt(row.covariance[DEPTH, DEPTH]) > -LEAST_DISTANCE:
        if air.outside > 0.0:
            _conclude(bank, time)
        air.outside = 0.0
        air.travelled = 0
        return
    air.outside += clock.elapsed
    if air.outside < SETTLING and not _comes_back_in_step(settings, bank, row):
        return
    air.time += clock.elapsed
    air.place_variance = row.covariance[DEPTH, DEPTH]
    if clock.present[1] != 0:
        _take(bank, time, depth)
    if air.time >= LONGEST:
        _conclude(bank, time)


@compiled
def _take(bank: Any, time: float, depth: float) -> None:
    """Take a force outside; several on end that are another one begin another stretch."""
    air, force = bank.air, bank.clock.measurement[1]
    off = force - air.window.mean[1]
    fewest = FEWEST_CLEAR if _is_seen(bank) else FEWEST
    if air.window.count >= fewest and off * off > AWAY**2 * bank.sensor_noise[1]:
        above = 1 if off > 0.0 else -1
        air.away = air.away + above if air.away * above > 0 else above
        if abs(air.away) < STEPPED:
            return
        zero = bank.onset.zero[1]
        _conclude(bank, time)
        _begin(air)
        force -= bank.onset.zero[1] - zero
    air.away = 0
    air_window.add(air.window, depth, force)


@compiled
def _comes_back_in_step(settings: Any, bank: Any, row: Any) -> bool:
    """True if the force is known not to be late and the tool comes back: nothing sticks to it."""
    finder = bank.delay
    if place_delay.may_be_late(settings, bank.place) and not place_delay.is_known(finder):
        return False
    late = finder.deviation if finder.deviation > 0.0 else 0.0
    return bool(row.state[VELOCITY] > 0.0 and bank.air.outside > SURELY * late)


@compiled
def _is_air(bank: Any) -> bool:
    """True if the tool went so far that the force would have changed if it had touched anything.

    What only pushes cannot pull: less than none is a zero that is off, however short the way. Of
    more than none it is for `zero_fit` to say whether that is the tissue, unless the air was seen
    before and no surface moves.
    """
    air, window = bank.air, bank.air.window
    seen = bank.onset.in_air != 0 and not SURFACE[bank.judge.chosen]
    if seen or window.mean[1] < 0.0:
        return air_window.travels_shortly(window, air.place_variance)
    return air_window.travels(window, air.place_variance, LEAST_TRAVEL)


@compiled
def _is_seen(bank: Any) -> bool:
    """True if the zero was read in the air before."""
    return bool(bank.onset.in_air != 0 or bank.air.confirmed != 0)


@compiled
def _conclude(bank: Any, time: float) -> None:
    """Judge a stretch outside, and move the zero if the mean says so; too few readings wait."""
    air, noise, window = bank.air, bank.sensor_noise, bank.air.window
    count, mean = window.count, window.mean[1]
    seen_before = _is_seen(bank)
    clear = seen_before and mean * mean > SURE * SURE * noise[1]
    if count < (FEWEST_CLEAR if clear else FEWEST):
        return
    shown = _is_air(bank)
    calm = air_window.is_calm(window, noise[1], WILDEST)
    if calm and not shown and air.travelled == 0 and air.time < FORGETTING:
        return
    of_means = noise_color.of_means(bank.color[1], bank.noise[1], noise[1])
    variance = air_window.variance_of_mean(window, of_means)
    if shown:
        air.travelled = 1 if calm and air_window.stays_the_same(window) else 0
    if calm and air.travelled != 0:
        steps = abs(mean * air.seen - air.sum)
        if steps > SIGNIFICANT * math.sqrt(variance) * air.seen:
            _forget(air)  # a step, as of a driver that tared: what was before is another zero
        air.seen += count
        air.seen_time += air.time
        air.sum += count * mean
        level, deviation = air.sum / air.seen, math.sqrt(variance * count / air.seen)
        moves = abs(level) > max(SIGNIFICANT * deviation, SMALLEST_ZERO * math.sqrt(noise[1]))
        finer = not moves and deviation < FINER * bank.onset.force_deviation
        step = abs(level) > SURE * math.sqrt(noise[1])
        if moves or finer:
            _move(bank, level, deviation)
            if finer or not seen_before:
                searches.move(bank, level, 0.0, 0.0)
            # A step is more likely to have come while nobody touched anything.
            elif not step:
                searches.move(bank, level, air.known_at, time)
            if step:  # what did not fit meanwhile was this
                for m in range(bank.rows.shape[0]):
                    forget_misfit(bank.rows[m])
                end_test(bank.change, bank.rows)
        else:
            air.confirmed = 1
        if moves or finer or air.seen_time > FORGETTING:
            if seen_before and not step:
                _note_wander(air, level)
            air.known_at = time - 0.5 * air.seen_time  # where a zero that wanders is its mean
            _forget(air)
    _begin(air)


@compiled
def _note_wander(air: Any, level: float) -> None:
    """Note by how much the zero has moved since it was seen last [N].

    All that was felt meanwhile was felt with a zero that was off the same way; growing evenly until
    now, by a third of that square in the mean.
    """
    air.visits += 1
    share = 1.0 / min(float(air.visits), VISITS)
    air.wander += share * (level * level / 3.0 - air.wander)


@compiled
def _move(bank: Any, level: float, deviation: float) -> None:
    """Let the zero be what the force reads [N], known to a deviation, from now on."""
    onset = bank.onset
    onset.in_air = max(onset.in_air, CAME_DOWN)
    onset.force_deviation = deviation
    onset.shift[0] = 0.0
    onset.shift[1] = level
    zero_moves.move_readings(bank)
