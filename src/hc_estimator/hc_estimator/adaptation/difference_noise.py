"""Sensor noise from the eighth difference of the raw readings: no model, no innovation.

High differences of a smooth signal are nearly zero, those of order m of white noise of variance r
have the variance C(2m, m) r. Their squares, divided by that, measure the noise at every sample,
whatever the tissue does. The higher the order, the less of the motion leaks in at low rates; eight
is as far as the error of the estimate hardly grows. A long running mean is the noise in use; when
a short mean departs from it the long one restarts from the short one, so that a sensor that turns
noisier is followed at once, and is told from a tissue that changed: a step of the force enters
only eight differences, and each is limited against the noise known so far.

Readings that the outlier gate refuses break the even spacing, and a sensor that turns ten times
noisier has half of them refused. Refused innovations that disagree among themselves are such a
sensor's, and their scatter is its noise; those of a changed tissue or of a tool that turns agree.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hc_estimator.compilation import compiled
from hc_estimator.specification import ParameterSpecification

SPECIFICATIONS = (
    ParameterSpecification(
        "noise_memory",
        "float",
        1000.0,
        "Samples over which the sensor noise is averaged.",
        minimum=50.0,
        maximum=1e7,
    ),
    ParameterSpecification(
        "noise_short_memory",
        "float",
        40.0,
        "Samples of the short average that a jump of the noise is seen in.",
        minimum=10.0,
        maximum=1e5,
    ),
    ParameterSpecification(
        "noise_jump_ratio",
        "float",
        3.5,
        "The short average of the noise variance departing from the long one by this factor, "
        "either way, is a jump: the long average restarts from the short one.",
        minimum=1.5,
        maximum=1e6,
    ),
    ParameterSpecification(
        "displacement_noise_floor",
        "float",
        1e-5,
        "The estimated standard deviation of the displacement noise does not fall below this.",
        minimum=1e-12,
        maximum=1e3,
        unit="mm",
    ),
    ParameterSpecification(
        "force_noise_floor",
        "float",
        1e-5,
        "The estimated standard deviation of the force noise does not fall below this.",
        minimum=1e-12,
        maximum=1e3,
        unit="N",
    ),
)

ORDER = 8
WEIGHTS = np.array([(-1.0) ** k * math.comb(ORDER, k) for k in range(ORDER + 1)])
VARIANCE = float(math.comb(2 * ORDER, ORDER))  # of the difference of white noise of variance 1
FIRST_SAMPLES = 16  # differences before they replace the noise given in the settings
AFTER_JUMP = 10  # differences that the restarted long mean counts for
LATEST = 12  # differences in the quickest mean, for the change detector
LARGEST_RATIO = 16.0  # of one squared difference against the long mean
# A step that differs from the usual one by more than this share breaks the even spacing.
UNEVEN = 0.5
SCATTERED = 2  # in difference_jumped, until the next accepted sample
REFUSED = 3  # refused innovations that say whether they scatter
SCATTER_RATIO = 9.0  # of their scatter to the noise variance known so far, at least
REFUSED_WITHIN = 12  # accepted samples among which they lie

FIELDS = (
    ("readings", np.float64, (ORDER + 1, 2)),  # the last ones, oldest first
    ("readings_count", np.int64, ()),  # how many of them follow one another evenly
    ("readings_step", np.float64, ()),  # usual step between two of them [s]
    ("difference_count", np.int64, (2,)),  # differences since the start or the last jump
    ("difference_mean", np.float64, (2,)),  # long running mean of the noise variance
    ("difference_short_mean", np.float64, (2,)),
    ("difference_latest", np.float64, (LATEST, 2)),  # ring of squared differences
    ("difference_position", np.int64, ()),
    ("difference_jumped", np.int64, (2,)),  # 1 or -1 where the noise jumped up or down
    ("refused_innovations", np.float64, (REFUSED, 2)),  # ring of the latest refused
    ("refused_accepted", np.int64, (REFUSED, 2)),  # accepted samples before each of them
    ("refused_count", np.int64, (2,)),
)


@compiled
def restart(memory: Any) -> None:
    """Forget the readings and what they said."""
    memory.readings_count = 0
    memory.difference_count[:] = 0
    memory.difference_latest[:, :] = 0.0
    memory.refused_count[:] = 0


@compiled
def _take_reading(memory: Any) -> bool:
    """Append memory.measurement; True once enough evenly spaced readings are there."""
    readings = memory.readings
    step = memory.elapsed
    if memory.restart != 0:
        memory.readings_count = 0
    elif memory.readings_count == 1:
        memory.readings_step = step
    elif memory.readings_count > 1:
        if abs(step - memory.readings_step) > UNEVEN * memory.readings_step:
            memory.readings_count = 0
        else:
            memory.readings_step += 0.1 * (step - memory.readings_step)
    for k in range(ORDER):
        readings[k, 0] = readings[k + 1, 0]
        readings[k, 1] = readings[k + 1, 1]
    readings[ORDER, 0] = memory.measurement[0]
    readings[ORDER, 1] = memory.measurement[1]
    memory.readings_count = min(memory.readings_count + 1, ORDER + 1)
    return memory.readings_count > ORDER  # type: ignore[no-any-return]


@compiled
def learn(settings: Any, memory: Any) -> None:
    """Take the accepted sample in memory.measurement into the noise estimate memory.noise."""
    for i in range(2):
        memory.difference_jumped[i] = 1 if memory.difference_jumped[i] == SCATTERED else 0
    if not _take_reading(memory):
        return
    memory.difference_position = (memory.difference_position + 1) % LATEST
    for i in range(2):
        difference = 0.0
        for k in range(ORDER + 1):
            difference += WEIGHTS[k] * memory.readings[k, i]
        variance = difference * difference / VARIANCE
        memory.difference_latest[memory.difference_position, i] = variance
        memory.difference_count[i] += 1
        count = float(memory.difference_count[i])
        long_mean = memory.difference_mean[i]
        short = memory.difference_short_mean[i]
        if count > FIRST_SAMPLES:
            variance = min(variance, LARGEST_RATIO * long_mean)
        elif count == 1.0:
            long_mean = 0.0
            short = 0.0
        long_mean += (variance - long_mean) / min(count, settings.noise_memory)
        short += (variance - short) / min(count, settings.noise_short_memory)
        floor = settings.displacement_noise_floor if i == 0 else settings.force_noise_floor
        floor *= floor
        long_mean = max(long_mean, floor)
        short = max(short, floor)
        ratio = settings.noise_jump_ratio
        if count > FIRST_SAMPLES and (short > ratio * long_mean or short * ratio < long_mean):
            memory.difference_jumped[i] = 1 if short > long_mean else -1
            memory.difference_count[i] = AFTER_JUMP
            long_mean = short
        memory.difference_mean[i] = long_mean
        memory.difference_short_mean[i] = short
        if memory.difference_count[i] >= FIRST_SAMPLES or memory.difference_jumped[i] != 0:
            memory.noise[i] = long_mean


@compiled
def latest(memory: Any, channel: int) -> float:
    """Mean of the last few squared differences: noisy, and as quick as the noise can be seen."""
    total = 0.0
    for k in range(LATEST):
        total += memory.difference_latest[k, channel]
    return total / LATEST


@compiled
def cautious(memory: Any, channel: int) -> float:
    """Noise variance of a channel after at least one difference, rather too large than too small.

    A mean of few squares is as often too small as too large, and too small does the harm.
    """
    return memory.difference_mean[channel] * (1.0 + 3.0 / memory.difference_count[channel])  # type: ignore[no-any-return]


@compiled
def learn_refused(settings: Any, memory: Any) -> bool:
    """Look at an innovation that was refused; True if such innovations scatter like noise.

    The noise is then theirs, and the gate opens by it.
    """
    limit = settings.outlier_gate * settings.outlier_gate
    rose = False
    for i in range(2):
        innovation = memory.innovation[i]
        if innovation * innovation <= limit * memory.innovation_covariance[i, i]:
            continue
        place = memory.refused_count[i] % REFUSED
        memory.refused_innovations[place, i] = innovation
        memory.refused_accepted[place, i] = memory.accepted
        memory.refused_count[i] += 1
        if memory.refused_count[i] < REFUSED:
            continue
        first = memory.refused_accepted[memory.refused_count[i] % REFUSED, i]
        if memory.accepted - first > REFUSED_WITHIN:
            continue
        mean = 0.0
        for k in range(REFUSED):
            mean += memory.refused_innovations[k, i] / REFUSED
        scatter = 0.0
        for k in range(REFUSED):
            scatter += (memory.refused_innovations[k, i] - mean) ** 2 / (REFUSED - 1)
        if scatter > mean * mean and scatter > SCATTER_RATIO * memory.difference_mean[i]:
            memory.difference_mean[i] = scatter
            memory.difference_short_mean[i] = scatter
            memory.difference_count[i] = AFTER_JUMP
            memory.difference_jumped[i] = SCATTERED
            memory.refused_count[i] = 0
            rose = True
    if rose:
        memory.outlier_count = 0
    return rose
