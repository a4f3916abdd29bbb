"""The policy of `self_tuning_ukf`: nothing to be tuned, on simulated and on real tissue.

What each part answers, in the order of use:

- `difference_noise`: how noisy are the sensors, and did that change?
- `motion_density`: how restless is the tool?
- `manoeuvre`: did it turn suddenly?
- `linearisation`: how far can the linearised contact law be trusted yet?
- `model_error`: do the innovations say more than noise, and how large is the misfit?
- `contest`: is it a changed tissue or a contact law that does not fit?
- `hindsight`: what do the samples felt before say, of the first estimates and of a misfit?
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hc_estimator.adaptation import (
    contest,
    difference_noise,
    hidden_motion,
    hindsight,
    history,
    linearisation,
    manoeuvre,
    model_error,
    motion_density,
)
from hc_estimator.adaptation.policy import (
    DIFFERENCES,
    NOISE_ADAPTATION,
    NOISE_SPECIFICATIONS,
)
from hc_estimator.compilation import compiled
from hc_estimator.contact.registry import has_lagged_velocity
from hc_estimator.specification import ParameterSpecification

LIMIT_SPECIFICATIONS = (
    ParameterSpecification(
        "smallest_displacement_exponent",
        "float",
        0.6,
        "The estimate of n does not fall below this.",
        minimum=0.25,
        maximum=1.0,
    ),
    ParameterSpecification(
        "largest_displacement_exponent",
        "float",
        4.0,
        "The estimate of n does not exceed this.",
        minimum=1.0,
        maximum=6.0,
    ),
    ParameterSpecification(
        "smallest_velocity_exponent",
        "float",
        0.4,
        "The estimate of p does not fall below this.",
        minimum=0.25,
        maximum=1.0,
    ),
    ParameterSpecification(
        "largest_velocity_exponent",
        "float",
        2.0,
        "The estimate of p does not exceed this.",
        minimum=1.0,
        maximum=3.0,
    ),
)
SPECIFICATIONS = (
    *NOISE_SPECIFICATIONS,
    NOISE_ADAPTATION,
    *difference_noise.SPECIFICATIONS,
    *motion_density.SPECIFICATIONS,
    *linearisation.SPECIFICATIONS,
    *model_error.SPECIFICATIONS,
    *contest.SPECIFICATIONS,
    *hindsight.SPECIFICATIONS,
    *manoeuvre.SPECIFICATIONS,
    *LIMIT_SPECIFICATIONS,
)

LARGEST_WAIT = 64  # accepted samples after which the given noise is used if none was found
UNKNOWN = 1e12  # variance of a force whose noise is not known yet [N^2]
SMALLEST_DEPTH = 0.05  # from which a force says the order of magnitude of K [mm]
SURE = 5.0  # a force beyond so many standard deviations is one
SUDDEN = 5.0  # latest differences beyond so many times the noise replace it
# B beyond these multiples of K is no tissue; far below, the force says nothing of ln B any more.
SMALLEST_LOG_RATIO = -7.6
LARGEST_LOG_RATIO = 3.0
LARGEST_LOG_STIFFNESS = 16.0

FIELDS = (
    ("calibrated", np.int64, ()),  # 1 once the noise is known
    ("motion_anew", np.int64, ()),  # 1 if the motion starts anew at the next sample
    ("sensor_noise", np.float64, (2,)),  # variances without model error
    ("joint_nis", np.float64, ()),
    ("guessed", np.int64, ()),  # 1 once the first contact has set the first guess of K
    *motion_density.FIELDS,
    *hidden_motion.FIELDS,
    *linearisation.FIELDS,
    *model_error.FIELDS,
    *contest.FIELDS,
    *hindsight.FIELDS,
    *manoeuvre.FIELDS,
)


@compiled
def initialise(settings: Any, memory: Any) -> None:
    """State of the adaptation before any sample."""
    set_noise(settings, memory)
    memory.calibrated = 0 if settings.noise_adaptation == DIFFERENCES else 1
    memory.motion_anew = 0
    memory.guessed = 0
    difference_noise.restart(memory)
    motion_density.initialise(memory)
    hidden_motion.initialise(memory)
    linearisation.initialise(memory)
    contest.initialise(memory)
    hindsight.restart(memory)
    manoeuvre.initialise(memory)


@compiled
def set_noise(settings: Any, memory: Any) -> None:
    """Take the noise levels of the settings."""
    memory.sensor_noise[0] = settings.displacement_noise_std**2
    memory.sensor_noise[1] = settings.force_noise_std**2


@compiled
def prepare(settings: Any, memory: Any) -> None:
    """Set memory.measurement_noise once the measurement's transform is known."""
    memory.measurement_noise[0] = memory.sensor_noise[0]
    if memory.calibrated == 0:
        memory.measurement_noise[1] = UNKNOWN
    else:
        noise = memory.sensor_noise[1] + memory.model_error[0]
        memory.measurement_noise[1] = noise + linearisation.enlargement(settings, memory)
        if settings.find_turns != 0:
            memory.measurement_noise[1] += manoeuvre.product_variance(
                settings, memory, manoeuvre.COHERENCE
            )


