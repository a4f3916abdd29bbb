"""Puts displacement and force beside each other that belong to each other.

The channel that is ahead is held back by the delay in use, found by `delay` or given. The state
stands in the displacement's time: a force of stamp t belongs to the displacement of t - delay. With
samples that hold both readings the held reading nearest in time goes with the present one; what is
left between them is a small offset that the measurement function takes into account. Readings that
come alone, and held ones that none goes with, are used alone, each at its own place in time, in
order. Each counts once; only the first one after a delay was taken goes with the samples shortly
before its place as well, as long as all hold both readings.
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.multiple_model import (
    another_place,
    batch_fit,
    beginning,
    delay_candidates,
    delay_evidence,
    delay_points,
    delay_sensitivity,
    held_readings,
    moving_delay,
    moving_fit,
    moving_rows,
    outliers,
    place_delay,
    plausible,
    raw_readings,
    sample,
    zero_fit,
)
from hc_estimator.multiple_model import delay as delays
from hc_estimator.multiple_model import grid as grids
from hc_estimator.multiple_model import search as searches
from hc_estimator.multiple_model.choice import choose
from hc_estimator.multiple_model.hypotheses import FITTED, is_tried
from hc_estimator.multiple_model.records import HELD
from hc_estimator.screening import ACCEPTED
from hc_estimator.specification import ParameterSpecification

BEGIN_ANEW = 0.002  # change of the delay from which on the rows begin anew [s]
NEAR = 0.75  # of the time between two samples, within which a held reading goes with a time
FIRST_NEAR = 2.0  # the same as long as none was in its place
AT_ONCE = 2  # points of the grid that are taken with one sample

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
        held_readings.hold_none(bank.held)
    finder.delay = given
    finder.deviation = 0.0
    finder.doubt = 0.0


@compiled
def use(settings: Any, bank: Any, time: float) -> int:
    """Use the screened sample in bank.clock, with what belongs to it; the decision on it."""
    clock, held = bank.clock, bank.held
    bank.change.detected = 0
    if clock.restart != 0:
        held_readings.hold_none(held)
        # Across a short gap the parabolas only grow wider. At the start nothing is known (NaN).
        if not 0.0 < time - clock.channel_time[0] <= settings.longest_gap:
            grids.restart(bank.delay)
    for i in range(2):
        if clock.present[i] != 0:
            clock.measurement[i] -= bank.onset.zero[i]
            raw_readings.take(bank.delay, i, time, clock.measurement[i])
    clock.offset = 0.0
    bank.given.latest_force = clock.measurement[1]
    if bank.delay.delay == 0.0:
        decision = sample.use(settings, bank, time, time, 0.0)
    elif clock.present[0] != 0 and clock.present[1] != 0:
        decision = _use_pair(settings, bank, time)
    else:
        decision = _use_single(settings, bank, time)
    if decision == ACCEPTED:
        _take_points(settings, bank)
    return decision


@compiled
def _ahead(bank: Any) -> int:
    """Channel that is held back: 0 the displacement, 1 the force."""
    return 0 if bank.delay.delay > 0.0 else 1


@compiled
def _use_pair(settings: Any, bank: Any, time: float) -> int:
    """Use a sample with both readings, of which one is held back."""
    clock, held, delay = bank.clock, bank.held, bank.delay.delay
    ahead = _ahead(bank)
    _hold(bank, time, ahead)
    wanted = time - abs(delay)
    # After lost readings a force that is held would put the state ahead of the next displacement.
    steady = clock.period > 0.0 and (ahead == 1 or held.used > 0)
    near = clock.period if steady else clock.elapsed
    number = held_readings.nearest(held, wanted, NEAR * near)
    if held.used > 0:
        _use_waiting(settings, bank, time, number)
        goes = held.time[number % HELD] <= wanted + NEAR * near
    else:
        held.first = number
        goes = abs(held.time[number % HELD] - wanted) <= FIRST_NEAR * near
    if goes:
        partner = held.time[number % HELD]
        clock.measurement[ahead] = held.value[number % HELD]
        if held.used > 0 or abs(partner - wanted) <= 0.5 * near:
            held.first = number + 1
            held.used = number + 1
    else:
        clock.present[ahead] = 0
        clock.channel_time[ahead] = time
        partner = wanted
    # The state stands where the force belongs.
    if ahead == 0:
        place = wanted
        clock.offset = partner - place
        extrapolated = 0.0
    else:
        place = _not_before(clock, partner + abs(delay) if goes else time)
        clock.offset = time - place
        extrapolated = time + abs(delay) - place
    return _use_at(settings, bank, time, place, extrapolated)


@compiled
def _not_before(clock: Any, place: float) -> float:
    """A place [s], or that of the state if it stands beyond: with a force that was ahead of it."""
    if clock.started == 0 or clock.restart != 0:
        return place
    return max(place, clock.state_time)  # type: ignore[no-any-return]


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
    ahead = _ahead(bank)
    restart = clock.restart
    now = time - max(delay, 0.0)
    until = held.first
    while until < held.count and _place_of(bank, until) <= now:
        until += 1
    decision = _use_waiting(settings, bank, time, until)
    held.used = max(held.used, held.first, 1)  # from now on each counts once
    if clock.present[ahead] != 0:
        _hold(bank, time, ahead)
        if restart != 0:  # across a gap nothing is foretold
            bank.motion_anew = 1
            clock.state_time = now
        sample.note_held(bank, time)
        return decision
    place = now
    if ahead == 1:
        place = _not_before(clock, now)
        clock.offset = time - place
    return _use_at(settings, bank, time, place, 0.0)


@compiled
def _hold(bank: Any, time: float, channel: int) -> None:
    """Hold back the reading of a channel."""
    is_suspect = raw_readings.is_far(bank.delay, channel, bank.delay.raw_count[channel] - 1)
    held_readings.hold(bank.held, time, bank.clock.measurement[channel], is_suspect)


@compiled
def _place_of(bank: Any, number: int) -> float:
    """Where a held reading belongs in the displacement's time [s]."""
    return bank.held.time[number % HELD] + max(-bank.delay.delay, 0.0)  # type: ignore[no-any-return]


