"""What happens to a sample before the filter sees it: refused with a reason, or let through.

Refused are readings that are not finite, stamps that repeat or run backward, and readings beyond
what the sensor can deliver. After a gap in time, or when a clock was set back, the motion starts
anew, and the parameters stay.

Where only the force is beyond its range, only the force is refused, and the displacement goes on
being used: a filter that knows nothing of the tool for as long as a sensor is saturated learns from
the forces afterwards at a depth that it guesses. Such a sample is reported as out of range all the
same (`report.say_range`).

A gap is short: where the tool is after a third of a second is known to millimetres at best, and
over those the contact law is no straight line. A filter that foretells the motion so far and takes
a force there goes astray (`ukf`: four times the stiffness); one that begins with the depth as it is
measured loses some samples until the velocity is known.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hc_estimator.compilation import compiled
from hc_estimator.memory import Field
from hc_estimator.specification import ParameterSpecification

ACCEPTED = 0  # the numbers of estimate.Rejection, as constants for the kernels
NOT_FINITE = 1
TIME_REPEATED = 2
TIME_BACKWARD = 3
OUTLIER = 4
OUT_OF_RANGE = 5
NUMERICAL = 6

SHORTEST_GAP = 0.02  # without any reading; less is bridged [s]
GAP_PERIODS = 5.0  # and so many of the usual periods
PERIOD_SHARE = 0.1  # of the latest period in the usual one
PERIOD_GROWTH = 2.0  # over the usual one, at most: gaps are no periods

SPECIFICATIONS = (
    ParameterSpecification(
        "displacement_limit",
        "float",
        1e3,
        "A displacement beyond this, either way, is refused as out of range.",
        minimum=1e-3,
        maximum=1e6,
        unit="mm",
    ),
    ParameterSpecification(
        "force_limit",
        "float",
        1e3,
        "A force beyond this, either way, is refused, and its sample reported as out of range; the "
        "displacement beside it is used.",
        minimum=1e-3,
        maximum=1e6,
        unit="N",
    ),
    ParameterSpecification(
        "longest_gap",
        "float",
        0.5,
        "After a longer time without a displacement the motion starts anew; the parameters stay. "
        "So it does after 0.02 s without any reading, if that is five of the usual periods.",
        minimum=1e-3,
        maximum=3600.0,
        unit="s",
    ),
    ParameterSpecification(
        "missing_readings",
        "bool",
        False,
        "A NaN is a reading that is missing: the sample then holds the other one alone, at its own "
        "stamp. Otherwise a NaN is refused as not finite.",
        runtime=False,
    ),
    ParameterSpecification(
        "reorder_window",
        "float",
        0.0,
        "With missing_readings: a sample that comes so much later than younger ones is still used "
        "in its place, exactly, by going back and repeating what came since. 0: it is refused.",
        minimum=0.0,
        maximum=1.0,
        unit="s",
        runtime=False,
    ),
    ParameterSpecification(
        "clock_restart_samples",
        "int",
        50,
        "So many samples in a row whose stamps rise among themselves, yet lie before the last "
        "accepted one, are taken for a clock that was set back.",
        minimum=2,
        maximum=1000000,
    ),
    ParameterSpecification(
        "outlier_gate",
        "float",
        12.0,
        "An innovation beyond so many of its standard deviations, in either channel, is refused "
        "as an outlier.",
        minimum=3.0,
        maximum=1e9,
    ),
    ParameterSpecification(
        "outlier_limit",
        "int",
        3,
        "After so many outliers in a row samples are believed, until 30 in a row lie inside the "
        "gate: then it is no spike but a change. self_tuning_ukf believes a displacement that "
        "jumps after 0.5 s at the latest, and what only repeats itself once it moves. 0 switches "
        "the gate off.",
        minimum=0,
        maximum=1000000,
    ),
)


CLOCK_FIELDS = (
    Field("started", np.int64, (), 0, 1),  # 1 once a sample was accepted
    Field("accepted", np.int64, (), 0),  # accepted samples so far
    Field("last_time", np.float64),  # of the last accepted sample [s]
    # Of the last accepted reading of each channel since the start; NaN if there was none [s].
    Field("channel_time", np.float64, (2,), finite=False),
    Field("usual_period", np.float64, (), 0.0),  # between two accepted samples; 0 if unknown [s]
    Field("backward_time", np.float64),  # of the last sample that was refused as backward [s]
    Field("backward_count", np.int64, (), 0),  # how many such samples came one after another
    Field("outlier_counts", np.int64, (2,), 0),  # of each channel, one after another
    Field("refused_since", np.float64),  # stamp from which on all samples were refused [s]
    Field("refused_count", np.int64, (), 0),  # samples refused one after another
    # Of the present sample:
    Field("elapsed", np.float64),  # time since the last accepted sample [s]
    Field("restart", np.int64, (), 0, 1),  # 1 if the motion must be forgotten before this sample
    Field("measurement", np.float64, (2,)),  # displacement [mm], force [N]
    Field("present", np.int64, (2,), 0, 1),  # 0 for a reading that is missing
    Field("state_time", np.float64),  # at which the state stands [s]
    Field("force_time", np.float64),  # at which the last force was used [s]
    Field("force_elapsed", np.float64),  # from it to the force of the present sample [s]
    Field("period", np.float64),  # usual time between two samples [s]
    Field("offset", np.float64),  # of the displacement's stamp from it [s]
)


@compiled
def _is_gap(settings: Any, clock: Any, time: float) -> bool:
    """True if the motion cannot be foretold from the last sample to the stamp [s] of this one."""
    if time - clock.channel_time[0] > settings.longest_gap:
        return True
    return bool(clock.elapsed > max(SHORTEST_GAP, GAP_PERIODS * clock.usual_period))


@compiled
def screen(settings: Any, clock: Any, time: float, displacement: float, force: float) -> int:
    """Decide whether the filter may use a sample, and after what elapsed time.

    With the setting `missing_readings` a NaN is a reading that is missing; the sample then holds
    the other one alone. A force alone needs to know where the tool is: before the first
    displacement, and after a gap, its NaN is refused like any other, and the motion starts anew
    with the next displacement. A force beyond `force_limit` is missing as well, whatever that
    setting says.

    Args:
        settings: settings record.
        clock: record with CLOCK_FIELDS; elapsed, restart, measurement and present are written for
            an accepted sample, and stamps that run backward are counted.
        time: stamp [s].
        displacement: reading [mm].
        force: reading [N].

    Returns:
        ACCEPTED or the reason for the refusal.
    """
    clock.present[0] = 1
    clock.present[1] = 1
    if settings.missing_readings != 0:
        if math.isnan(displacement) and not math.isnan(force):
            clock.present[0] = 0
            displacement = 0.0
        elif math.isnan(force) and not math.isnan(displacement):
            clock.present[1] = 0
            force = 0.0
    if not (math.isfinite(time) and math.isfinite(displacement) and math.isfinite(force)):
        return NOT_FINITE
    if abs(displacement) > settings.displacement_limit:
        return OUT_OF_RANGE
    if abs(force) > settings.force_limit:
        if clock.present[0] == 0:
            return OUT_OF_RANGE
        clock.present[1] = 0
        force = 0.0
    clock.restart = 0
    clock.elapsed = 0.0
    clock.measurement[0] = displacement
    clock.measurement[1] = force
    if clock.started == 0:
        clock.channel_time[0] = math.nan
        clock.channel_time[1] = math.nan
        clock.restart = 1
        return ACCEPTED if clock.present[0] != 0 else NOT_FINITE
    if time < clock.last_time:
        in_order = clock.backward_count > 0 and time > clock.backward_time
        clock.backward_count = clock.backward_count + 1 if in_order else 1
        clock.backward_time = time
        if clock.backward_count < settings.clock_restart_samples:
            return TIME_BACKWARD
        clock.restart = 1
        return ACCEPTED if clock.present[0] != 0 else NOT_FINITE
    for i in range(2):  # two channels may share a stamp, two readings of one may not
        if clock.present[i] != 0 and time == clock.channel_time[i]:
            return TIME_REPEATED
    clock.elapsed = time - clock.last_time
    if _is_gap(settings, clock, time):
        clock.restart = 1
        return ACCEPTED if clock.present[0] != 0 else NOT_FINITE
    return ACCEPTED


@compiled
def note_accepted(clock: Any, time: float) -> None:
    """Take the stamp of a sample that was used."""
    if clock.started != 0 and time > clock.last_time:
        period, usual = time - clock.last_time, clock.usual_period
        if usual == 0.0:
            clock.usual_period = period
        else:
            period = min(period, PERIOD_GROWTH * usual)
            clock.usual_period += PERIOD_SHARE * (period - usual)
    clock.last_time = time
    for i in range(2):
        if clock.present[i] != 0:
            clock.channel_time[i] = time
    clock.started = 1
    clock.accepted += 1
    clock.backward_count = 0
