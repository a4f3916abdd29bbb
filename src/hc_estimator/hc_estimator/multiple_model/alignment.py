"""Puts displacement and force beside each other that belong to each other.

The channel that is ahead is held back by the delay in use, found by `delay` or given. The state
stands in the displacement's time: a force of stamp t belongs to the displacement of t - delay. With
samples that hold both readings the held reading nearest in time goes with the present one; what is
left between them is a small offset that the measurement function takes into account. Readings that
come alone are used alone, each at its own place in time, in order.
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.multiple_model import (
    another_place,
    batch_fit,
    beginning,
    delay_evidence,
    delay_points,
    delay_sensitivity,
    moving_fit,
    place_delay,
    plausible,
    sample,
    surface_search,
    zero_fit,
)
from hc_estimator.multiple_model import delay as delays
from hc_estimator.multiple_model import grid as grids
from hc_estimator.multiple_model.choice import choose
from hc_estimator.multiple_model.hypotheses import FITTED, is_tried
from hc_estimator.multiple_model.records import HELD
from hc_estimator.screening import ACCEPTED
from hc_estimator.specification import ParameterSpecification

BEGIN_ANEW = 0.002  # change of the delay from which on the rows begin anew [s]

SPECIFICATIONS = (
    ParameterSpecification(
        "channel_delay",
        "auto",
        "auto",
        "By how much the force is late: F(t) belongs to d(t - channel_delay). 'auto' finds it; a "
        "number is taken as it is.",
        minimum=-0.06,
        maximum=0.06,
        unit="s",
    ),
)


@compiled
def reset(settings: Any, bank: Any) -> None:
    """Nothing is held."""
    delays.reset(bank.delay)
    bank.held.count = 0
    bank.held.first = 0
    bank.held.used = 0
    take_setting(settings, bank)


@compiled
def take_setting(settings: Any, bank: Any) -> None:
    """Take a delay that is given; with 'auto' the one in use stays until a better one is found."""
    given, finder = settings.channel_delay, bank.delay
    if math.isnan(given):
        return
    if given != finder.delay:
        bank.held.first = bank.held.count
    finder.delay = given
    finder.deviation = 0.0
    finder.doubt = 0.0


@compiled
def use(settings: Any, bank: Any, time: float) -> int:
    """Use the screened sample in bank.clock, with what belongs to it; the decision on it."""
    clock, held = bank.clock, bank.held
    bank.change.detected = 0
    if clock.restart != 0:
        held.first = held.count
        # Across a short gap the parabolas only grow wider. At the start nothing is known (NaN).
        if not 0.0 < time - clock.channel_time[0] <= settings.longest_gap:
            grids.restart(bank.delay)
    for i in range(2):
        if clock.present[i] != 0:
            clock.measurement[i] -= bank.onset.zero[i]
            grids.take(bank.delay, i, time, clock.measurement[i])
    clock.offset = 0.0
    bank.given.latest_force = clock.measurement[1]
    if bank.delay.delay == 0.0:
        decision = sample.use(settings, bank, time, time, 0.0)
    elif clock.present[0] != 0 and clock.present[1] != 0:
        decision = _use_pair(settings, bank, time)
    else:
        decision = _use_single(settings, bank, time)
    if decision == ACCEPTED:
        _take_point(settings, bank)
    return decision


@compiled
def _use_pair(settings: Any, bank: Any, time: float) -> int:
    """Use a sample with both readings, of which one is held back."""
    clock, held, delay = bank.clock, bank.held, bank.delay.delay
    ahead = 0 if delay > 0.0 else 1
    _hold(held, time, clock.measurement[ahead])
    wanted = time - abs(delay)
    # After lost readings a force that is held would put the state ahead of the next displacement.
    near = clock.period if ahead == 1 and clock.period > 0.0 else clock.elapsed
    slot = _nearest(held, wanted, near)
    if slot < 0:
        clock.present[ahead] = 0
        partner = wanted
    else:
        partner = held.time[slot]
        clock.measurement[ahead] = held.value[slot]
        held.used = held.first + 1
    # The state stands where the force belongs.
    if ahead == 0:
        place = wanted
        clock.offset = partner - place
        extrapolated = 0.0
    else:
        place = partner + abs(delay) if slot >= 0 else time
        clock.offset = time - place
        extrapolated = time + abs(delay) - place
    return _use_at(settings, bank, time, place, extrapolated)


@compiled
def _use_at(settings: Any, bank: Any, time: float, place: float, extrapolated: float) -> int:
    """Use what is in bank.clock at a place in the displacement's time [s]."""
    clock = bank.clock
    if clock.started != 0:
        clock.elapsed = max(place - clock.state_time, 0.0)
    return sample.use(settings, bank, time, place, extrapolated)