@compiled
def _use_waiting(settings: Any, bank: Any, time: float, until: int) -> int:
    """Use the held readings up to one alone; what is in bank.clock is the sample's own afterwards.

    Args:
        settings: settings record.
        bank: changed.
        time: stamp of the sample [s].
        until: number of the first that is not used.

    Returns:
        ACCEPTED, or the reason for which the last one was refused.
    """
    clock, held, decision = bank.clock, bank.held, ACCEPTED
    if held.first >= until:
        return decision
    ahead = _ahead(bank)
    restart, stamp = clock.restart, clock.channel_time[ahead]
    present = (clock.present[0], clock.present[1])
    readings = (
        clock.measurement[0] + bank.onset.zero[0],
        clock.measurement[1] + bank.onset.zero[1],
    )
    clock.present[ahead] = 1
    clock.present[1 - ahead] = 0
    while held.first < until:
        number = held.first
        held.first += 1
        clock.measurement[ahead] = held.value[number % HELD]
        decision = _use_at(settings, bank, time, _place_of(bank, number), 0.0)
        restart = 0
        clock.restart = 0
    clock.restart = restart
    clock.channel_time[ahead] = stamp  # what was held came before this sample
    for i in range(2):
        clock.present[i] = present[i]
        clock.measurement[i] = readings[i] - bank.onset.zero[i]  # the zeros may have moved
    return decision


@compiled
def _take_points(settings: Any, bank: Any) -> None:
    """Let the batch fit and the finder of the delay take what is next in the grid.

    It waits as long as readings may turn out to be wrong; of those that are held back the gate says
    it when they are used. Where sensors are slow each reading is a point, and it has to catch up.
    """
    if bank.change.detected != 0:
        delay_points.forget(bank.delay)
    if not (outliers.waits(settings, bank) or held_readings.has_suspect(bank.held)):
        for _ in range(AT_ONCE):
            if not _take_point(settings, bank):
                break
        _go_on_searching(settings, bank)
    place_delay.note_none(bank.delay, bank.place)


