"""Local parabolas through the raw readings of both channels, on a grid in time.

Displacement, velocity, acceleration and force of a point are the same whatever the hypotheses say,
and the parabolas (`local_polynomial`) are as wide for both channels, so that smoothing shifts
neither against the other. The finder of the channel delay and the batch fit take their points from
here.
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.multiple_model import (
    delay_points,
    local_polynomial,
    raw_readings,
    smoothing,
)
from hc_estimator.multiple_model.delay_records import CANDIDATES, GRID, RAW
from hc_estimator.multiple_model.local_polynomial import FEWEST_READINGS, SLACK, TO_BE_READ

STEP = 0.010  # between two points of the grid, at least [s]
HALF_WIDTH = 0.015  # of the local parabola [s]
WIDER = 2.0  # times as wide where readings were lost
SAME_STEP = 0.01  # share by which the step of a new grid may differ and be that of the last one
LOST = 1.5  # times the usual time between two readings from which on some were lost in between
LARGEST = 0.074  # delay that is tried; 60 ms are looked for [s]
WINDOW = 0.5  # [s]


@compiled
def restart(finder: Any) -> None:
    """Forget the readings of the present window; what earlier windows said stays."""
    for i in range(2):
        raw_readings.restart(finder, i)
    finder.grid_count = 0


@compiled
def move(finder: Any, displacement: float, force: float) -> None:
    """The zeros have moved by so much [mm], [N]; what was read is the same."""
    for k in range(GRID):
        point = finder.grid[k]
        point.displacement -= displacement
        point.displacement_by_parabola -= displacement
        point.force -= force
        point.force_by_parabola -= force


@compiled
def period(finder: Any, channel: int) -> float:
    """Usual time between two readings of a channel [s]."""
    count = finder.raw_count[channel]
    few = min(raw_readings.count_of(finder, channel), 16)
    last = finder.raw_time[channel, (count - 1) % RAW]
    first = finder.raw_time[channel, (count - few) % RAW]
    return (last - first) / max(few - 1, 1)  # type: ignore[no-any-return]


@compiled
def _between(finder: Any, channel: int, back: int) -> float:
    """Time between two of the latest readings [s]; 1: between the last two."""
    count = finder.raw_count[channel]
    later = finder.raw_time[channel, (count - back) % RAW]
    return later - finder.raw_time[channel, (count - back - 1) % RAW]  # type: ignore[no-any-return]


@compiled
def _usual_between(finder: Any, channel: int, few: int) -> float:
    """Median time between two of so many latest readings [s]."""
    for i in range(1, few):
        here, shorter, equal = _between(finder, channel, i), 0, 0
        for k in range(1, few):
            other = _between(finder, channel, k)
            shorter += 1 if other < here else 0
            equal += 1 if other == here else 0
        if 2 * shorter < few and 2 * (shorter + equal) >= few - 1:
            return here
    return 0.0


@compiled
def _period_of_sensor(finder: Any, channel: int) -> float:
    """`period` as the sensor has it, whatever readings were lost meanwhile [s]."""
    few = min(raw_readings.count_of(finder, channel), 16)
    longest = LOST * _usual_between(finder, channel, few)
    total, kept = 0.0, 0
    for back in range(1, few):
        between = _between(finder, channel, back)
        if between <= longest:
            total += between
            kept += 1
    return total / max(kept, 1) if kept < few - 1 else period(finder, channel)


@compiled
def _choose_step(finder: Any) -> None:
    """Step of a new grid: that of the last one, unless the sensors have another rate by now.

    Points that are kept for the delay stand at candidates a step apart, and are of no use with
    another.
    """
    step = max(STEP, _period_of_sensor(finder, 0), _period_of_sensor(finder, 1))
    if abs(step - finder.grid_step) > SAME_STEP * finder.grid_step:
        finder.grid_step = step
        delay_points.forget(finder)


@compiled
def slowest_period(finder: Any) -> float:
    """Usual time between two readings of the slower channel [s]."""
    return max(period(finder, 0), period(finder, 1))


@compiled
def readings_of(finder: Any) -> float:
    """Displacements in one parabola."""
    return max(finder.grid_width / max(period(finder, 0), 1e-9), 1.0)  # type: ignore[no-any-return]


@compiled
def velocity_variance(finder: Any, noise: float) -> float:
    """Variance of a parabola's slope [mm^2/s^2], from that of a reading [mm^2]."""
    return 12.0 * noise / (finder.grid_width**2 * readings_of(finder))  # type: ignore[no-any-return]


