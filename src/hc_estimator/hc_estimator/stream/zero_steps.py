"""Zeros that were taken anew in the middle of a recording: readings that step, and no motion does.

A tare of this suite, the zero button of a sensor's driver or a sensor that slips puts all readings
that follow off by the same. Between two readings a force does not change by itself: it steps, and
is as flat as before, while the tool does not move; or while it moves, and the force does not care.
A displacement does not get from rest to rest between two readings, for want of acceleration.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from hc_estimator.stream.readings import (
    LEAST_SAMPLES,
    Check,
    FloatArray,
    Parts,
    Readings,
    Suspicion,
    moves,
    noise,
    robust_range,
)

_WINDOW_S = 0.2
"""Before and after a step, in which the readings have to be flat."""
_LEAST_READINGS = 8
_CLEAR = 4.0
"""A step is so many times the noise of one reading."""
_FLAT = 4.0
"""Flat readings lie within so many times the noise of their median."""
_LEAST_SHARE = 0.01
"""Of the force's range: smaller steps cost nothing that anybody tells."""
_TOGETHER_S = 0.02
"""Both zeros of a tare step within that."""
_STEEPEST = 10.0
"""The stiffest place of a tissue, in units of the range of the force over that of the depth."""
_LARGEST_ACCELERATION = 1e5
"""mm/s^2, ten times that of free fall: no tool that palpates gets from rest to rest with it."""
_MOST = 100
"""Changes that are looked at, the largest first."""
_OFTEN, _ALIKE = 3, 0.2
"""Steps from one level to another that are no zeros; share of their size by which levels differ."""
_BEYOND_SHARE = 0.05
"""So many readings may lie beyond the zero: a tissue pushes one way, but for one that sticks."""


class _Step(NamedTuple):
    """A step: between which readings, and from which level to which."""

    begin_s: float
    end_s: float
    before: float
    after: float

    @property
    def size(self) -> float:
        return self.after - self.before


def find_steps(displacement: Readings, force: Readings) -> Parts[list[Suspicion]]:
    """Find zeros that were taken anew.

    Args:
        displacement: penetration [mm].
        force: contact force [N].

    Returns:
        In parts: a doubt for each time at which one was, the earliest first; the remedy is to be
        taken off the readings of the part whose zero is the less likely one.
    """
    if min(len(displacement.values), len(force.values)) < LEAST_SAMPLES:
        return []
    if not moves(displacement.values):
        return []
    yield
    steps: list[tuple[Readings, _Step]] = []
    stepped = yield from _steps(displacement)
    jumps = [s for s in stepped if _is_no_motion(s)]
    stepped = yield from _steps(force)
    yield
    for step in stepped:
        jump = next((j for j in jumps if abs(j.end_s - step.end_s) < _TOGETHER_S), None)
        if jump is not None or _is_no_contact(step, displacement, force):
            steps.append((force, step))
    if _is_of_each_press([step for _readings, step in steps]):
        steps = []
    steps += [(displacement, jump) for jump in jumps]
    return [_suspicion(*found) for found in sorted(steps, key=lambda found: found[1].end_s)]


def _steps(channel: Readings) -> Parts[list[_Step]]:
    """Return the steps between flat readings of a channel, each the largest around it."""
    time_s, values = channel.time_s, channel.values
    deviation = noise(values)
    low, high = robust_range(values)
    least = max(_CLEAR * deviation, _LEAST_SHARE * (high - low))
    yield
    usual_s = float(np.median(np.diff(time_s)))
    if not usual_s > 0.0:
        return []
    count = max(_LEAST_READINGS, round(_WINDOW_S / usual_s))
    if len(values) < 2 * count:
        return []
    sums = np.concatenate(([0.0], np.cumsum(values - np.median(values))))
    means = (sums[count:] - sums[:-count]) / count
    change = np.abs(
        means[count:] - means[:-count]
    )  # at [i]: between readings i + count - 1 and + 1
    yield
    peaks = sorted(_peaks(change, 0.8 * least, count))
    yield
    flat: list[tuple[int, float, float]] = []
    for start in peaks:
        yield
        last = start + count - 1
        if time_s[last + count] - time_s[start] > 3.0 * count * usual_s:
            continue  # readings are missing
        sides = values[start : last + 1], values[last + 1 : last + 1 + count]
        before, after = (float(np.median(side)) for side in sides)
        if abs(after - before) >= least and all(
            _is_flat(side, level, deviation, least)
            for side, level in zip(sides, (before, after), strict=True)
        ):
            flat.append((last, before, after))
    found: list[_Step] = []
    since = 0
    for place, (last, before, after) in enumerate(flat):
        until = flat[place + 1][0] + 1 if place + 1 < len(flat) else len(values)
        parts = (values[since : last + 1], before), (values[last + 1 : until], after)
        if all(_is_end(part, level, deviation, least) for part, level in parts):
            found.append(_Step(float(time_s[last]), float(time_s[last + 1]), before, after))
            since = last + 1
    return found


