"""What the default filters adapt, in hooks that a filter calls around its update.

`prepare` runs before the update and sets the measurement noise of this sample; `learn` runs after
an accepted sample and may change the noise, the covariance of the parameters (a changed tissue)
and the flags. Nothing here runs for a refused sample.
"""

from __future__ import annotations

import dataclasses
from typing import Any

from hc_estimator.adaptation import change_detection, difference_noise, tempering, variational_bayes
from hc_estimator.compilation import compiled
from hc_estimator.contact.registry import end_of_parameters
from hc_estimator.memory import Field
from hc_estimator.specification import ParameterSpecification
from hc_estimator.state_space import registry as state_space

UNLIKELY = 3.0  # deviations of the first guess from which on a parameter was led astray
FIXED = 0  # position in the choices of noise_adaptation
DIFFERENCES = 1
VARIATIONAL_BAYES = 2

NOISE_SPECIFICATIONS = (
    ParameterSpecification(
        "displacement_noise_std",
        "float",
        0.005,
        "Standard deviation of the displacement sensor's noise (the first guess where the noise is "
        "adapted).",
        minimum=1e-9,
        maximum=1e3,
        unit="mm",
    ),
    ParameterSpecification(
        "force_noise_std",
        "float",
        0.02,
        "Standard deviation of the force sensor's noise (the first guess where the noise is "
        "adapted).",
        minimum=1e-9,
        maximum=1e3,
        unit="N",
    ),
)

NOISE_ADAPTATION = ParameterSpecification(
    "noise_adaptation",
    "str",
    "differences",
    "Where the sensor noise comes from: the given values, or the differences of the raw readings.",
    choices=("fixed", "differences"),
    runtime=False,
)

NOISE_ADAPTATION_WITH_BAYES = dataclasses.replace(
    NOISE_ADAPTATION,
    description="Where the sensor noise comes from: the given values, the differences of the raw "
    "readings, or the innovations by variational Bayes.",
    choices=(*NOISE_ADAPTATION.choices, "variational_bayes"),
)

SPECIFICATIONS = (
    *NOISE_SPECIFICATIONS,
    NOISE_ADAPTATION_WITH_BAYES,
    *tempering.SPECIFICATIONS,
    *difference_noise.SPECIFICATIONS,
    *variational_bayes.SPECIFICATIONS,
    *change_detection.SPECIFICATIONS,
)
FIELDS = (
    *tempering.FIELDS,
    Field("noise_channels", difference_noise.NOISE, (2,)),
    *variational_bayes.FIELDS,
    *change_detection.FIELDS,
)


@compiled
def reset(settings: Any, memory: Any) -> None:
    """State of the adaptation before any sample."""
    for i in range(2):
        set_noise(settings, memory, i)
    tempering.restart(memory)
    for i in range(2):
        difference_noise.restart(memory.noise_channels[i])
    change_detection.restart(memory)


@compiled
def set_noise(settings: Any, memory: Any, channel: int) -> None:
    """Take the noise level of the settings (at the start, and when they were reconfigured)."""
    deviation = settings.displacement_noise_std if channel == 0 else settings.force_noise_std
    memory.noise[channel] = deviation * deviation
    variational_bayes.restart(memory, channel)


@compiled
def prepare(settings: Any, memory: Any) -> None:
    """Set memory.measurement_noise for the sample in memory.measurement."""
    memory.measurement_noise[0] = memory.noise[0]
    memory.measurement_noise[1] = memory.noise[1] * tempering.tempering_factor(settings, memory)


@compiled
def learn(settings: Any, memory: Any) -> None:
    """Learn from an accepted sample: memory.state and memory.covariance are those after it."""
    memory.change_detected = 0
    learn_noise(settings, memory)
    if is_touching(memory):
        tempering.count_sample(memory)
        if change_detection.detect(settings, memory):
            memory.change_detected = 1
            forget_tissue(settings, memory)


@compiled
def is_touching(memory: Any) -> bool:
    """True if an accepted sample says something of the tissue: a force reading in contact."""
    return bool(memory.present[1] != 0 and memory.state[0] > 0.0)


@compiled
def learn_noise(settings: Any, memory: Any) -> None:
    """The part of `learn` that concerns the sensors' noise alone."""
    if settings.noise_adaptation == DIFFERENCES:
        learn_differences(settings, memory)
    elif settings.noise_adaptation == VARIATIONAL_BAYES and tempering.is_over(settings, memory):
        variational_bayes.learn(settings, memory)


@compiled
def learn_differences(settings: Any, memory: Any) -> None:
    """Take the accepted readings of the sample into memory.noise."""
    for i in range(2):
        if memory.present[i] == 0:
            continue
        floor = settings.displacement_noise_floor if i == 0 else settings.force_noise_floor
        channel = memory.noise_channels[i]
        broken = memory.restart != 0
        reading = memory.measurement[i]
        if difference_noise.learn(settings, channel, memory.last_time, reading, broken, floor):
            memory.noise[i] = channel.mean


@compiled
def forget_tissue(settings: Any, memory: Any) -> None:
    """Begin anew with another tissue; motion and sensor noise stay."""
    forget_parameters(settings, memory)
    tempering.restart(memory)
    change_detection.restart(memory)


@compiled
def forget_parameters(settings: Any, memory: Any) -> None:
    """Set the covariance of the parameters back to the prior, without ties to the motion.

    Their mean stays, unless it is as unlikely as no prior allows: then it was led astray, and the
    first guess is the better start.
    """
    first, spread = memory.updated_state, memory.updated_covariance
    state_space.prior(settings, first, spread)
    last = end_of_parameters(settings.contact_model)
    astray = False
    for i in range(3, last):
        distance = memory.state[i] - first[i]
        astray = astray or distance * distance > UNLIKELY * UNLIKELY * spread[i, i]
    for i in range(3, last):
        if astray:
            memory.state[i] = first[i]
        for j in range(7):
            memory.covariance[i, j] = 0.0
            memory.covariance[j, i] = 0.0
        memory.covariance[i, i] = spread[i, i]
