"""Sensor noise from the fifth difference of the raw readings: no model, no innovation.

The fifth difference of a smooth signal is nearly zero, that of white noise of variance r has the
variance 252 r (1 + 25 + 100 + 100 + 25 + 1). A long running mean of its square is the noise in
use; when a short mean departs from it the long one restarts from the short one, so that a sensor
that turns noisier is followed at once, and is told from a tissue that changed.
"""

from __future__ import annotations

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
        48.0,
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

ORDER = 5
VARIANCE = 252.0  # of the fifth difference of white noise of variance 1
FIRST_SAMPLES = 24  # differences before they replace the noise given in the settings
# Successive steps that differ by more than this share do not count as evenly spaced.
UNEVEN = 0.2

FIELDS = (
    ("readings", np.float64, (6, 2)),  # the last six, oldest first
    ("readings_count", np.int64, ()),  # how many of them follow one another evenly
    ("readings_step", np.float64, ()),  # the last step between two of them [s]
    ("difference_count", np.int64, ()),  # differences since the start or the last jump
    ("difference_mean", np.float64, (2,)),  # long running mean of the noise variance
    ("difference_short_mean", np.float64, (2,)),
)


@compiled
def restart(memory: Any) -> None:
    """Forget the readings and what they said."""
    memory.readings_count = 0
    memory.difference_count = 0


@compiled
def learn(settings: Any, memory: Any) -> None:
    """Take the accepted sample in memory.measurement into the noise estimate memory.noise."""
    readings = memory.readings
    step = memory.elapsed
    even = memory.restart == 0
    if memory.readings_count >= 2:
        even = even and abs(step - memory.readings_step) <= UNEVEN * memory.readings_step
    if not even:
        memory.readings_count = 0
    memory.readings_step = step
    for k in range(ORDER):
        readings[k, 0] = readings[k + 1, 0]
        readings[k, 1] = readings[k + 1, 1]
    readings[ORDER, 0] = memory.measurement[0]
    readings[ORDER, 1] = memory.measurement[1]
    memory.readings_count = min(memory.readings_count + 1, ORDER + 1)
    if memory.readings_count <= ORDER:
        return
    memory.difference_count += 1
    count = float(memory.difference_count)
    long_share = 1.0 / min(count, settings.noise_memory)
    short_share = 1.0 / min(count, settings.noise_short_memory)
    jumped = False
    for i in range(2):
        difference = (
            readings[5, i]
            - 5.0 * readings[4, i]
            + 10.0 * readings[3, i]
            - 10.0 * readings[2, i]
            + 5.0 * readings[1, i]
            - readings[0, i]
        )
        variance = difference * difference / VARIANCE
        memory.difference_mean[i] += long_share * (variance - memory.difference_mean[i])
        short = memory.difference_short_mean[i]
        short += short_share * (variance - short)
        memory.difference_short_mean[i] = short
        floor = settings.displacement_noise_floor if i == 0 else settings.force_noise_floor
        floor *= floor
        long_mean = max(memory.difference_mean[i], floor)
        ratio = max(short, floor) / long_mean
        if count > settings.noise_short_memory and (
            ratio > settings.noise_jump_ratio or ratio * settings.noise_jump_ratio < 1.0
        ):
            memory.difference_mean[i] = short
            long_mean = max(short, floor)
            jumped = True
        if count >= FIRST_SAMPLES:
            memory.noise[i] = long_mean
    if jumped:
        memory.difference_count = int(settings.noise_short_memory)
