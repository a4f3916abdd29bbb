"""Do the readings come in steps? What a sensor's resolution leaves unknown.

An encoder of 0.05 mm, read at 1 kHz on a tool of 5 mm/s, says the same ten times over. High
differences of that show half of the noise that there is, and none at all where the tool is slow
(`difference_noise`): B was 50 to 70 % off, K up to 3 %, and a misfit was told in a third of the
time. What rounding leaves open is a step's uniform error (Widrow, Kollar and Liu, IEEE Trans.
Instrumentation and Measurement 45, 1996), and no sensor is told to be better than that. No more
either: over a run of equal readings that error goes from one end of the step to the other, and
hardly anything of it is left at the frequencies of a tool (with the run's variance B was 12 to 17 %
off). Where noise shakes a reading by more than a step the readings tell it themselves.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from hc_estimator.compilation import compiled
from hc_estimator.memory import Field, record_type

UNIFORM = 1.0 / 12.0  # variance of an error that is uniform over one step
FEWEST = 8  # readings that differ from the last one that say something
MEMORY = 64  # of them
# Share of them that come after one that was equal to the last. Of exact readings of a ramp that
# rests now and then hardly any does.
REPEATED = 0.25

RESOLUTION = record_type(
    (
        Field("last", np.float64),  # reading
        Field("count", np.int64, (), 0, MEMORY),  # readings that differed from the last one
        Field("step", np.float64, (), 0.0),  # the smallest of these differences; 0: none yet
        Field("repeated", np.float64, (), 0.0, 1.0),  # share of them that came after equal ones
        Field("equal", np.int64, (), 0, 1),  # 1 where the last one was equal to the one before
        Field("begun", np.int64, (), 0, 1),  # 1 where there is a last one
    )
)


@compiled
def restart(resolution: Any) -> None:
    """Nothing is known."""
    resolution.begun = 0
    resolution.count = 0
    resolution.step = 0.0
    resolution.repeated = 0.0


@compiled
def learn(resolution: Any, reading: float, broken: bool) -> None:
    """Take a reading.

    Args:
        resolution: of the channel; changed.
        reading: [mm] or [N].
        broken: True if it does not follow the last one.
    """
    step = abs(reading - resolution.last)
    if broken or resolution.begun == 0:
        resolution.begun = 1
        resolution.equal = 0
    elif step == 0.0:
        resolution.equal = 1
    else:
        if resolution.step == 0.0 or step < resolution.step:
            resolution.step = step
        resolution.count = min(resolution.count + 1, MEMORY)
        resolution.repeated += (resolution.equal - resolution.repeated) / resolution.count
        resolution.equal = 0
    resolution.last = reading


@compiled
def variance(resolution: Any) -> float:
    """Variance of what rounding leaves open [mm^2] or [N^2]; 0 where there are no steps."""
    if resolution.count < FEWEST or resolution.repeated < REPEATED:
        return 0.0
    return UNIFORM * resolution.step * resolution.step  # type: ignore[no-any-return]
