"""A displacement that jumped, or a channel that stands still: when is it believed?

No tool jumps, and no sensor with noise says the same number again and again: a tracker gives zeros
or its last place while it has lost its marker, an encoder has a bad contact, a network repeats what
it had. Believed, a few such readings taught a K that was ten times too high. Nor may they be
refused for good: a robot moves while its pose stands still, an encoder is zeroed. The other sensor
says which. A displacement that jumped is believed once the force is the one that the law says
there, and at the latest after half a second. What stands still where it was is believed once the
force stands still as well, as beside a tool that was stopped; what jumped there, and a force, only
when they move. Then the motion begins anew, as after readings that were lost.
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.multiple_model import grid as grids
from hc_estimator.multiple_model import position_step, raw_readings
from hc_estimator.multiple_model.delay_records import RAW
from hc_estimator.multiple_model.hypotheses import DEPTH
from hc_estimator.multiple_model.kalman import depth_of, force_at, log_force_variance

LONGEST = 0.5  # for which a displacement that jumped is not believed [s]
JUMPS_BACK = 0.5  # of the half width of the gate, that a displacement comes back by at least
AGREEING = 4  # forces in a row that agree with a displacement that jumped
STUCK_AGREEING = 10  # that agree with one that stands still, as a tool does that was stopped,
STUCK_AGREEING_TIME = 0.2  # and for how long [s]
STEPS = 3  # between readings that say a velocity
DEVIATIONS = 3.0
SAME = 4.0  # deviations within which two forces are the same
ALIKE = 0.02  # of a force, within which another one agrees,
ALIKE_MISFIT = 0.1  # and within which it does where the law does not fit
CALM = 0.05  # of a force, within which it stands still although the tissue relaxes,
CALM_TIME = 0.5  # and for how long, where a displacement has stood still for `LONGEST` [s]
IN_PLACE, ELSEWHERE = 1, 2  # a displacement stands still where it was, or where it jumped to
UNSURE = 0.3  # deviation of ln F, from which on a law says nothing
LEAST_DEPTH = 0.05  # [mm]


@compiled
def forget(gate: Any) -> None:
    """The displacement is believed."""
    gate.jumped_at = math.nan
    gate.agreeing = 0
    gate.stuck = 0


@compiled
def reset(gate: Any) -> None:
    """Both channels are believed."""
    forget(gate)
    position_step.reset(gate)
    gate.force_still = 0


@compiled
def goes_on(gate: Any) -> bool:
    """True while a displacement that jumped or stands still is not believed."""
    return not math.isnan(gate.jumped_at)


@compiled
def begins(bank: Any, channel: int, stamp: float) -> bool:
    """True if readings that were refused are not to be believed, however many they are.

    Args:
        bank: gate is changed.
        channel: 0 or 1.
        stamp: of the latest [s].
    """
    last = number_of(bank, channel, stamp)
    first = _first_refused(bank, channel, last)
    stuck = raw_readings.are_equal(bank.delay, channel, first, last)
    if stuck:
        bank.gate.refused_from[channel] = _still_from(bank, channel, last)
    if channel == 1:
        if stuck:
            _begin_force(bank, last)
        return stuck
    jumped = _has_jumped(bank, last)
    if not (stuck or jumped):
        return False
    _begin(bank, stamp, (ELSEWHERE if jumped else IN_PLACE) if stuck else 0)
    return True


@compiled
def _first_refused(bank: Any, channel: int, last: int) -> int:
    """Number of the first of the readings that were refused in a row, up to one."""
    before = last - bank.clock.outlier_counts[channel]
    return max(before, raw_readings.oldest(bank.delay, channel) + 2)  # type: ignore[no-any-return]


@compiled
def _has_jumped(bank: Any, last: int) -> bool:
    """True if the displacements that were refused, up to one, jumped."""
    return raw_readings.has_jumped(bank.delay, 0, _first_refused(bank, 0, last), last)


@compiled
def _begin(bank: Any, stamp: float, stuck: int) -> None:
    """Believe no displacement from a stamp on [s]."""
    gate = bank.gate
    gate.value = bank.clock.measurement[0]
    gate.jumped_at = stamp
    gate.agreeing = 0
    gate.stuck = stuck
    position_step.forget(gate)


@compiled
def _begin_force(bank: Any, last: int) -> None:
    """Believe no force from a reading on that stands still."""
    gate = bank.gate
    gate.still_from = _still_from(bank, 1, last)
    gate.force_value = bank.clock.measurement[1]
    gate.force_still = 1


@compiled
def stands_still(bank: Any, channel: int, stamp: float) -> bool:
    """True if a reading only repeats what a sensor said before, inside of the gate as well.

    Args:
        bank: gate is changed.
        channel: 0 or 1.
        stamp: of the reading [s].
    """
    gate, finder = bank.gate, bank.delay
    last, noise = number_of(bank, channel, stamp), bank.sensor_noise[channel]
    if channel == 1 and gate.force_still != 0:
        if bank.clock.measurement[1] == gate.force_value:
            return True
        replace_refused(bank, 1, gate.still_from, stamp, False)
        gate.force_still = 0
        return False
    still = raw_readings.stands_still(finder, channel, last, noise)
    if still and channel == 0:
        gate.refused_from[0] = _still_from(bank, 0, last)
        _begin(bank, stamp, ELSEWHERE if _has_jumped(bank, last) else IN_PLACE)
    elif still:
        _begin_force(bank, last)
    return still


@compiled
def replace_refused(bank: Any, channel: int, since: float, stamp: float, spikes: bool) -> None:
    """Let readings from one on, that was refused, up to a later one bend no point of the grid.

    Args:
        bank: raw readings are changed.
        channel: 0 or 1.
        since: stamp of the first of them [s].
        stamp: of the one that is read after them [s].
        spikes: see `raw_readings.replace_refused`.
    """
    half = 0.5 * grids.period(bank.delay, channel)
    raw_readings.replace_refused(bank.delay, channel, since - half, stamp - half, spikes)


@compiled
def _still_from(bank: Any, channel: int, last: int) -> float:
    """Stamp of the first wrong reading of a channel that stands still [s].

    That is the first which only repeats the one before it, unless that was refused before.
    """
    finder = bank.delay
    first = min(raw_readings.equal_since(finder, channel, last) + 1, last)
    stamp = finder.raw_time[channel, first % RAW]
    if bank.clock.outlier_counts[channel] > 0:
        stamp = min(stamp, bank.gate.refused_from[channel])
    return stamp  # type: ignore[no-any-return]


@compiled
def waits(gate: Any) -> bool:
    """True while readings are not believed that the grid would take."""
    return bool(goes_on(gate) or gate.force_still != 0)


@compiled
def goes_on_for_long(settings: Any, bank: Any, stamp: float) -> bool:
    """True if nobody knows where the tool is any more, for want of a displacement to believe."""
    gone = bank.clock.restart != 0 or stamp - bank.gate.jumped_at > settings.longest_gap
    return bool(goes_on(bank.gate) and gone and bank.motion_anew == 0)


@compiled
def is_found(settings: Any, bank: Any, row: Any, stamp: float) -> bool:
    """True if a displacement is believed after so long: it moves again, or by `is_believed`.

    Args:
        settings: settings record.
        bank: gate is changed.
        row: that is chosen.
        stamp: of the reading [s].
    """
    return bool(_moves(bank) or is_believed(settings, bank, row, stamp))


@compiled
def _moves(bank: Any) -> bool:
    """True if a displacement that stood still says another number."""
    return bool(bank.gate.stuck != 0 and bank.clock.measurement[0] != bank.gate.value)


@compiled
def is_back(bank: Any, stamp: float, half_width: float) -> bool:
    """True if a displacement inside of the gate came there by a jump, or moves again.

    What is not known any more grows, and with it the gate: readings that jumped are inside by
    themselves in the end.

    Args:
        bank: with the raw readings.
        stamp: of the reading [s].
        half_width: of the gate [mm].
    """
    finder, here = bank.delay, number_of(bank, 0, stamp)
    if bank.gate.stuck != 0:
        return _moves(bank)
    if here <= raw_readings.oldest(finder, 0):
        return False
    step = finder.raw_value[0, here % RAW] - finder.raw_value[0, (here - 1) % RAW]
    return bool(abs(step) > JUMPS_BACK * half_width)


@compiled
def is_believed(settings: Any, bank: Any, row: Any, stamp: float) -> bool:
    """True if what a displacement says is to be believed by now.

    Args:
        settings: settings record.
        bank: gate is changed.
        row: that is chosen.
        stamp: of the reading [s].
    """
    gate, here = bank.gate, number_of(bank, 0, stamp)
    if _moves(bank):
        _begin(bank, stamp, 0)  # it goes on, maybe somewhere else
    if gate.stuck == 0 and not stamp - gate.jumped_at < LONGEST:
        return True
    clock = bank.clock
    force = clock.measurement[1] if clock.present[1] != 0 else bank.given.latest_force
    for_long = gate.stuck == IN_PLACE and stamp - gate.jumped_at >= LONGEST
    agrees = for_long or _agrees(settings, bank, row, here, force)
    if gate.stuck != 0 and gate.agreeing > 0:
        # Beside a tool at rest the force stays what it is, but for its noise.
        within = SAME * math.sqrt(2.0 * bank.sensor_noise[1])
        if for_long:
            within += CALM * abs(gate.agrees_force)
        agrees = agrees and 0.0 < abs(force - gate.agrees_force) < within
    if not agrees:
        gate.agreeing = 0
        return False
    if gate.agreeing == 0:
        gate.agrees_from = stamp
        gate.agrees_force = force
    gate.agreeing += 1
    if gate.stuck == 0:
        return bool(gate.agreeing >= AGREEING)
    long = stamp - gate.agrees_from >= (CALM_TIME if for_long else STUCK_AGREEING_TIME)
    return bool(long and gate.agreeing >= STUCK_AGREEING)


@compiled
def _agrees(settings: Any, bank: Any, row: Any, here: int, force: float) -> bool:
    """True if the force is the one that the law says at a displacement and its velocity.

    Args:
        settings: settings record.
        bank: with the readings.
        row: whose law it is.
        here: number of the displacement.
        force: [N].
    """
    finder = bank.delay
    values, fastest = finder.raw_value[0], math.sqrt(bank.maneuver.square_speed)
    slow, fast = -fastest, fastest
    before = here - min(bank.gate.agreeing, STEPS)
    if raw_readings.oldest(finder, 0) <= before < here:
        elapsed = finder.raw_time[0, here % RAW] - finder.raw_time[0, before % RAW]
        velocity = raw_readings.slope_between(finder, 0, before, here)
        spread = DEVIATIONS * math.sqrt(2.0 * bank.sensor_noise[0]) / elapsed
        slow = min(max(velocity - spread, -fastest), fastest)
        fast = min(max(velocity + spread, -fastest), fastest)
    depth = values[here % RAW] - (row.state[DEPTH] - depth_of(row))
    log_depth = math.log(max(depth, LEAST_DEPTH))
    unsure = log_force_variance(row, log_depth)
    if not unsure < UNSURE * UNSURE:
        return False
    low = force_at(settings, row, depth, slow)
    high = force_at(settings, row, depth, fast)
    within = SAME * math.sqrt(bank.sensor_noise[1] + row.model_error)
    alike = ALIKE_MISFIT if row.model_error > 0.0 else ALIKE
    within += (alike + DEVIATIONS * math.sqrt(max(unsure, 0.0))) * high
    return bool(low - within <= force <= high + within)


@compiled
def number_of(bank: Any, channel: int, stamp: float) -> int:
    """Number of the reading of a stamp [s]."""
    half = 0.5 * grids.period(bank.delay, channel)
    return raw_readings.latest_up_to(bank.delay, channel, stamp + half)
