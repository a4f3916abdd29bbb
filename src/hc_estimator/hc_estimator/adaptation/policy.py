"""What the default filters adapt, in hooks that a filter calls around its update.

`prepare` runs before the update and sets the measurement noise of this sample; `learn` runs after
an accepted sample and may change the noise, the covariance of the parameters (a changed tissue)
and the flags. Nothing here runs for a refused sample.
"""

from __future__ import annotations

from typing import Any

from hc_estimator.adaptation import change_detection, difference_noise, tempering
from hc_estimator.compilation import compiled
from hc_estimator.contact.registry import has_lagged_velocity
from hc_estimator.specification import ParameterSpecification

FIXED = 0  # position in the choices of noise_adaptation
DIFFERENCES = 1

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

SPECIFICATIONS = (
    *NOISE_SPECIFICATIONS,
    NOISE_ADAPTATION,
    *tempering.SPECIFICATIONS,
    *difference_noise.SPECIFICATIONS,
    *change_detection.SPECIFICATIONS,
)
FIELDS = tempering.FIELDS + difference_noise.FIELDS + change_detection.FIELDS


@compiled
def initialise(settings: Any, memory: Any) -> None:
    """State of the adaptation before any sample."""
    set_noise(settings, memory)
    tempering.restart(memory)
    difference_noise.restart(memory)
    change_detection.restart(memory)


@compiled
def set_noise(settings: Any, memory: Any) -> None:
    """Take the noise levels of the settings (at the start, and when they were reconfigured)."""
    memory.noise[0] = settings.displacement_noise_std**2
    memory.noise[1] = settings.force_noise_std**2


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
    if memory.state[0] > 0.0:  # free motion says nothing of the tissue
        tempering.count_sample(memory)
        if change_detection.detect(settings, memory):
            memory.change_detected = 1
            forget_parameters(settings, memory)
            tempering.restart(memory)
            change_detection.restart(memory)


@compiled
def learn_noise(settings: Any, memory: Any) -> None:
    """The part of `learn` that concerns the sensors' noise alone."""
    if settings.noise_adaptation == DIFFERENCES:
        difference_noise.learn(settings, memory)


@compiled
def forget_parameters(settings: Any, memory: Any) -> None:
    """Set the covariance of the parameters back to the prior, without ties to the motion."""
    # Where the last state is a lagged velocity it belongs to the motion.
    last = 6 if has_lagged_velocity(settings.contact_model) else 7
    for i in range(3, last):
        for j in range(7):
            memory.covariance[i, j] = 0.0
            memory.covariance[j, i] = 0.0
        memory.covariance[i, i] = memory.prior_variance[i - 3]
