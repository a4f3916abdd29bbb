"""Stamps that are no times of measurement: of another unit, of arrival, in bursts."""

from __future__ import annotations

import math

import numpy as np

from hc_estimator.stream.arrival_stamps import TOGETHER, share_in_bursts
from hc_estimator.stream.readings import FloatArray, Parts, Readings
from hc_msgs_py.units import DAY_S


def rate_of(time_s: FloatArray) -> float:
    """Return the rate of readings by the median of their intervals [Hz]; NaN for none."""
    steps = np.diff(time_s)
    steps = steps[steps > 0.0]
    return 1.0 / float(np.median(steps)) if len(steps) else math.nan


def irregular(readings: Readings) -> Parts[str]:
    """Find stamps that are no times of measurement, in parts."""
    name, _unit, time_s, values = readings
    steps = np.diff(time_s)
    usual = float(np.median(steps))
    if usual < 0.0:
        return f"the stamps of the {name} mostly go backward: sort the readings by time"
    if usual == 0.0:
        return (
            f"{100 * np.mean(steps == 0.0):.0f} % of the samples of the {name} repeat the stamp of "
            "the one before, and are left out: write the times with more digits, or stamp each "
            "reading when it is measured"
        )
    together = share_in_bursts(steps)
    if together <= TOGETHER:
        together = _in_long_bursts(steps, values, usual)
    forward = steps[(steps > 0.0) & (steps < 20.0 * usual)]
    mean = float(np.mean(forward)) if len(forward) else usual  # none where stamps go to and fro
    if together > TOGETHER:
        return (
            f"the {name} comes in bursts, {100 * together:.0f} % of the readings at the time of "
            "the one before, as stamps of arrival do: stamp them when they are measured, or say "
            f"that they are not ({_setting(name)}: arrival)"
        )
    uneven = mean > _SLOWER * usual and not _is_even_but_rounded(time_s, steps)
    if uneven and not _at_rates_in_turn(steps, usual):
        return (
            f"the {name} comes at {1.0 / mean:.4g} Hz on average, though mostly every "
            f"{1e3 * usual:.3g} ms: readings are lost, late or no numbers (NaN)"
        )
    yield
    share, off_s = _of_arrival(time_s, values, usual)
    if share > 0.0:
        return (
            f"the {name} is read at even times, but {100 * share:.0f} % of its stamps are off, by "
            f"up to {1e3 * off_s:.2g} ms, as stamps of arrival are: stamp the readings when they "
            f"are measured, and write all digits, or say that they are not ({_setting(name)}: "
            "arrival)"
        )
    return ""


_SLOWER, _STRETCH = 1.2, 100
"""Times the usual interval: longer ones are those of a lower rate; and how many of one rate follow
each other on average where a sensor was started again with another."""


def _at_rates_in_turn(steps: FloatArray, usual: float) -> bool:
    """Whether the longer intervals are those of another even rate, in long stretches of their own.

    A driver that is started again with a lower rate loses nothing.
    """
    slow = steps > _SLOWER * usual
    longer = steps[slow]
    if np.count_nonzero(np.diff(slow)) > len(longer) / _STRETCH + 2:  # and a pause or two
        return False
    slower = float(np.median(longer))
    within = longer[longer < 20.0 * slower]
    return float(np.mean(within)) <= _SLOWER * slower


_LITTLE = 0.01
"""Of the digit to which stamps are written: what a float64 leaves of it."""


def _is_even_but_rounded(time_s: FloatArray, steps: FloatArray) -> bool:
    """Whether stamps are those of even times, written with few digits: no reading is lost then.

    700 Hz in whole milliseconds is 1, 1, 2, 1, 2 ms apart, and never more than one from the line.
    """
    digit = float(np.min(steps[steps > 0.0]))
    wholes = steps / digit
    if np.max(np.abs(wholes - np.round(wholes))) > _LITTLE:
        return False
    line = np.linspace(time_s[0], time_s[-1], len(time_s))
    return bool(np.max(np.abs(time_s - line)) <= (1.0 + _LITTLE) * digit)


def _setting(name: str) -> str:
    return "force.stamps" if name == "force" else "position.stamps"


_PAUSE, _LONGEST_PAUSE_S, _FEWEST_BURSTS, _INSTANT = 10.0, 2.0, 5, 0.2
"""Times the usual interval: what parts bursts; the longest that a driver waits to hand readings on;
how many bursts there are; the share of the time that they may take."""