@compiled
def guess_stiffness(settings: Any, memory: Any) -> None:
    """Centre the prior of K and B on the first clear contact; its width stays.

    K spans decades between tissues. From a first guess a hundred times too stiff the linearised
    update needs long to come down, and the first force reading says the order of magnitude.
    """
    depth = memory.state[0]
    force = memory.measurement[1]
    deviations = SURE * math.sqrt(memory.sensor_noise[1])
    if memory.calibrated == 0 or depth < SMALLEST_DEPTH or force < deviations:
        return
    memory.guessed = 1
    if memory.prior_variance[0] > 0.0:
        shift = math.log(force) - memory.state[5] * math.log(depth) - memory.state[3]
        memory.state[3] += shift
        if memory.prior_variance[1] > 0.0:
            memory.state[4] += shift


@compiled
def learn_readings(settings: Any, memory: Any) -> None:
    """Take the accepted sample into everything that does not depend on the contact law."""
    if settings.noise_adaptation == DIFFERENCES:
        difference_noise.learn(settings, memory)
        _follow_noise(memory)
    if settings.motion_adaptation != 0:
        motion_density.learn(settings, memory)
    linearisation.learn(memory)


@compiled
def learn_refused(settings: Any, memory: Any) -> None:
    """Take a sample that the outlier gate has refused into the noise, if many disagree."""
    known = settings.noise_adaptation == DIFFERENCES and memory.calibrated != 0
    if known and difference_noise.learn_refused(settings, memory):
        _follow_noise(memory)


@compiled
def _follow_noise(memory: Any) -> None:
    """Bring memory.sensor_noise up to the differences."""
    first = difference_noise.FIRST_SAMPLES
    counts = memory.difference_count
    if memory.calibrated == 0:
        known = counts[0] >= first and counts[1] >= first
        if not known and memory.accepted < LARGEST_WAIT:
            return
        memory.calibrated = 1
        memory.motion_anew = 1
    for i in range(2):
        if counts[i] == 0:
            continue
        noise = difference_noise.cautious(memory, i)
        latest = difference_noise.latest(memory, i)
        if counts[i] > first and latest > SUDDEN * noise:
            noise = latest
        memory.sensor_noise[i] = noise


@compiled
def learn_innovation(settings: Any, memory: Any) -> bool:
    """Take the innovation of the hypothesis in memory.state; True if its alarm goes off."""
    limit_parameters(settings, memory)
    if memory.calibrated == 0:
        return False
    return model_error.learn(settings, memory)


