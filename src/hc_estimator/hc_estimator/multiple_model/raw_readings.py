"""The raw readings of both channels: a ring each, of which `grid` makes its points.

Here are those that the gate has refused (`outliers`) told from those beside them, replaced or taken
out: a single wrong reading of 3 mm bends three points of the grid, and half a second of those that
are smoothed. A delay of 10 to 40 ms was found that was none.
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.multiple_model.delay_records import RAW

# A reading is far from the others beyond so many times the RMS bend of the calmest of some blocks.
FAR = 8.0
CALM, CALM_BLOCKS = 16, 2
BACK = 0.5  # share of the largest bend, where a place jumped, that it and the next one have
SPIKE = 3.0  # times the steps beside it, beyond which a force is a spike
FEWEST_EQUAL = 3  # steps in a row that are none
LOOKED_AT = 64  # steps before them that say how likely that is
ROUNDING = 1e-6  # share of the noise's variance, below which a square is of arithmetic
LOG_CHANCE = -12.0  # logarithm of a chance that is none: a reading in minutes is lost by it
ON_A_LINE = 2  # refused readings in a row that are replaced; more of them are taken out


@compiled
def restart(finder: Any, channel: int) -> None:
    """Remember no reading."""
    finder.raw_count[channel] = 0
    finder.raw_first[channel] = 0


@compiled
def take(finder: Any, channel: int, time: float, reading: float) -> None:
    """Take a raw reading."""
    count = finder.raw_count[channel]
    if count > 0 and time <= finder.raw_time[channel, (count - 1) % RAW]:
        return
    finder.raw_time[channel, count % RAW] = time
    finder.raw_value[channel, count % RAW] = reading
    finder.raw_count[channel] = count + 1


@compiled
def oldest(finder: Any, channel: int) -> int:
    """Number of the oldest reading that is remembered."""
    return max(finder.raw_count[channel] - RAW, finder.raw_first[channel])  # type: ignore[no-any-return]


@compiled
def count_of(finder: Any, channel: int) -> int:
    """How many readings are remembered."""
    return finder.raw_count[channel] - oldest(finder, channel)  # type: ignore[no-any-return]


@compiled
def latest_up_to(finder: Any, channel: int, time: float) -> int:
    """Number of the latest reading up to a time [s]; of those that are all later, the oldest."""
    k, first = finder.raw_count[channel] - 1, oldest(finder, channel)
    while k > first and finder.raw_time[channel, k % RAW] > time:
        k -= 1
    return k  # type: ignore[no-any-return]


@compiled
def is_far(finder: Any, channel: int, number: int) -> bool:
    """True if a reading lies far from where the two before it lead.

    Beside the calmest of some readings before.
    """
    blocks = min(CALM_BLOCKS, (number - 2 - oldest(finder, channel)) // CALM)
    if blocks < 1:
        return False
    calmest = math.inf
    for block in range(blocks):
        total = 0.0
        for k in range(number - CALM * (block + 1), number - CALM * block):
            total += _bend(finder, channel, k) ** 2
        calmest = min(calmest, total / CALM)
    return bool(_bend(finder, channel, number) ** 2 > FAR**2 * calmest)


@compiled
def has_jumped(finder: Any, channel: int, first: int, last: int) -> bool:
    """True if one of some readings, far from those before, is no motion that begins.

    Where a tool sets off the bends add up; where a reading jumps the next one bends back.
    """
    largest = 0.0
    for k in range(first, last + 1):
        largest = max(largest, abs(_bend(finder, channel, k)))
    for k in range(first, last):
        here, then = _bend(finder, channel, k), _bend(finder, channel, k + 1)
        back = here * then < 0.0 and abs(then) > BACK * abs(here)
        if back and abs(here) > BACK * largest and is_far(finder, channel, k):
            return True
    return False


@compiled
def are_equal(finder: Any, channel: int, first: int, last: int) -> bool:
    """True if some readings are all the same number."""
    values = finder.raw_value[channel]
    for k in range(first, last):
        if values[k % RAW] != values[(k + 1) % RAW]:
            return False
    return bool(first < last)


@compiled
def equal_since(finder: Any, channel: int, last: int) -> int:
    """Number of the first reading that is the same as one and all after it."""
    values, first = finder.raw_value[channel], last
    while first > oldest(finder, channel) and values[(first - 1) % RAW] == values[last % RAW]:
        first -= 1
    return first


@compiled
def stands_still(finder: Any, channel: int, last: int, noise: float) -> bool:
    """True if a reading repeats those before it as no sensor with that noise does.

    Where the noise is less than what the readings are rounded to, they repeat at rest. Beyond that
    by the share of those that do.

    Args:
        finder: with the readings.
        channel: 0 or 1.
        last: number of the reading.
        noise: variance of the sensor [mm^2] or [N^2].
    """
    values, oldest_one = finder.raw_value[channel], oldest(finder, channel)
    if last - FEWEST_EQUAL < oldest_one or not are_equal(
        finder, channel, last - FEWEST_EQUAL, last
    ):
        return False
    first = equal_since(finder, channel, last)
    if first - 2 - LOOKED_AT < oldest_one:
        return False
    repeats, finest = 0, math.inf
    for k in range(first - 1 - LOOKED_AT, first - 1):
        before, here, after = values[(k - 1) % RAW], values[k % RAW], values[(k + 1) % RAW]
        repeats += 1 if after == here else 0
        # However fast the tool moves, rounded readings bend by multiples of what they round to.
        bend = (after - here - (here - before)) ** 2
        if bend > ROUNDING * noise:
            finest = min(finest, bend)
    share = max(repeats / LOOKED_AT, 1.0 / LOOKED_AT)
    return bool(finest < noise and (last - first) * math.log(share) < LOG_CHANCE)


@compiled
def slope_between(finder: Any, channel: int, first: int, last: int) -> float:
    """Mean rate of a channel between two readings [mm/s] or [N/s]."""
    times, values = finder.raw_time[channel], finder.raw_value[channel]
    change = values[last % RAW] - values[first % RAW]
    return change / (times[last % RAW] - times[first % RAW])  # type: ignore[no-any-return]


@compiled
def change_between(finder: Any, channel: int, first: int, last: int, slope: float) -> float:
    """By how much a later reading lies beside a rate through an earlier one [mm] or [N]."""
    times, values = finder.raw_time[channel], finder.raw_value[channel]
    elapsed = times[last % RAW] - times[first % RAW]
    return values[last % RAW] - values[first % RAW] - slope * elapsed  # type: ignore[no-any-return]


@compiled
def _bend(finder: Any, channel: int, number: int) -> float:
    """How far a reading lies from the line through the two before it [mm] or [N]."""
    slope = slope_between(finder, channel, number - 2, number - 1)
    return change_between(finder, channel, number - 1, number, slope)


@compiled
def replace_refused(finder: Any, channel: int, after: float, until: float, spikes: bool) -> None:
    """Let readings that were refused bend no point of the grid.

    A few lie on the line between those beside them from now on, more are taken out: then the grid
    deals with them as with others that were lost.

    Args:
        finder: changed.
        channel: 0 or 1.
        after: time up to which the last reading before them was [s].
        until: time up to which the last of them was [s]; a later one was read.
        spikes: True if only what is far from both beside it was wrong: a force may jump.
    """
    times, values = finder.raw_time[channel], finder.raw_value[channel]
    first = oldest(finder, channel)
    last, end = latest_up_to(finder, channel, after), latest_up_to(finder, channel, until) + 1
    if end >= finder.raw_count[channel]:
        return
    if times[last % RAW] > after:  # they have filled the ring
        _take_out(finder, channel, first, end)
        return
    before, then = values[last % RAW], values[end % RAW]
    begin, way = times[last % RAW], times[end % RAW] - times[last % RAW]
    usual = abs(then - before)
    if last > first:
        usual = max(usual, abs(before - values[(last - 1) % RAW]))
    for i in range(last + 1, end):
        beyond = max(values[i % RAW] - max(before, then), min(before, then) - values[i % RAW])
        if spikes and not beyond > SPIKE * usual:
            return
    if end - last - 1 > ON_A_LINE:
        _take_out(finder, channel, last + 1, end)
        return
    for i in range(last + 1, end):
        values[i % RAW] = before + (times[i % RAW] - begin) / way * (then - before)


@compiled
def _take_out(finder: Any, channel: int, begin: int, end: int) -> None:
    """Take the readings from one up to another out of the ring."""
    finder.raw_first[channel] = oldest(finder, channel)  # what was before them is gone
    for k in range(end, finder.raw_count[channel]):
        here = (begin + k - end) % RAW
        finder.raw_time[channel, here] = finder.raw_time[channel, k % RAW]
        finder.raw_value[channel, here] = finder.raw_value[channel, k % RAW]
    finder.raw_count[channel] -= end - begin
