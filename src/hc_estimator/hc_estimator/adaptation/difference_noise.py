"""Sensor noise from the eighth difference of the raw readings: no model, no innovation.

High differences of a smooth signal are nearly zero, those of order m of white noise of variance r
have the variance C(2m, m) r. Their squares, divided by that, measure the noise at every sample,
whatever the tissue does. The higher the order, the less of the motion leaks in at low rates; eight
is as far as the error of the estimate hardly grows. Where readings are missing it is the divided
difference, whose weights are found from the stamps: a force of which every fourth reading is
missing never has nine in a row. (Stamps that shake count as noise: they shake more often than the
sensors do, and of real recordings at 66 Hz the force was foretold 12 % worse with noise that
believes them.) A long running mean is the noise in use;
when a short mean departs from it the long one restarts from the short one, so that a sensor that
turns noisier is followed at once, and is told from a tissue that changed: a step of the force
enters only eight differences, and each is limited against the noise known so far.

A sensor that turns ten times noisier has half of its readings refused by the outlier gate. Refused
innovations that disagree among themselves are such a sensor's, and their scatter is its noise;
those of a changed tissue or of a tool that turns agree, in their sign at least.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hc_estimator.compilation import compiled
from hc_estimator.memory import Field, record_type
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
# Time that nine readings may take, over that of as many even ones: over more, motion leaks in.
LONGEST = 1.3
UNEVEN = 0.5  # a step that differs by no more than this share from the usual one is a usual one
# A reading is missing where so many of the latest steps are shorter than this one by a factor.
GAP, SHORTER = 1.8, 3
LONG_STEP = 4.0  # from so many usual steps on, a step is a gap
SAME_TIME = 1e-3  # a step of less than this share of the usual one is none
SCATTERED = 2  # in jumped, until the next reading
REFUSED = 3  # refused innovations that say whether they scatter
SCATTER_RATIO = 9.0  # of their scatter to the noise variance known so far, at least
REFUSED_WITHIN = 12  # accepted samples among which they lie
PLAUSIBLE = 2.0  # deviations (Poisson) by which more may be accepted there than the scatter says

# What is known of one channel.
NOISE = record_type(
    (
        Field("readings", np.float64, (ORDER + 1,)),  # the last ones, oldest first
        Field("times", np.float64, (ORDER + 1,)),  # their stamps [s]
        Field("readings_count", np.int64, (), 0, ORDER + 1),  # that follow one another
        Field("even_count", np.int64, (), 0, ORDER + 1),  # the latest of them with none missing
        Field("step", np.float64, (), 0.0),  # usual step between two of them [s]
        Field("count", np.int64, (), 0),  # differences since the start or the last jump
        Field("mean", np.float64, (), 0.0),  # long running mean of the noise variance
        Field("short_mean", np.float64, (), 0.0),
        Field("squares", np.float64, (LATEST,), 0.0),  # ring of squared differences
        Field("position", np.int64, (), 0, LATEST - 1),
        Field("jumped", np.int64, (), -1, SCATTERED),  # 1 or -1 where the noise jumped up or down
        Field("refused", np.float64, (REFUSED,)),  # ring of the latest refused innovations
        Field("refused_after", np.int64, (REFUSED,), 0),  # readings before each of them
        Field("refused_count", np.int64, (), 0),
        Field("taken", np.int64, (), 0),  # readings so far
    )
)


@compiled
def restart(channel: Any) -> None:
    """Forget the readings and what they said."""
    channel.readings_count = 0
    channel.count = 0
    channel.refused_count = 0
    for k in range(LATEST):
        channel.squares[k] = 0.0


@compiled
def append(readings: Any, reading: float) -> None:
    """Append a reading to the last ones, oldest first, shape (ORDER + 1,); the oldest goes."""
    for k in range(ORDER):
        readings[k] = readings[k + 1]
    readings[ORDER] = reading


@compiled
def variance_of(readings: Any) -> float:
    """Variance of white noise, as the square of the difference of so many readings says it."""
    difference = 0.0
    for k in range(ORDER + 1):
        difference += WEIGHTS[k] * readings[k]
    return difference * difference / VARIANCE


@compiled
def uneven_variance_of(times: Any, readings: Any) -> float:
    """The same of readings at any times [s], by their divided difference."""
    span, latest = times[ORDER] - times[0], readings[ORDER]
    difference, squares = 0.0, 0.0
    for k in range(ORDER + 1):
        product = 1.0
        for j in range(ORDER + 1):
            if j != k:
                product *= (times[k] - times[j]) / span
        weight = 1.0 / product
        difference += weight * (readings[k] - latest)
        squares += weight * weight
    return difference * difference / squares


@compiled
def follows(channel: Any) -> bool:
    """True if the last reading follows the one before."""
    return bool(channel.even_count > 1)


@compiled
def _is_next(channel: Any) -> bool:
    """True if no reading is missing between the last two of some."""
    times, shorter = channel.times, 0
    step = times[ORDER] - times[ORDER - 1]
    for k in range(ORDER + 2 - channel.readings_count, ORDER):
        if GAP * (times[k] - times[k - 1]) < step:
            shorter += 1
    return bool(shorter < SHORTER and abs(step - channel.step) <= UNEVEN * channel.step)


@compiled
def _take_reading(channel: Any, time: float, reading: float, broken: bool) -> bool:
    """Append a reading; True once enough of them are there, close to one another."""
    times = channel.times
    step = time - times[ORDER]
    if broken or step < 0.0:  # another delay may put a reading before the last one
        channel.readings_count = 0
    elif channel.readings_count > 0:
        if step <= SAME_TIME * channel.step:
            return False
        few = channel.readings_count <= ORDER
        if few and LONG_STEP * step < channel.step:  # what was before was before a gap
            channel.readings_count = 1
        if channel.readings_count == 1:
            channel.step = step
    channel.taken += 1
    append(channel.readings, reading)
    append(times, time)
    channel.readings_count = min(channel.readings_count + 1, ORDER + 1)
    next_one = channel.readings_count > 1 and _is_next(channel)
    channel.even_count = min(channel.even_count + 1, ORDER + 1) if next_one else 1
    if channel.readings_count > 2:
        channel.step += 0.1 * (min(step, LONG_STEP * channel.step) - channel.step)
    span = times[ORDER] - times[0]
    return channel.readings_count > ORDER and span <= LONGEST * ORDER * channel.step  # type: ignore[no-any-return]


@compiled
def learn(
    settings: Any, channel: Any, time: float, reading: float, broken: bool, floor: float
) -> bool:
    """Take an accepted reading into what is known of its channel.

    Args:
        settings: settings record.
        channel: record of the channel; changed.
        time: stamp of the reading [s].
        reading: displacement [mm] or force [N].
        broken: True if the reading does not follow the last one (a start, a gap).
        floor: smallest standard deviation that is believed, in the unit of the reading.

    Returns:
        True if channel.mean is a noise variance that can be used, and has changed.
    """
    channel.jumped = 1 if channel.jumped == SCATTERED else 0
    if not _take_reading(channel, time, reading, broken):
        return False
    if channel.even_count > ORDER:
        variance = variance_of(channel.readings)
    else:
        variance = uneven_variance_of(channel.times, channel.readings)
    channel.position = (channel.position + 1) % LATEST
    channel.squares[channel.position] = variance
    channel.count += 1
    count = float(channel.count)
    long_mean, short = channel.mean, channel.short_mean
    if count > FIRST_SAMPLES:
        variance = min(variance, LARGEST_RATIO * long_mean)
    elif count == 1.0:
        long_mean = 0.0
        short = 0.0
    long_mean += (variance - long_mean) / min(count, settings.noise_memory)
    short += (variance - short) / min(count, settings.noise_short_memory)
    long_mean = max(long_mean, floor * floor)
    short = max(short, floor * floor)
    ratio = settings.noise_jump_ratio
    if count > FIRST_SAMPLES and (short > ratio * long_mean or short * ratio < long_mean):
        channel.jumped = 1 if short > long_mean else -1
        channel.count = AFTER_JUMP
        long_mean = short
    channel.mean = long_mean
    channel.short_mean = short
    return channel.count >= FIRST_SAMPLES or channel.jumped != 0  # type: ignore[no-any-return]


@compiled
def latest(channel: Any) -> float:
    """Mean of the last few squared differences: noisy, and as quick as the noise can be seen."""
    total = 0.0
    for k in range(LATEST):
        total += channel.squares[k]
    return total / LATEST


@compiled
def cautious(channel: Any) -> float:
    """Noise variance of a channel after at least one difference, rather too large than too small.

    A mean of few squares is as often too small as too large, and too small does the harm.
    """
    return channel.mean * (1.0 + 3.0 / channel.count)  # type: ignore[no-any-return]


@compiled
def learn_refused(channel: Any, innovation: float, gate: float) -> bool:
    """Look at an innovation that the outlier gate refused; True if such innovations scatter.

    The noise is then theirs, and the gate opens by it. Readings between them that were accepted
    must be likely by that noise as well: else they are single outliers of a sensor that is as good
    as it was.

    Args:
        channel: record of the channel; changed.
        innovation: that was refused, in the unit of the reading.
        gate: innovation from which on readings are refused, in that unit.
    """
    place = channel.refused_count % REFUSED
    channel.refused[place] = innovation
    channel.refused_after[place] = channel.taken
    channel.refused_count += 1
    if channel.refused_count < REFUSED or channel.count == 0:
        return False
    first = channel.refused_after[channel.refused_count % REFUSED]
    accepted = float(channel.taken - first)
    if accepted > REFUSED_WITHIN:
        return False
    mean, above = 0.0, 0
    for k in range(REFUSED):
        mean += channel.refused[k] / REFUSED
        above += 1 if channel.refused[k] > 0.0 else 0
    if above == 0 or above == REFUSED:
        return False  # what sets off from rest is ever further off, on the same side
    scatter = 0.0
    for k in range(REFUSED):
        scatter += (channel.refused[k] - mean) ** 2 / (REFUSED - 1)
    if not (scatter > mean * mean and scatter > SCATTER_RATIO * channel.mean):
        return False
    expected = (accepted + REFUSED) * math.erf(gate / math.sqrt(2.0 * scatter))
    if accepted > expected + PLAUSIBLE * math.sqrt(expected):
        return False
    channel.mean = scatter
    channel.short_mean = scatter
    channel.count = AFTER_JUMP
    channel.jumped = SCATTERED
    channel.refused_count = 0
    return True