def _peaks(change: FloatArray, least: float, apart: int) -> list[int]:
    """Return where a change beyond the least is the largest of so many to both sides."""
    left = np.where(change > least, change, -np.inf)
    kept: list[int] = []
    while len(kept) < _MOST:
        i = int(np.argmax(left))
        if left[i] == -np.inf:
            break
        kept.append(i)
        left[max(0, i - apart) : i + apart + 1] = -np.inf
    return kept


def _is_flat(values: FloatArray, level: float, deviation: float, least: float) -> bool:
    """Whether readings lie about their median and do not drift."""
    third = len(values) // 3
    drift = abs(float(np.median(values[:third]) - np.median(values[-third:])))
    if not drift < 0.2 * least:
        return False  # most often: the rest is not worked out
    allowed = max(_FLAT * deviation, 0.05 * least)
    return float(np.quantile(np.abs(values - level), 0.95)) <= allowed


def _is_end(part: FloatArray, level: float, deviation: float, least: float) -> bool:
    """Whether readings go from a level to one side only, as a tissue pushes: it is the zero."""
    allowed = max(_FLAT * deviation, 0.2 * least)
    beyond = float(np.mean(part < level - allowed)), float(np.mean(part > level + allowed))
    return min(beyond) < _BEYOND_SHARE


def _is_of_each_press(steps: list[_Step]) -> bool:
    """Whether the force steps from one level to another again and again: no zero was another then.

    What holds a needle back, or sticks to a tool, lets go of it in every press.
    """
    if len(steps) < _OFTEN:
        return False
    before, after = np.array([(step.before, step.after) for step in steps]).T
    alike = _ALIKE * float(np.min(np.abs(after - before)))
    return float(np.ptp(before)) < alike and float(np.ptp(after)) < alike


def _is_no_motion(step: _Step) -> bool:
    """Whether a step of the displacement is one that no tool makes."""
    apart = step.end_s - step.begin_s
    return 4.0 * abs(step.size) / apart**2 > _LARGEST_ACCELERATION


def _is_no_contact(step: _Step, displacement: Readings, force: Readings) -> bool:
    """Whether a step of the force is none that the tissue made: the depth says nothing of it."""
    time_s = displacement.time_s
    first = int(np.searchsorted(time_s, step.begin_s - _WINDOW_S))
    middle = int(np.searchsorted(time_s, step.begin_s, "right"))
    again = int(np.searchsorted(time_s, step.end_s))
    last = int(np.searchsorted(time_s, step.end_s + _WINDOW_S, "right"))
    before, after = displacement.values[first:middle], displacement.values[again:last]
    if min(len(before), len(after)) < 2:
        return False
    deviation = noise(displacement.values)
    low, high = robust_range(displacement.values)
    least, most = robust_range(force.values)
    steepest = _STEEPEST * (most - least) / (high - low)
    travel = min(np.ptp(before), np.ptp(after))
    if travel > _CLEAR * deviation and steepest * travel > abs(step.size):
        return True  # it moves on both sides, and the force is flat there: free of contact
    moved = abs(float(np.median(before[-5:]) - np.median(after[:5]))) + 2.0 * deviation
    return abs(step.size) > steepest * moved


def _suspicion(channel: Readings, step: _Step) -> Suspicion:
    """Doubt the zero of the part whose level is further from zero."""
    sentence = (
        f"the {channel.name} steps from {step.before:.3g} to {step.after:.3g} {channel.unit} at "
        f"{step.end_s:.2f} s, and no motion makes it: its zero was taken anew in the middle (a "
        "tare, or a sensor that was reset or slipped): tare first and then record, or keep one "
        "part (hc bag filter --start)"
    )
    if abs(step.after) < abs(step.before):
        span, remedy = (-math.inf, step.end_s), -step.size
    else:
        span, remedy = (step.end_s, math.inf), step.size
    return Suspicion(Check.ZERO_STEP, channel.name, sentence, remedy, *span)