@compiled
def _use_single(settings: Any, bank: Any, time: float) -> int:
    """Use a reading that comes alone, after those held back whose place lies before it."""
    clock, held, delay = bank.clock, bank.held, bank.delay.delay
    ahead = 0 if delay > 0.0 else 1
    arrived = 0 if clock.present[0] != 0 else 1
    reading = clock.measurement[arrived] + bank.onset.zero[arrived]  # the zeros may move meanwhile
    now = time - max(delay, 0.0)
    restart = clock.restart
    held.first = max(held.first, held.used)  # with the other one's, in a pair
    stamp = clock.channel_time[ahead]
    decision = ACCEPTED
    while held.first < held.count:
        slot = held.first % HELD
        place = held.time[slot] + (0.0 if ahead == 0 else abs(delay))
        if place > now:
            break
        held.first += 1
        clock.present[ahead] = 1
        clock.present[1 - ahead] = 0
        clock.measurement[ahead] = held.value[slot]
        clock.restart = restart
        restart = 0
        decision = _use_at(settings, bank, time, place, 0.0)
    clock.channel_time[ahead] = stamp  # what was held came before this sample
    clock.present[arrived] = 1
    clock.present[1 - arrived] = 0
    reading -= bank.onset.zero[arrived]
    clock.measurement[arrived] = reading
    if arrived == ahead:
        _hold(held, time, reading)
        if restart != 0:  # across a gap nothing is foretold
            bank.motion_anew = 1
            clock.state_time = now
        sample.note_held(bank, time)
        return decision
    clock.restart = restart
    return _use_at(settings, bank, time, now, 0.0)


@compiled
def _hold(held: Any, time: float, reading: float) -> None:
    """Hold a reading back; the oldest is given up where there is no room."""
    held.time[held.count % HELD] = time
    held.value[held.count % HELD] = reading
    held.count += 1
    held.first = max(held.first, held.count - HELD)


@compiled
def _nearest(held: Any, wanted: float, period: float) -> int:
    """Slot of the held reading nearest to a time, the ones before it given up; -1 if none is near.

    The next one is preferred as long as it is not far off, so that jitter of the stamps does not
    take one reading twice and leave out another.
    """
    if held.first >= held.count:
        return -1
    while held.first + 1 < held.count:
        now, following = held.time[held.first % HELD], held.time[(held.first + 1) % HELD]
        if abs(following - wanted) <= abs(now - wanted) or now < wanted - 0.75 * period:
            held.first += 1
        else:
            break
    slot = held.first % HELD
    if abs(held.time[slot] - wanted) > 2.0 * period:
        return -1
    return slot  # type: ignore[no-any-return]


@compiled
def _take_point(settings: Any, bank: Any) -> None:
    """Let the batch fit and the finder of the delay take the next point of the grid."""
    finder, rows = bank.delay, bank.rows
    before = finder.grid_count
    if bank.change.detected != 0:
        delay_points.forget(finder)
    full = grids.advance(finder)
    new = finder.grid_count > before and bank.calibrated != 0
    if new:
        surface_search.look(settings, bank)
    if new and is_tried(settings, FITTED):
        if another_place.look(settings, bank):
            beginning.begin_at_place(settings, bank)
        elif place_delay.is_found(finder, bank.place):
            bank.held.first = bank.held.count
            delay_evidence.reset(finder)
            beginning.begin_aligned(settings, bank)
            another_place.begin_in_step(bank.place)
        if batch_fit.update(settings, bank) and zero_fit.look(settings, bank):
            beginning.begin_with_zeros(settings, bank)
        elif plausible.is_no_law(settings, rows[FITTED], bank.tool):
            rows[FITTED].active = 0
        if rows[bank.judge.chosen].active == 0:
            bank.judge.chosen = 0
            choose(settings, bank.judge, rows, bank.tool, bank.tool.contact_clock)
        moving_fit.look(settings, bank)
    if full and math.isnan(settings.channel_delay):
        _look_for_delay(settings, bank)
    place_delay.note_none(finder, bank.place)


@compiled
def _look_for_delay(settings: Any, bank: Any) -> None:
    """Let the finder take the full window; begin anew with a delay that it has found."""
    finder, rows, noise = bank.delay, bank.rows, bank.sensor_noise
    before = finder.delay
    # What the innovations say is of the filter's own row, not of the fit beside it.
    row = rows[0 if bank.judge.chosen <= FITTED else bank.judge.chosen]
    refined = settings.delay_by_innovations != 0 and delay_evidence.learn(finder, rows, row)
    changes = delays.learn_window(settings, finder, noise)
    if not (changes or refined):
        return
    bank.held.first = bank.held.count
    anew = abs(finder.delay - before) > BEGIN_ANEW
    if refined or not anew:
        delay_sensitivity.correct(rows, finder.delay - before)
    if anew:
        delay_evidence.reset(finder)
        if not changes:
            delay_evidence.note_fit(finder, row)
        beginning.begin_aligned(settings, bank)