def _in_long_bursts(steps: FloatArray, values: FloatArray, usual: float) -> float:
    """Return the share of readings that come together, in bursts of more than twenty; 0 for none.

    A sensor that is read in bursts, or was away, moves between them: one whose readings are only
    handed on so goes no further from one burst to the next than from one reading to the next.
    """
    pauses = np.flatnonzero(steps > _PAUSE * usual)
    if len(pauses) < _FEWEST_BURSTS or np.median(steps[pauses]) > _LONGEST_PAUSE_S:
        return 0.0
    inside = np.delete(steps, pauses)
    if np.sum(inside) > _INSTANT * np.sum(steps):
        return 0.0
    ways = np.abs(np.diff(values))
    if np.mean(ways[pauses]) > _FURTHER * np.mean(np.delete(ways, pauses)):
        return 0.0
    return len(inside) / len(steps)


_FURTHER = 3.0


_ROUGHER, _UNEVEN, _MOVING = 1.5, 0.1, 0.67
"""How much rougher a motion is over its stamps than over even times; share of the usual interval by
which stamps are uneven; of the readings those that move least, which show nothing."""


def _of_arrival(time_s: FloatArray, values: FloatArray, usual: float) -> tuple[float, float]:
    """Find stamps that jitter about the even times at which the values were read.

    Between its neighbours a moving value lies where its stamp says, if that is the time at which it
    was read. Where it lies in the middle whatever its stamp says, it was read at even times.

    Returns:
        The share of the stamps that are off, and by how much most of them (90 %) are at most [s];
        zeros for stamps that are right.
    """
    before, after = time_s[1:-1] - time_s[:-2], time_s[2:] - time_s[1:-1]
    apart = before + after
    way = values[2:] - values[:-2]
    regular = (before > 0.0) & (after > 0.0) & (apart < 4.0 * usual)
    if np.count_nonzero(regular) < LEAST_TIMED:
        return 0.0, 0.0
    before, apart, way = before[regular], apart[regular], way[regular]
    uneven = before - 0.5 * apart
    off = float(np.quantile(np.abs(uneven), 0.9))
    if off < _UNEVEN * usual:
        return 0.0, 0.0
    from_middle = values[1:-1][regular] - values[:-2][regular] - 0.5 * way
    moving = np.abs(way) >= np.quantile(np.abs(way), _MOVING)
    by_stamp = np.abs(from_middle - way * uneven / apart)[moving]
    if np.median(by_stamp) < _ROUGHER * np.median(np.abs(from_middle[moving])):
        return 0.0, 0.0
    return float(np.mean(np.abs(uneven) > _UNEVEN * usual)), off


def mistimed(readings: Readings) -> str:
    """Stamps so far apart, or so close, that they can hardly be seconds."""
    _name, _unit, time_s, values = readings
    rate = rate_of(time_s)
    span = float(time_s.max() - time_s.min()) if len(time_s) else 0.0
    if rate > _FASTEST_HZ and span > 0.0:
        rate = (len(values) - 1) / span  # readings that come in bursts are next to each other
    if len(values) < LEAST_TIMED or _SLOWEST_HZ <= rate <= _FASTEST_HZ or math.isnan(rate):
        return ""
    fitting = (
        (factor, in_words, unit)
        for factor, in_words, unit in _OTHER_UNITS
        if _USUAL_HZ[0] <= rate * factor <= _USUAL_HZ[1]
    )
    factor, in_words, unit = next(fitting, (0.0, "", "ms"))
    guess = f", but would be {rate * factor:.4g} Hz if the times were in {in_words}"
    if factor < 1.0 and _USUAL_HZ[0] <= rate / DAY_S <= _USUAL_HZ[1]:  # as spreadsheets write them
        guess += f", or {rate / DAY_S:.4g} Hz if they were in days (time=d)"
    return (
        f"the readings come at {rate:.3g} Hz{guess if in_words else ''}: check the unit of the "
        f"stamps (--units time={unit} of a CSV), for B is wrong by the same factor"
    )


LEAST_TIMED = 500
_SLOWEST_HZ, _FASTEST_HZ = 4.5, 1e5
_USUAL_HZ = (20.0, 2e4)
"""Rates of force sensors and poses; and those beyond which nobody measures a tissue."""
_OTHER_UNITS = (
    (1e3, "milliseconds", "ms"),
    (1e6, "microseconds", "us"),
    (1e9, "nanoseconds", "ns"),
    (1e-3, "seconds, not in milliseconds", "s"),
    (1e-6, "seconds, not in microseconds", "s"),
    (1 / 60, "minutes", "min"),
)
"""Factor on the rate, words, and the unit of a CSV; likelier ones first. A column that is called by
a smaller unit than it has is likelier than minutes."""