@compiled
def time_of(finder: Any, k: int) -> float:
    """Time of a point of the grid [s]."""
    return float(finder.grid_next - finder.grid_step * (finder.grid_count - k))


@compiled
def places_about(finder: Any, time: float, within: float) -> tuple[float, float]:
    """Lowest and highest place of the tool about a time, within another [mm].

    NaN as long as that is still to be read, infinity where it is no longer known.
    """
    lowest, highest, count = math.inf, -math.inf, finder.grid_count
    oldest = max(count - GRID, 0)
    before = within if oldest > 0 else 0.0  # what was before the first point was never read
    if count == 0 or time_of(finder, count - 1) < time + within:
        return math.nan, math.nan
    if time_of(finder, oldest) > time - before:
        return lowest, highest
    for k in range(oldest, count):
        if abs(time_of(finder, k) - time) <= within + finder.grid_step:
            lowest = min(lowest, finder.grid[k % GRID].displacement)
            highest = max(highest, finder.grid[k % GRID].displacement)
    return lowest, highest


@compiled
def _add_point(finder: Any, centre: float, half: float, wider: float, noise: Any) -> int:
    """Add the point of a time to the grid, unless readings are few; see `local_polynomial.fit`.

    Args:
        finder: changed.
        centre: time [s].
        half: half width of a parabola [s].
        wider: of a polynomial of more terms [s].
        noise: variances of a reading, shape (2,).
    """
    degree = local_polynomial.fit(finder, centre, half, wider, noise)
    if degree <= 0:
        return degree
    point = finder.grid[finder.grid_count % GRID]
    place, force = finder.fitted_to[0], finder.fitted_to[1]
    point.displacement, point.displacement_by_parabola = place[0], place[5]
    point.velocity, point.acceleration, point.cubic = place[1], place[2], place[4]
    point.force, point.force_by_parabola = force[0], force[5]
    point.displacement_left, point.force_left = place[3], force[3]
    point.degree = degree
    finder.grid_count += 1
    finder.grid_next += finder.grid_step
    return degree


@compiled
def advance(finder: Any, noise: Any) -> bool:
    """Add the points of the grid that the readings allow by now; True if a window is full.

    Where readings were lost, a parabola is wider; where that does not do, a window begins anew.

    Args:
        finder: changed.
        noise: variances of a reading, shape (2,).
    """
    counts = raw_readings.count_of(finder, 0), raw_readings.count_of(finder, 1)
    if min(counts[0], counts[1]) < 2 * FEWEST_READINGS:
        return False
    slowest = slowest_period(finder)
    half = max(HALF_WIDTH, 0.5 * FEWEST_READINGS * slowest)
    last0 = finder.raw_time[0, (finder.raw_count[0] - 1) % RAW]
    last1 = finder.raw_time[1, (finder.raw_count[1] - 1) % RAW]
    wider = local_polynomial.widest(half, slowest)
    newest = min(last0, last1) - half
    finder.grid_width = 2.0 * half
    if finder.grid_count == 0:
        _choose_step(finder)
        finder.grid_next = newest
    if finder.grid_next > newest + SLACK * half:
        return False
    centre = finder.grid_next
    degree = _add_point(finder, centre, half, wider, noise)
    if degree == TO_BE_READ:
        return False
    if degree == 0:
        widest = WIDER * half
        if finder.grid_count > 0 and centre > newest + half - widest:
            return False  # the readings beyond the gap are still to come
        if finder.grid_count == 0 or _add_point(finder, centre, widest, widest, noise) == 0:
            finder.grid_count = 0
            return False
    reach = min(int(LARGEST / finder.grid_step), CANDIDATES // 2)
    finder.neighbours = smoothing.neighbours(finder.grid_step)
    margin = reach + finder.neighbours + 1
    points = min(int(WINDOW / finder.grid_step), GRID - 2 * margin)
    if finder.grid_count < points + 2 * margin:
        return False
    # The next window's margin overlaps this one.
    if (finder.grid_count - 2 * margin) % points != 0:
        return False
    finder.reach = reach
    finder.points = points
    finder.first = finder.grid_count - points - margin
    return True
