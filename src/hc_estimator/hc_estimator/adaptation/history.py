"""What was felt before: samples thinned out over the contact with one tissue.

A recursive filter has no means to see what its new parameters make of the samples that it has
used up; least squares over remembered samples has (`hindsight` says what for). At first every
sample is remembered, so that the first tenth of a second already counts; whenever the memory is
full, every second one is forgotten and the spacing doubles, up to `history_interval`. From then on
the latest samples are kept.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hc_estimator.compilation import compiled
from hc_estimator.linear_algebra import copy_vector
from hc_estimator.specification import ParameterSpecification

SPECIFICATIONS = (
    ParameterSpecification(
        "history_interval",
        "float",
        0.02,
        "Time in contact between two remembered samples, up to which it grows; the latest 512 "
        "are kept.",
        minimum=1e-3,
        maximum=10.0,
        unit="s",
    ),
)

POINTS = 512
BEFORE, AFTER = 4, 40  # samples around those in which a turn showed, whose velocity is wrong too
SLOWEST = 3.0  # deviations of the velocity below which the tool is taken to be at rest

FIELDS = (
    # Ring: displacement, velocity, force, 1 if the tool was turning and the velocity is wrong.
    ("history", np.float64, (POINTS, 4)),
    ("history_count", np.int64, ()),  # samples remembered since the start or the last change
    ("history_spacing", np.float64, ()),  # of them, in contact [s]; doubles up to the interval
    ("history_time", np.float64, ()),  # in contact since the last of them [s]
    ("history_held", np.float64, ()),  # in contact since the estimate was held against them [s]
    ("history_turning", np.int64, ()),  # samples for which the tool is still taken to turn
    ("history_turns", np.int64, ()),  # turns so far
    ("history_before", np.int64, ()),  # history_count when no contest ran
)


@compiled
def restart(memory: Any) -> None:
    """Nothing was felt of this tissue yet."""
    memory.history_count = 0
    memory.history_spacing = 0.0
    memory.history_time = 0.0
    memory.history_held = 0.0
    memory.history_before = 0
    memory.history_turning = 0
    memory.history_turns = 0


@compiled
def learn(settings: Any, memory: Any) -> bool:
    """Remember the accepted sample if it is time to; True if it was remembered."""
    memory.history_turning = max(memory.history_turning - 1, 0)
    if memory.bank_turned > 0:
        _mark_turn(memory)
    if not memory.state[0] > 0.0 or memory.restart != 0:
        return False
    memory.history_time += memory.elapsed
    memory.history_held += memory.elapsed
    if memory.history_time + 0.5 * memory.elapsed < memory.history_spacing:
        return False
    memory.history_time = 0.0
    velocity = memory.state[1]
    point = memory.history[memory.history_count % POINTS]
    point[0] = memory.state[0]
    # At rest the velocity is noise, and least squares would read from it that nothing is damped.
    at_rest = velocity * velocity < SLOWEST**2 * memory.covariance[1, 1]
    point[1] = 0.0 if at_rest else velocity
    point[2] = memory.measurement[1]
    point[3] = 1.0 if memory.history_turning > 0 else 0.0
    memory.history_count += 1
    if memory.history_count == POINTS and memory.history_spacing < settings.history_interval:
        _thin_out(settings, memory)
    return True


@compiled
def _mark_turn(memory: Any) -> None:
    """Mark the samples since the turn that the displacement has just shown, and the next ones."""
    memory.history_turning = AFTER
    memory.history_turns += 1
    points = math.ceil((memory.bank_turned + BEFORE) * memory.elapsed / spacing(memory))
    first = max(memory.history_count - points, oldest(memory))
    for k in range(first, memory.history_count):
        memory.history[k % POINTS, 3] = 1.0


@compiled
def _thin_out(settings: Any, memory: Any) -> None:
    """Forget every second sample, and remember half as many from now on."""
    for k in range(POINTS // 2):
        copy_vector(memory.history[2 * k + 1], memory.history[k])
    memory.history_count = POINTS // 2
    memory.history_before //= 2
    memory.fit_count //= 2
    memory.history_spacing = min(2.0 * spacing(memory), settings.history_interval)


@compiled
def spacing(memory: Any) -> float:
    """Time in contact between two remembered samples at present [s]."""
    return max(memory.history_spacing, memory.elapsed)  # type: ignore[no-any-return]


@compiled
def oldest(memory: Any) -> int:
    """Number of the first sample that is still remembered."""
    return max(memory.history_count - POINTS, 0)  # type: ignore[no-any-return]


@compiled
def samples(settings: Any, memory: Any, intervals: int) -> int:
    """How many remembered samples make so many intervals."""
    return math.ceil(intervals * settings.history_interval / spacing(memory))  # type: ignore[no-any-return]
