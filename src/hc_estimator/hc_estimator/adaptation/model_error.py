"""Alarm and model error: what the innovations say beyond the sensors' noise.

A one-sided cumulative sum (Page, Biometrika 41, 1954) of the normalised innovations squared of
both channels raises the alarm. Both are needed: a filter that trusts the force pulls velocity and
displacement along with a wrong contact law, and the misfit then shows in the displacement. The
sum runs a few samples late, so that it can use the noise of the very latest differences: a sensor
that turns noisier raises no alarm.

What an alarm means is decided by the caller. If it is no change of the tissue, the contact law
does not fit: then the force noise gains a model-error variance. Each alarm enlarges it, and an
integral feedback holds the mean normalised innovation squared at 2 from then on, until the model
fits again. When the noise rises by a factor, so does the covariance of the parameters, which is
what a regression on all samples with the larger noise would have had (conjugate normal-inverse-
gamma model); the estimate keeps its mean and loses the certainty that it should not have had.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hc_estimator.adaptation import difference_noise
from hc_estimator.compilation import compiled
from hc_estimator.contact.registry import end_of_parameters
from hc_estimator.specification import ParameterSpecification

SPECIFICATIONS = (
    ParameterSpecification(
        "alarm_drift",
        "float",
        5.0,
        "What the cumulative sum subtracts from each sample's normalised innovation squared (mean "
        "2): smaller sees smaller changes, and more of them that are none.",
        minimum=2.5,
        maximum=100.0,
    ),
    ParameterSpecification(
        "alarm_threshold",
        "float",
        45.0,
        "Cumulative sum that raises the alarm; with the default drift 45 is once in about 1e8 "
        "samples of white innovations.",
        minimum=5.0,
        maximum=1e6,
    ),
    ParameterSpecification(
        "model_error_time",
        "float",
        1.5,
        "Time constant with which the model-error variance follows the innovations.",
        minimum=0.05,
        maximum=1e3,
        unit="s",
    ),
)

DELAY = 8  # samples by which the cumulative sum lags; by then the differences show a jump
LARGEST_TERM = 16.0  # of one channel in the cumulative sum
TEMPERED_DRIFT = 10.0  # while tempering hides the force
MISMATCH_DRIFT = 5.0  # added as the model error dominates: its innovations are no longer white
RAISE = 0.6  # share of the force noise that an alarm adds
SMALLEST_SHARE = 0.35  # of the sensor noise; less is no model error
LARGEST_FEEDBACK = 8.0  # mean squared innovation that the feedback counts at most

FIELDS = (
    # Index 0: the hypothesis in memory.state; 1: its rival.
    ("model_error", np.float64, (2,)),  # variance [N^2]
    ("alarm_sum", np.float64, (2,)),
    ("alarm_line", np.float64, (2, DELAY, 4)),  # z^2 and its variance without sensor noise, F, d
    ("alarm_position", np.int64, (2,)),
    ("contact_time", np.float64, (2,)),  # informative contact since the start of the hypothesis
    ("evidence", np.float64, (2,)),  # log likelihood of the last sample
)


@compiled
def restart(memory: Any, hypothesis: int) -> None:
    """A hypothesis without model error, that has seen nothing."""
    memory.model_error[hypothesis] = 0.0
    memory.alarm_sum[hypothesis] = 0.0
    memory.alarm_line[hypothesis, :, :] = 0.0
    memory.alarm_position[hypothesis] = 0
    memory.contact_time[hypothesis] = 0.0


@compiled
def scale_parameters(settings: Any, memory: Any, factor: float) -> None:
    """Multiply the covariance of the parameters by a factor, no variance beyond its prior."""
    last = end_of_parameters(settings.contact_model)
    covariance = memory.covariance
    for i in range(3, last):
        variance, prior = covariance[i, i], memory.prior_variance[i - 3]
        if variance <= 0.0:
            continue
        scale = math.sqrt(min(factor, max(1.0, prior / variance)))
        for j in range(7):
            covariance[i, j] *= scale
        for j in range(7):
            covariance[j, i] *= scale


@compiled
def set_model_error(settings: Any, memory: Any, variance: float) -> None:
    """Give the hypothesis in memory.state a new model-error variance."""
    before = memory.sensor_noise[1] + memory.model_error[0]
    after = memory.sensor_noise[1] + variance
    if after > before:
        scale_parameters(settings, memory, after / before)
    memory.model_error[0] = variance


@compiled
def raise_model_error(settings: Any, memory: Any) -> None:
    """Answer an alarm that is no change of the tissue."""
    noise = memory.sensor_noise[1] + memory.model_error[0]
    set_model_error(settings, memory, memory.model_error[0] + RAISE * noise)


@compiled
def learn(settings: Any, memory: Any) -> bool:
    """Take the innovation of the hypothesis in memory.state, after its update.

    Sets memory.evidence[0] and memory.joint_nis, lets the model error follow, and sums up.

    Returns:
        True if the alarm goes off.
    """
    s = memory.innovation_covariance
    squared_displacement = memory.innovation[0] ** 2
    slope = s[0, 1] / s[0, 0]
    conditional = memory.innovation[1] - slope * memory.innovation[0]
    squared_force = conditional * conditional
    tempered_noise = memory.measurement_noise[1]
    explained = max(s[1, 1] - slope * s[0, 1] - tempered_noise, 0.0)
    noise = memory.sensor_noise[1] + memory.model_error[0]
    # The likelihood is taken without tempering.
    plain = explained + noise
    joint = squared_displacement / s[0, 0] + squared_force / plain
    memory.joint_nis = joint
    memory.evidence[0] = -0.5 * (math.log(s[0, 0] * plain) + min(joint, 50.0))
    touching = memory.predicted_state[0] > 0.0
    tempered = tempered_noise >= 2.0 * noise
    if touching:
        if not tempered:
            memory.contact_time[0] += memory.elapsed
        if memory.model_error[0] > 0.0:
            excess = min(0.5 * joint, LARGEST_FEEDBACK) - 1.0
            variance = noise * math.exp(memory.elapsed / settings.model_error_time * excess)
            variance -= memory.sensor_noise[1]
            if variance < SMALLEST_SHARE * memory.sensor_noise[1]:
                variance = 0.0
            set_model_error(settings, memory, variance)
    return _sum_up(
        settings,
        memory,
        squared_force,
        explained + tempered_noise - memory.sensor_noise[1],
        squared_displacement,
        s[0, 0] - memory.measurement_noise[0],
        TEMPERED_DRIFT if tempered else settings.alarm_drift,
    )


@compiled
def _sum_up(
    settings: Any,
    memory: Any,
    squared_force: float,
    force_variance: float,
    squared_displacement: float,
    displacement_variance: float,
    drift: float,
) -> bool:
    """Advance the delayed cumulative sum; True if it crosses the threshold."""
    position = memory.alarm_position[0]
    line = memory.alarm_line[0, position]
    displacement_noise = memory.sensor_noise[0]
    force_noise = memory.sensor_noise[1]
    if memory.difference_count[0] > 0 and memory.difference_count[1] > 0:
        displacement_noise = max(displacement_noise, difference_noise.latest(memory, 0))
        force_noise = max(force_noise, difference_noise.latest(memory, 1))
    term = min(line[0] / (line[1] + force_noise), LARGEST_TERM)
    term += min(line[2] / (line[3] + displacement_noise), LARGEST_TERM)
    line[0] = squared_force
    line[1] = force_variance
    line[2] = squared_displacement
    line[3] = displacement_variance
    memory.alarm_position[0] = (position + 1) % DELAY
    share = memory.model_error[0] / (memory.sensor_noise[1] + memory.model_error[0])
    total = memory.alarm_sum[0] + term - drift - MISMATCH_DRIFT * share
    memory.alarm_sum[0] = max(total, 0.0)
    if memory.alarm_sum[0] > settings.alarm_threshold:
        memory.alarm_sum[0] = 0.0
        return True
    return False
