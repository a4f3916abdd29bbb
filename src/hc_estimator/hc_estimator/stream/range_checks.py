"""A sensor at the end of its range: readings that go no further while the other channel does."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hc_estimator.stream.readings import (
    LEAST_SAMPLES,
    FloatArray,
    Parts,
    Readings,
    moves,
    noise,
    robust_range,
    runs,
)

_TOP, _NEXT = 0.03, 0.2
"""Shares of the force's range: its end, and what comes before."""
_TOP_SHARE, _TOP_STROKE, _CROWDED = 0.08, 0.15, 8.0
"""More of the samples, over more of the stroke, so many times as crowded as before the end."""


_HELD, _RISES = 5, 0.1
"""Readings in a row at the end; share of the force's range by which it rises meanwhile."""


def stopped_short(depth: Readings, force: Readings) -> str:
    """A displacement that goes no further while the force still grows: a sensor at its end.

    A tool that is held at one depth feels a force that falls, or stays.
    """
    values = depth.values
    least, most = robust_range(force.values)
    starts, lengths = runs(values)
    limit = float(values.max())
    at_limit = values[starts] == limit
    share = float(np.sum(lengths[at_limit])) / len(values)
    elsewhere = lengths[~at_limit]
    repeats = int(np.sum(elsewhere - 1)) / max(int(np.sum(elsewhere)), 1)
    if not (0.005 < share < 1.0 and repeats < 0.02):
        return ""
    rises = 0
    for start, length in zip(starts[at_limit], lengths[at_limit], strict=True):
        begin, end = depth.time_s[start], depth.time_s[start + length - 1]
        during = force.values[(force.time_s >= begin) & (force.time_s <= end)]
        if length >= _HELD and len(during) >= _HELD:
            rises += float(during.max() - during[0]) > _RISES * (most - least)
    if rises == 0:
        return ""
    return (
        f"the displacement stays at {limit:.4g} {depth.unit}, its largest value, in "
        f"{100.0 * share:.1f} % of the samples while the force still grows: the sensor is at the "
        "end of its range; press less, or set displacement_limit just below"
    )


def flattened(depth: Readings, force: Readings) -> Parts[tuple[str, float]]:
    """Find a force that goes no further while the tool goes on: an amplifier at its end, in parts.

    Soft tissue stiffens: what lies in the last percents of the force lies in the last percents of
    the depth as well, but for the damping.

    Returns:
        As `saturated`.
    """
    inside = (force.time_s >= depth.time_s.min()) & (force.time_s <= depth.time_s.max())
    newtons = force.values[inside]
    if len(newtons) < LEAST_SAMPLES or not (moves(newtons) and moves(depth.values)):
        return "", math.nan
    yield
    order = np.argsort(depth.time_s, kind="stable")
    at = np.interp(force.time_s[inside], depth.time_s[order], depth.values[order])
    low, high = robust_range(newtons)
    shallow, deep = robust_range(at)
    yield
    for limit, word, side in ((high, "largest", 1.0), (low, "smallest", -1.0)):
        room = side * (limit - newtons) / (high - low)
        top, before = room < _TOP, (room >= _TOP) & (room < _TOP + _NEXT)
        share = float(np.mean(top))
        if share < _TOP_SHARE or abs(limit) < 0.5 * (high - low):
            continue  # the flat part of free motion is about zero
        spread = float(np.diff(np.quantile(at[top], (0.05, 0.95)))[0])
        crowded = share / _TOP > _CROWDED * float(np.mean(before)) / _NEXT
        if float(np.median(at[top])) < float(np.median(at[~top])):
            continue  # flat where the tool is out: free motion, whatever its zero
        if crowded and spread > _TOP_STROKE * (deep - shallow):
            keep = limit - side * _TOP * (high - low)
            sentence = (
                f"the force goes no further than {limit:.4g} {force.unit}, its {word} value, in "
                f"{100 * share:.0f} % of the samples while the depth goes on for {spread:.2g} "
                f"{depth.unit}: the sensor or its amplifier is at the end of its range; "
                f"press less, or set force_limit {abs(keep):.4g}, just below"
            )
            return sentence, keep
    return "", math.nan