@compiled
def correct_density(settings: Any, memory: Any) -> None:
    """Let the jerk density follow the joint innovations while the contact law fits."""
    if settings.motion_adaptation != 0 and memory.bank_density > 0.0:
        hidden_motion.learn(settings, memory)
    if memory.calibrated == 0 or memory.model_error[0] > 0.0 or memory.contact_time[0] < 0.5:
        return
    if memory.predicted_state[0] <= 0.0:
        return
    if memory.measurement_noise[1] > 1.2 * memory.sensor_noise[1]:
        return
    if settings.noise_adaptation == DIFFERENCES:
        for i in range(2):  # a noise about to be called lower would pass for a calmer tool
            if 2.0 * memory.difference_short_mean[i] < memory.difference_mean[i]:
                return
    motion_density.correct(memory, memory.joint_nis)


@compiled
def decide(settings: Any, memory: Any, alarm: bool) -> None:
    """Answer the alarms, judge a running contest, set the flags."""
    if memory.contest != 0 and _noise_rose(memory):
        # The alarm was the sensor's. If the tissue changed as well, the next alarm is near.
        contest.cancel(memory)
        alarm = False
    if alarm:
        ready = memory.contact_time[0] >= settings.probation and settings.find_changes != 0
        if memory.contest == 0 and ready:
            contest.begin(settings, memory)
        else:
            model_error.raise_model_error(settings, memory)
            if memory.contest == 0 or memory.newcomer_leads != 0:
                memory.fitting_time = 0.0
    if memory.contest != 0 and not (alarm and memory.contest_time == 0.0):
        contest.judge(settings, memory)
        if memory.contest == 0 and memory.contest_called == 0:
            manoeuvre.audit(settings, memory)
    _recollect(settings, memory)
    if memory.model_error[0] > 0.0:
        memory.fitting_time = 0.0
    elif memory.predicted_state[0] > 0.0:
        memory.fitting_time += memory.elapsed
    memory.model_mismatch = 1 if memory.model_error[0] > 0.0 else 0
    # What is reported and handed over: the model error is noise to whoever uses the force.
    memory.noise[0] = memory.sensor_noise[0]
    memory.noise[1] = memory.sensor_noise[1] + memory.model_error[0]


@compiled
def _recollect(settings: Any, memory: Any) -> None:
    """Hold the estimate, or the newcomer of a contest, against what was felt before."""
    if memory.change_detected != 0:
        hindsight.restart(memory)
    if memory.contest != 0:
        memory.told = 0
    if memory.calibrated == 0 or not history.learn(settings, memory):
        return
    if memory.contest == 0:
        hindsight.hold(settings, memory)
    elif memory.newcomer_leads != 0 and hindsight.same_tissue(settings, memory):
        contest.cancel(memory)
        hindsight.hold(settings, memory)


@compiled
def _noise_rose(memory: Any) -> bool:
    """True if the noise was just seen to jump up, and could have caused the running contest."""
    rose = memory.difference_jumped[0] > 0 or memory.difference_jumped[1] > 0
    return rose and memory.contest_time < contest.SEEN_LATE * memory.elapsed  # type: ignore[no-any-return]


@compiled
def limit_parameters(settings: Any, memory: Any) -> None:
    """Keep the mean of the parameters where the contact law means something."""
    state = memory.state
    state[3] = min(max(state[3], -LARGEST_LOG_STIFFNESS), LARGEST_LOG_STIFFNESS)
    if memory.prior_variance[1] > 0.0 and memory.prior_variance[0] > 0.0:
        ratio = min(max(state[4] - state[3], SMALLEST_LOG_RATIO), LARGEST_LOG_RATIO)
        state[4] = state[3] + ratio
    if memory.prior_variance[2] > 0.0:
        state[5] = min(
            max(state[5], settings.smallest_displacement_exponent),
            settings.largest_displacement_exponent,
        )
    if memory.prior_variance[3] > 0.0 and not has_lagged_velocity(settings.contact_model):
        state[6] = min(
            max(state[6], settings.smallest_velocity_exponent), settings.largest_velocity_exponent
        )


@compiled
def finite(memory: Any) -> bool:
    """True if state and covariance are sound."""
    total = 0.0
    for i in range(7):
        total += abs(memory.state[i]) + abs(memory.covariance[i, i])
    return total < 1e150 and math.isfinite(total)
