"""Compiled sensors: from the true value to the reading, in the order in which it happens.

Late value, bias and drift, noise, spike, saturation, quantisation, dropout.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hc_sim_rig.compilation import inlined
from hc_sim_rig.layout import (
    DRAW_DROPOUT,
    DRAW_NOISE,
    DRAW_SPIKE,
    DRAW_WALK,
    HISTORY,
    MEMORY_DROPPED,
    MEMORY_HELD,
    MEMORY_WALK,
    SENSOR_BIAS,
    SENSOR_DELAY,
    SENSOR_DRIFT,
    SENSOR_DROPOUT_END,
    SENSOR_DROPOUT_NAN,
    SENSOR_DROPOUT_PROBABILITY,
    SENSOR_MAXIMUM,
    SENSOR_MINIMUM,
    SENSOR_RESOLUTION,
    SENSOR_SPIKE_PROBABILITY,
    SENSOR_SPIKE_SIZE,
    SENSOR_WALK,
)


@inlined
def late_value(
    channel: int, value: float, tick: int, rate: float, delay: float, history: NDArray[np.float64]
) -> float:
    """Value of a channel some time ago, straight between samples; the first one before that."""
    history[channel, tick % HISTORY] = value
    if delay <= 0.0:
        return value
    samples = min(delay * rate, float(tick))
    whole = int(samples)
    part = samples - whole
    newer = history[channel, (tick - whole) % HISTORY]
    if part == 0.0:
        return float(newer)
    older = history[channel, (tick - whole - 1) % HISTORY]
    return float(newer + part * (older - newer))


@inlined
def reading(
    channel: int,
    value: float,
    noise_std: float,
    tick: int,
    rate: float,
    sensors: NDArray[np.float64],
    memory: NDArray[np.float64],
    history: NDArray[np.float64],
    draw: NDArray[np.float64],
) -> float:
    """Reading of one sensor at one sample.

    Args:
        channel: 0 displacement, 1 force.
        value: the true value [mm or N].
        noise_std: standard deviation of the noise [mm or N].
        tick: number of the sample.
        rate: samples per second [Hz].
        sensors: (2, SENSOR_COLUMNS) constants.
        memory: (2, MEMORY_COLUMNS), changed in place.
        history: (2, HISTORY) true values, changed in place.
        draw: (DRAWS,) random draws of this sample.
    """
    value = late_value(channel, value, tick, rate, sensors[channel, SENSOR_DELAY], history)
    value += sensors[channel, SENSOR_BIAS] + sensors[channel, SENSOR_DRIFT] * (tick / rate)
    if sensors[channel, SENSOR_WALK] > 0.0:
        memory[channel, MEMORY_WALK] += (
            sensors[channel, SENSOR_WALK] * draw[DRAW_WALK + channel] / math.sqrt(rate)
        )
        value += memory[channel, MEMORY_WALK]
    value += noise_std * draw[DRAW_NOISE + channel]
    chance = sensors[channel, SENSOR_SPIKE_PROBABILITY]
    if draw[DRAW_SPIKE + channel] < chance:
        size = sensors[channel, SENSOR_SPIKE_SIZE]
        value += size if draw[DRAW_SPIKE + channel] < 0.5 * chance else -size
    value = min(max(value, sensors[channel, SENSOR_MINIMUM]), sensors[channel, SENSOR_MAXIMUM])
    resolution = sensors[channel, SENSOR_RESOLUTION]
    if resolution > 0.0:
        value = math.floor(value / resolution + 0.5) * resolution
    if memory[channel, MEMORY_DROPPED] > 0.0:
        if draw[DRAW_DROPOUT + channel] < sensors[channel, SENSOR_DROPOUT_END]:
            memory[channel, MEMORY_DROPPED] = 0.0
    elif draw[DRAW_DROPOUT + channel] < sensors[channel, SENSOR_DROPOUT_PROBABILITY]:
        memory[channel, MEMORY_DROPPED] = 1.0
    if memory[channel, MEMORY_DROPPED] > 0.0:
        if sensors[channel, SENSOR_DROPOUT_NAN] > 0.0:
            return np.nan
        return float(memory[channel, MEMORY_HELD])
    memory[channel, MEMORY_HELD] = value
    return value