def saturated(force: Readings, depth: Readings) -> Parts[tuple[str, float]]:
    """Find, in parts, a force that stays at its largest or smallest value as the depth goes on.

    Where readings come in steps, or are repeated, they stay elsewhere as well: then the end is
    crowded against the steps before it.

    Returns:
        The sentence, and the force from which on readings are to be left out [N]; empty and NaN for
        a sensor within its range.
    """
    _name, unit, _time_s, values = force
    if values.min() == values.max():
        return "", math.nan
    starts, lengths = runs(values)
    for side, word in ((1.0, "largest"), (-1.0, "smallest")):
        limit = side * float((side * values).max())
        at_limit = values[starts] == limit
        elsewhere = lengths[~at_limit]
        repeats = int(np.sum(elsewhere - 1)) / max(int(np.sum(elsewhere)), 1)
        if limit == 0.0 or repeats >= _REPEATED or not _is_long(lengths[at_limit], len(values)):
            if np.max(lengths) < _HELD:
                continue
            yield
            limit = _crowded_end(values, side)
            at_limit = values[starts] == limit
            if not _is_long(lengths[at_limit], len(values)):
                continue
        yield
        if not _goes_on(force, depth, limit, (starts[at_limit], lengths[at_limit])):
            continue
        share = float(np.sum(lengths[at_limit])) / len(values)
        keep = _BELOW * limit
        sentence = (
            f"the force stays at {limit:.4g} {unit}, its {word} value, in {100 * share:.1f} % of "
            "the samples: the sensor is at the end of its range; press less, or set force_limit "
            f"{abs(keep):.4g}, just below"
        )
        return sentence, keep
    return "", math.nan


_REPEATED, _LEAST_SHARE, _BELOW = 0.02, 0.005, 0.99
"""Readings that only repeat the one before, elsewhere; those at an end; what is just below one."""
_BEYOND, _STEPS, _PILED = 0.002, 3, 6.0
"""Spikes beyond an end; the steps before it, and how many times as many readings it has as they: at
a peak without noise the last step has two and a half times those of the one before."""
_BAND, _CLEAR_STEPS, _CLEAR_NOISES, _GOING = 0.3, 3.0, 8.0, 0.2
"""Share of the force's range in which its slope is taken; what is more than a step, than noise; of
the readings at an end those during which the depth goes on: a tool may also rest there."""


def _is_long(lengths: NDArray[np.int64], count: int) -> bool:
    """Whether runs of equal readings, of so many readings in all, are no coincidence."""
    return bool(np.sum(lengths) > _LEAST_SHARE * count and np.max(lengths, initial=0) >= _HELD)


def _crowded_end(values: FloatArray, side: float) -> float:
    """Return the value at which readings that come in steps pile up at one end; NaN for none."""
    distinct, counts = np.unique(side * values, return_counts=True)
    beyond = len(values) - np.cumsum(counts)
    few = (beyond <= _BEYOND * len(values)) & (counts > _LEAST_SHARE * len(values))
    near = np.flatnonzero(few)
    if len(near) == 0 or near[0] < _STEPS:
        return math.nan
    place = int(near[np.argmax(counts[near])])
    limit, low_high = side * float(distinct[place]), robust_range(values)
    if abs(limit) < 0.5 * (low_high[1] - low_high[0]):
        return math.nan  # the flat part of free motion is about zero
    if counts[place] < _PILED * int(counts[place - _STEPS : place].max()):
        return math.nan
    return limit


def _goes_on(
    force: Readings,
    depth: Readings,
    limit: float,
    held: tuple[NDArray[np.int64], NDArray[np.int64]],
) -> bool:
    """Whether the depth goes on while the force stays at a limit, by more than a step of it.

    Where too little is known of the depth, it may.

    Args:
        force: its readings.
        depth: those of the displacement.
        limit: value of the force [N].
        held: starts and lengths of the runs of readings there.
    """
    if len(depth.values) < LEAST_SAMPLES or not moves(depth.values):
        return True
    order = np.argsort(depth.time_s, kind="stable")
    at = np.interp(force.time_s, depth.time_s[order], depth.values[order])
    room = np.abs(force.values - limit)
    least, most = robust_range(force.values)
    near = (room > 0.0) & (room < _BAND * (most - least))
    clear = _CLEAR_NOISES * noise(depth.values)
    if np.count_nonzero(near) >= LEAST_SAMPLES and np.ptp(at[near]) > 0.0:
        slope = np.cov(at[near], force.values[near])[0, 1] / np.var(at[near])
        clear = max(clear, _CLEAR_STEPS * float(room[near].min() / abs(slope)))
    gone_on = 0
    for start, length in zip(*held, strict=True):
        if np.ptp(at[start : start + length]) > clear:
            gone_on += length
    return bool(gone_on > _GOING * np.sum(held[1]))
