"""Faults that one channel shows by itself, each a sentence, or nothing."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hc_estimator.stream.readings import (
    LEAST_SAMPLES,
    FloatArray,
    Readings,
    moves,
    robust_range,
    runs,
)
from hc_estimator.stream.repeats import LONGEST_S
from hc_estimator.stream.stamp_checks import rate_of


def stuck(readings: Readings, other: Readings) -> str:
    """A channel that does not change while the other one does, all the time."""
    name, unit, _time_s, values = readings
    low = float(values.min())
    if low != float(values.max()) or len(other.values) < LEAST_SAMPLES or not moves(other.values):
        return ""
    if name == "force" and low == 0.0 and not (other.values > 0.0).any():
        return ""  # a simulated force in free motion
    first, last = robust_range(other.values)
    return (
        f"the {name} reads {low:.4g} {unit} all the time while the {other.name} goes from "
        f"{first:.3g} to {last:.3g} {other.unit}: is its sensor connected, is it the right axis?"
    )


def standing(readings: Readings, other: Readings) -> tuple[str, bool]:
    """A channel that stands still for a while as the other one goes on; and whether it still does.

    Returns:
        The sentence, and whether what was read of it is of no use: it stands to its end, or for
        most of the time.
    """
    name, unit, time_s, values = readings
    starts, lengths = runs(values)
    longest = int(np.argmax(lengths))
    length, start = int(lengths[longest]), int(starts[longest])
    begin, end = time_s[start], time_s[start + length - 1]
    repeats = (len(values) - len(lengths) - (length - 1)) / max(len(values) - length, 1)
    alive = repeats < 0.05  # elsewhere hardly two readings in a row are equal
    during = (other.time_s >= begin) & (other.time_s <= end)
    moving = during.sum() >= LEAST_SAMPLES and moves(other.values[during])
    free = name == "force" and values[start] == 0.0
    if len(lengths) == 1 or length < LEAST_SAMPLES or not (alive and moving) or free:
        return "", False
    share = length / len(values)
    at_end = start + length == len(values) and share > _STANDING_SHARE
    lost = at_end or share > 0.5
    stops = "has stopped" if at_end else "stopped meanwhile" if lost else "stops now and then"
    return (
        f"the {name} stands at {values[start]:.4g} {unit} for {end - begin:.3g} s while the "
        f"{other.name} changes: its sensor {stops}"
    ), lost


_STANDING_SHARE = 0.05
"""Of the time, at its end: by then the parameters follow a channel that says nothing."""


def held(readings: Readings) -> tuple[str, float]:
    """A channel that is repeated at a higher rate than it is measured at, or until it changes.

    Returns:
        The sentence, and how many samples hold the same reading, on average where they are not
        always as many; empty and NaN for none such.
    """
    name, _unit, time_s, values = readings
    starts, lengths = runs(values)
    inner = lengths[1:-1]
    if len(inner) < _FEWEST_REPEATED:
        return "", math.nan
    usual = float(np.median(inner))
    even = usual >= 2.0 and np.mean((inner > 0.5 * usual) & (inner < 1.5 * usual)) >= 0.8
    share = 0.0 if even else _repeated_unevenly(readings, starts, lengths)
    if not (even or share) or _step(values) > 0.0:
        return "", math.nan
    rate = rate_of(time_s)
    setting = "force" if name == "force" else "position"
    if not even:
        return (
            f"the {name} repeats its last reading in {100 * share:.0f} % of the samples, unevenly, "
            "as a driver does that tells changes alone or was not told in time: count each reading "
            f"once ({setting}.held)"
        ), 1.0 / (1.0 - share)
    sentence = (
        f"the {name} changes only once in {usual:.0f} samples: it comes at {rate / usual:.4g} "
        f"Hz, not at {rate:.4g} Hz; count each reading once ({setting}.held)"
    )
    return sentence, usual


_FEWEST_REPEATED = 20
_REPEATED, _BEYOND, _SIZES = 0.3, 10.0, 10
"""Share of the samples, and of the readings, that are repeated; by how many of the finest steps a
new reading is another one then, and of how many sizes: a coarse sensor goes on by its step."""


def _repeated_unevenly(
    readings: Readings, starts: NDArray[np.int64], lengths: NDArray[np.int64]
) -> float:
    """Return the share of the samples that repeat a reading of a tool that moves; 0 for few.

    Args:
        readings: of one channel.
        starts: of the runs of equal values.
        lengths: of these.
    """
    _name, _unit, time_s, values = readings
    stays = np.diff(time_s[starts]) < LONGEST_S  # else the tool rests, or the sensor
    held_for = lengths[:-1][stays]
    again = held_for > 1
    share = 1.0 - len(held_for) / max(int(held_for.sum()), 1)
    if np.count_nonzero(again) < max(_FEWEST_REPEATED, _REPEATED * len(again)) or share < _REPEATED:
        return 0.0
    jumps = np.abs(np.diff(values[starts]))[stays][again]
    usual = float(np.median(jumps))
    finest = float(np.quantile(np.diff(np.unique(values)), 0.05))
    sizes = len(np.unique(np.round(1e3 * jumps / usual)))
    return share if usual > _BEYOND * finest and sizes >= _SIZES else 0.0


def _step(values: FloatArray) -> float:
    """Return the step in which values come; 0 if they come in none."""
    distinct = np.unique(values)
    if not 3 <= len(distinct) < 0.25 * len(values):
        return 0.0
    gaps = np.diff(distinct)
    step = float(np.quantile(gaps, 0.1))
    multiples = gaps / step
    regular = np.mean(np.abs(multiples - np.round(multiples)) < 0.05)
    return step if step > 0.0 and regular > 0.8 else 0.0


def coarse(readings: Readings) -> str:
    """Steps that are coarse against what the channel shows."""
    name, unit, _time_s, values = readings
    step = _step(values)
    low, high = float(values.min()), float(values.max())
    if step == 0.0 or step < 0.02 * (high - low):
        return ""
    return (
        f"the {name} comes in steps of {step:.3g} {unit}, 1/{(high - low) / step:.0f} of its "
        "range: choose a finer range or a better resolution"
    )


def jumping(displacement: Readings) -> str:
    """A displacement that goes further between two readings than any tool does."""
    _name, unit, time_s, values = displacement
    steps, apart = np.abs(np.diff(values)), np.diff(time_s)
    forward = apart > 0.0
    if not forward.any():
        return ""
    usual = float(np.median(apart[forward]))
    speed = steps / np.maximum(apart, usual)  # stamps that are next to equal are no speed
    wild = forward & (steps > _JUMP_MM) & (speed > _FASTEST_MM_S)
    if not wild.any():
        return ""
    largest = int(np.argmax(np.where(wild, steps, 0.0)))
    return (
        f"the displacement jumps by {steps[largest]:.3g} {unit} within "
        f"{1e3 * apart[largest]:.3g} ms: no tool moves so; look at what tells the position (a "
        "tracker that loses its mark, a frame that is told anew), or set displacement_limit"
    )


_JUMP_MM, _FASTEST_MM_S = 5.0, 3000.0
"""Three metres a second: nobody palpates so fast."""