@compiled
def _take_point(settings: Any, bank: Any) -> bool:
    """Take the next point of the grid; True if there was one."""
    finder, rows = bank.delay, bank.rows
    before = finder.grid_count
    full = grids.advance(finder, bank.sensor_noise)
    new = finder.grid_count > before and bank.calibrated != 0
    if new and is_tried(settings, FITTED):
        if another_place.look(settings, bank):
            beginning.begin_at_place(settings, bank)
        if place_delay.is_found(finder, bank.place):
            _begin_with_delay(settings, bank)
            another_place.begin_in_step(bank.place)
        # Zeros that are off wait better than tissue that varies, if both are to be asked.
        moving_fit.look(settings, bank)
        if batch_fit.update(settings, bank) and zero_fit.look(settings, bank):
            beginning.begin_with_zeros(settings, bank)
        elif plausible.is_no_law(settings, rows[FITTED], bank.tool):
            rows[FITTED].active = 0
        if rows[bank.judge.chosen].active == 0:
            bank.judge.chosen = 0
            choose(settings, bank.judge, rows, bank.tool, bank.tool.contact_clock)
    if full and math.isnan(settings.channel_delay):
        _look_for_delay(settings, bank)
    return bool(new)


@compiled
def _go_on_searching(settings: Any, bank: Any) -> None:
    """Take the steps that are due of what least squares are asked, and use what they find."""
    searches.let_time_pass(bank)
    while searches.is_due(bank):
        searches.spend(bank)
        if bank.delay.stage != 0:
            if delay_candidates.go_on(settings, bank.delay) and math.isnan(settings.channel_delay):
                before = bank.delay.delay
                changes = delays.take_fit(settings, bank.delay)
                _use_delay(settings, bank, before, changes, False)
            continue
        if not searches.take_step(settings, bank):
            continue
        if bank.zeros.stage != 0:
            if zero_fit.take(settings, bank):
                beginning.begin_with_zeros(settings, bank)
            continue
        moving_fit.take(settings, bank)
        in_use = bank.delay.delay
        if moving_delay.is_found(bank):
            change = bank.delay.delay - in_use
            if abs(change) > moving_delay.GOES_ON:
                _begin_with_delay(settings, bank)
            else:
                _correct_delay(bank, change)
            moving_rows.begin_moving(settings, bank)


@compiled
def _begin_with_delay(settings: Any, bank: Any) -> None:
    """Begin anew with another delay than before."""
    held_readings.hold_none(bank.held)
    delay_evidence.reset(bank.delay)
    beginning.begin_aligned(settings, bank)


@compiled
def _correct_delay(bank: Any, change: float) -> None:
    """Go on with a delay that is known better by a little [s]."""
    held_readings.hold_none(bank.held)
    delay_sensitivity.correct(bank.rows, change)
    searches.realign(bank, change)


@compiled
def _believed(bank: Any) -> Any:
    """Row whose innovations say of the delay: the filter's own, not the fit beside it."""
    return bank.rows[0 if bank.judge.chosen <= FITTED else bank.judge.chosen]


@compiled
def _look_for_delay(settings: Any, bank: Any) -> None:
    """Let the finder take the full window; begin anew with a delay that it has found."""
    finder, rows = bank.delay, bank.rows
    before = finder.delay
    row = _believed(bank)
    moves = moving_delay.has_moved(bank.moving, bank.tool.contact_clock)
    by_innovations = settings.delay_by_innovations != 0 and not moves
    refined = by_innovations and delay_evidence.learn(finder, rows, row)
    changes = delays.learn_window(settings, finder, bank.sensor_noise, moves)
    _use_delay(settings, bank, before, changes, refined)


@compiled
def _use_delay(settings: Any, bank: Any, before: float, changes: bool, refined: bool) -> None:
    """Begin anew with a delay that was found, or go on with one that is known better.

    Args:
        settings: settings record.
        bank: changed.
        before: delay that was in use [s].
        changes: True if the fit of all points says another.
        refined: True if the innovations do.
    """
    finder, rows = bank.delay, bank.rows
    if not (changes or refined):
        return
    change = finder.delay - before
    # Velocities of points are moved by a tangent: some corrections on end are too much as well.
    if abs(bank.history.realigned + change) <= BEGIN_ANEW:
        _correct_delay(bank, change)
        return
    if refined:
        delay_sensitivity.correct(rows, change)
    if not changes:
        delay_evidence.note_fit(finder, _believed(bank))
    _begin_with_delay(settings, bank)
