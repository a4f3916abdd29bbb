"""Faults that one channel shows by itself, each a sentence, or nothing."""

from __future__ import annotations

import math

import numpy as np

from hc_estimator.stream.readings import (
    LEAST_SAMPLES,
    FloatArray,
    Parts,
    Readings,
    moves,
    robust_range,
    runs,
)


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
    """A channel that is repeated at a higher rate than it is measured at.

    Returns:
        The sentence, and how many samples hold the same reading; empty and NaN for none such.
    """
    name, _unit, time_s, values = readings
    _starts, lengths = runs(values)
    inner = lengths[1:-1]
    if len(inner) < 20:
        return "", math.nan
    usual = float(np.median(inner))
    regular = np.mean((inner > 0.5 * usual) & (inner < 1.5 * usual))
    if usual < 2.0 or regular < 0.8 or _step(values) > 0.0:
        return "", math.nan
    rate = _rate(time_s)
    setting = "force" if name == "force" else "position"
    sentence = (
        f"the {name} changes only once in {usual:.0f} samples: it comes at {rate / usual:.4g} "
        f"Hz, not at {rate:.4g} Hz; count each reading once ({setting}.held)"
    )
    return sentence, usual


def _rate(time_s: FloatArray) -> float:
    steps = np.diff(time_s)
    steps = steps[steps > 0.0]
    return 1.0 / float(np.median(steps)) if len(steps) else math.nan


def irregular(readings: Readings) -> str:
    """Stamps that are no times of measurement."""
    name, _unit, time_s, _values = readings
    steps = np.diff(time_s)
    usual = float(np.median(steps))
    if usual < 0.0:
        return f"the stamps of the {name} mostly go backward: sort the readings by time"
    if usual == 0.0:
        return (
            f"most samples of the {name} repeat the stamp of the one before, and are left out: "
            "write the times with more digits, or stamp each reading when it is measured"
        )
    typical = float(np.quantile(steps, 0.95))
    together = float(np.mean(steps < 0.1 * typical))
    forward = steps[(steps > 0.0) & (steps < 20.0 * usual)]
    mean = float(np.mean(forward)) if len(forward) else usual  # none where stamps go to and fro
    if together > 0.2:
        return (
            f"the {name} comes in bursts, {100 * together:.0f} % of the readings at the time of "
            "the one before, as stamps of arrival do: stamp them when they are measured"
        )
    if mean > 1.2 * usual:
        return (
            f"the {name} comes at {1.0 / mean:.4g} Hz on average, though mostly every "
            f"{1e3 * usual:.3g} ms: readings are lost or late"
        )
    return ""


def mistimed(readings: Readings) -> str:
    """Stamps so far apart, or so close, that they can hardly be seconds."""
    _name, _unit, time_s, values = readings
    rate = _rate(time_s)
    span = float(time_s.max() - time_s.min()) if len(time_s) else 0.0
    if rate > _FASTEST_HZ and span > 0.0:
        rate = (len(values) - 1) / span  # readings that come in bursts are next to each other
    if len(values) < LEAST_TIMED or _SLOWEST_HZ <= rate <= _FASTEST_HZ or math.isnan(rate):
        return ""
    guess = next(
        (
            f", but would be {rate * factor:.4g} Hz if the times were in {unit}"
            for unit, factor in (
                ("milliseconds", 1e3),
                ("microseconds", 1e6),
                ("nanoseconds", 1e9),
                ("minutes", 1 / 60),
            )
            if _USUAL_HZ[0] <= rate * factor <= _USUAL_HZ[1]
        ),
        "",
    )
    return (
        f"the readings come at {rate:.3g} Hz{guess}: check the unit of the stamps (--units time=ms "
        "of a CSV), for B is wrong by the same factor"
    )


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

LEAST_TIMED = 500
_SLOWEST_HZ, _FASTEST_HZ = 4.5, 1e5
_USUAL_HZ = (20.0, 2e4)
"""Rates of force sensors and poses; and those beyond which nobody measures a tissue."""

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


def flattened(depth: Readings, force: Readings) -> Parts[str]:
    """Find a force that goes no further while the tool goes on: an amplifier at its end, in parts.

    Soft tissue stiffens: what lies in the last percents of the force lies in the last percents of
    the depth as well, but for the damping.
    """
    inside = (force.time_s >= depth.time_s.min()) & (force.time_s <= depth.time_s.max())
    newtons = force.values[inside]
    if len(newtons) < LEAST_SAMPLES or not (moves(newtons) and moves(depth.values)):
        return ""
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
            return (
                f"the force goes no further than {limit:.4g} {force.unit}, its {word} value, in "
                f"{100 * share:.0f} % of the samples while the depth goes on for {spread:.2g} "
                f"{depth.unit}: the sensor or its amplifier is at the end of its range; set "
                "force_limit just below"
            )
    return ""


def saturated(force: Readings) -> str:
    """A force that stays at its largest or smallest value and nowhere else."""
    _name, unit, _time_s, values = force
    if values.min() == values.max():
        return ""
    starts, lengths = runs(values)
    for limit, word in ((values.max(), "largest"), (values.min(), "smallest")):
        at_limit = values[starts] == limit
        repeats = int(np.sum(lengths[~at_limit] - 1)) / max(int(np.sum(lengths[~at_limit])), 1)
        share = float(np.sum(lengths[at_limit])) / len(values)
        if limit != 0.0 and share > 0.005 and lengths[at_limit].max() >= 5 and repeats < 0.02:
            return (
                f"the force stays at {limit:.4g} {unit}, its {word} value, in {100 * share:.1f} % "
                "of the samples: the sensor is at the end of its range; set force_limit just below"
            )
    return ""
