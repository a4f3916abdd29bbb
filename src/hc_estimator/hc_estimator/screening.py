"""What happens to a sample before the filter sees it: refused with a reason, or let through.

Refused are readings that are not finite, stamps that repeat or run backward, and readings beyond
what the sensor can deliver. A gap in time, or a clock that was set back, is bridged: the motion
starts anew, the parameters stay.
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.specification import ParameterSpecification

ACCEPTED = 0  # the numbers of estimate.Rejection, as constants for the kernels
NOT_FINITE = 1
TIME_REPEATED = 2
TIME_BACKWARD = 3
OUTLIER = 4
OUT_OF_RANGE = 5
NUMERICAL = 6

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
        "A force beyond this, either way, is refused as out of range.",
        minimum=1e-3,
        maximum=1e6,
        unit="N",
    ),
    ParameterSpecification(
        "longest_gap",
        "float",
        0.5,
        "After a longer gap between two samples the motion starts anew; the parameters stay.",
        minimum=1e-3,
        maximum=3600.0,
        unit="s",
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
        "gate: then it is no spike but a change. 0 switches the gate off.",
        minimum=0,
        maximum=1000000,
    ),
)


@compiled
def screen(settings: Any, memory: Any, time: float, displacement: float, force: float) -> int:
    """Decide whether the filter may use a sample, and after what elapsed time.

    Writes memory.elapsed, memory.restart and memory.measurement for an accepted sample, and keeps
    count of stamps that run backward.

    Args:
        settings: settings record.
        memory: memory record.
        time: stamp [s].
        displacement: reading [mm].
        force: reading [N].

    Returns:
        ACCEPTED or the reason for the refusal.
    """
    if not (math.isfinite(time) and math.isfinite(displacement) and math.isfinite(force)):
        return NOT_FINITE
    if abs(displacement) > settings.displacement_limit or abs(force) > settings.force_limit:
        return OUT_OF_RANGE
    memory.restart = 0
    memory.elapsed = 0.0
    if memory.started == 0:
        memory.restart = 1
    elif time == memory.last_time:
        return TIME_REPEATED
    elif time < memory.last_time:
        in_order = memory.backward_count > 0 and time > memory.backward_time
        memory.backward_count = memory.backward_count + 1 if in_order else 1
        memory.backward_time = time
        if memory.backward_count < settings.clock_restart_samples:
            return TIME_BACKWARD
        memory.restart = 1
    else:
        memory.elapsed = time - memory.last_time
        if memory.elapsed > settings.longest_gap:
            memory.restart = 1
    memory.measurement[0] = displacement
    memory.measurement[1] = force
    return ACCEPTED
