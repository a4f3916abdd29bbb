"""Sudden turns of the tool: a ramp that begins, a hold, a reversal.

The motion model takes the tool to move smoothly. Where its velocity jumps, the force shows it
within a sample (through the damping), the displacement only some tens of samples later; in between
a filter answers with wrong damping, or with a change of the tissue that is none. In the tracking of
manoeuvring targets (Bar-Shalom, Li and Kirubarajan, Estimation with Applications to Tracking and
Navigation, 2001, chapter 11) the answer is to go back to before the manoeuvre and to let the motion
go. Here:

- Every few samples, state and covariance are kept.
- A turn is suspected when the bank in `motion_density` starts the chosen member anew (the
  displacement shows it), and when the alarm in `model_error` goes off (the force may show it).
- Then parameters and model error are those of before the turn, the motion is known by its last
  reading only, its velocity within the speeds of the last seconds, and for some samples the
  parameters stay as they are while the velocity is found anew.
- A tissue that changes is not mistaken for a turn: an alarm begins a contest all the same, between
  the newcomer and a veteran that may have turned. Nor is a contact law that does not fit: if the
  veteran wins, and the displacement has shown no turn, there is a model error.

Two more errors of the unscented transform belong to a velocity that is not known. Its points lie on
the axes, and do not see that the force is the *product* of velocity and damping; `product_variance`
is that part. And as long as not even the direction of the motion is known, sign(v) |v|^p looks
linear in it, and noise of the velocity would be counted as knowledge of B and p: `restrain` leaves
those two as they are.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hc_estimator.adaptation import contest, linearisation, model_error, motion_density
from hc_estimator.compilation import compiled
from hc_estimator.contact.registry import HUNT_CROSSLEY, end_of_parameters
from hc_estimator.correction import hold_parameters
from hc_estimator.linear_algebra import copy_matrix, copy_vector
from hc_estimator.specification import ParameterSpecification

SPECIFICATIONS = (
    ParameterSpecification(
        "find_turns",
        "bool",
        True,
        "Look for sudden turns of the tool, and go back to before them; otherwise the motion is "
        "taken to be smooth throughout.",
    ),
)

KEPT = 24  # states
PERIOD = 8  # samples between two of them
BEFORE = 32.0  # samples before the displacement showed a turn that are not trusted
BEFORE_TIME = 0.05  # time before an alarm that is not trusted [s]
FEWEST_BEFORE = 12.0  # samples that this is at least
OLDEST = 256.0  # samples that one goes back at most
OLDEST_TIME = 0.55  # the same as a time [s]
HOLD_TIME = 0.03  # time for which the parameters stay as they are after a turn [s]
FEWEST_HELD = 10.0  # samples that this is at least
PAUSE_TIME = 0.15  # time after a turn in which an alarm is no further turn [s]
FEWEST_PAUSED = 40.0  # samples that this is at least
TURN_TIME = 0.05  # a turn takes at most about so long [s]
SPEED_MEMORY = 5.0  # time constant with which the largest speed is forgotten [s]
LEAST_READINGS = 100  # of the displacement before it can show a turn
MOVING = 3.0  # deviations of the velocity that are no noise
COHERENCE = 10.0  # samples over which the error of the velocity stays the same, at most
LONG_AGO = 1e9

FIELDS = (
    ("kept_state", np.float64, (KEPT, 7)),  # ring
    ("kept_covariance", np.float64, (KEPT, 7, 7)),
    ("kept_time", np.float64, (KEPT,)),  # [s]
    ("kept_error", np.float64, (KEPT,)),  # model-error variance [N^2]
    ("kept_member", np.int64, (KEPT,)),  # chosen in the bank
    ("kept_count", np.int64, ()),  # states in the ring so far
    ("kept_since", np.int64, ()),  # samples since the last of them
    ("turn_since", np.float64, ()),  # samples since the last turn
    ("turn_member", np.int64, ()),  # of the bank, that the turn must have started anew
    ("turn_doubted", np.int64, ()),  # 1 while only the force has shown the last turn
    ("turn_density", np.float64, ()),  # jerk density of the turn
    ("alarm_since", np.float64, ()),  # samples since the alarm's sum was zero
    ("square_speed", np.float64, ()),  # largest of the last seconds [mm^2/s^2]
)


@compiled
def initialise(memory: Any) -> None:
    """No turn so far."""
    memory.kept_count = 0
    memory.kept_since = 0
    memory.turn_since = LONG_AGO
    memory.turn_member = 0
    memory.turn_doubted = 0
    memory.turn_density = 0.0
    memory.alarm_since = 0.0
    memory.square_speed = 0.0


@compiled
def keep(memory: Any, time: float) -> None:
    """Keep the state after an accepted sample if it is time to."""
    square = memory.state[1] ** 2 - MOVING**2 * memory.covariance[1, 1]
    forgotten = memory.square_speed * (1.0 - min(memory.elapsed / SPEED_MEMORY, 1.0))
    memory.square_speed = max(forgotten, square)
    memory.turn_since += 1.0
    if memory.bank_age[memory.turn_member] < motion_density.SETTLED[memory.turn_member]:
        memory.turn_doubted = 0
    memory.alarm_since = 0.0 if memory.alarm_sum[0] == 0.0 else memory.alarm_since + 1.0
    if memory.restart != 0 or memory.change_detected != 0:
        memory.kept_count = 0
    if memory.contest != 0:
        return
    memory.kept_since += 1
    if memory.kept_since < PERIOD:
        return
    memory.kept_since = 0
    i = memory.kept_count % KEPT
    copy_vector(memory.state, memory.kept_state[i])
    copy_matrix(memory.covariance, memory.kept_covariance[i])
    memory.kept_time[i] = time
    memory.kept_error[i] = memory.model_error[0]
    memory.kept_member[i] = memory.bank_chosen
    memory.kept_count += 1


@compiled
def _find(memory: Any, time: float, samples: float) -> int:
    """Place of the youngest kept state that is so many samples old; -1 if there is none."""
    oldest = min(OLDEST * memory.elapsed, OLDEST_TIME)
    for back in range(1, min(memory.kept_count, KEPT) + 1):
        i = (memory.kept_count - back) % KEPT
        age = time - memory.kept_time[i]
        if age > (samples - 0.5) * memory.elapsed:
            return i if age <= oldest else -1
    return -1


@compiled
def _shown(memory: Any, time: float) -> int:
    """Place of the kept state before a turn that the displacement shows; -1 if it shows none."""
    # Before the tissue is known for the first time the fit in `hindsight` is what is told.
    if memory.known == 0 or memory.bank_density <= 0.0:
        return -1
    if min(memory.bank_count, memory.difference_count[0]) < LEAST_READINGS:
        return -1
    i = _find(memory, time, BEFORE)
    if i >= 0:
        m = memory.kept_member[i]
        if memory.bank_chosen > m and memory.bank_age[m] < motion_density.SETTLED[m]:
            return i
    return -1


@compiled
def answer(settings: Any, memory: Any, time: float, alarm: bool) -> bool:
    """Go back to before a turn, if there was one.

    Args:
        settings: settings record.
        memory: memory record after an accepted sample.
        time: of the sample [s].
        alarm: the alarm of the hypothesis in memory.state.

    Returns:
        True if the sample is used up, and the alarm answered.
    """
    if settings.find_turns == 0 or memory.model_error[0] > 0.0:
        return False
    i = _shown(memory, time)
    if i >= 0:
        if memory.contest != 0:
            before = memory.contest_time > time - memory.kept_time[i]
            if before or memory.contest_called != 0:
                return False
            contest.cancel(memory)
        if memory.turn_since >= BEFORE:
            _go_back(memory, i)
        memory.kept_count = 0
        memory.turn_doubted = 0
        return True
    pause = max(PAUSE_TIME / memory.elapsed, FEWEST_PAUSED)
    if not alarm or memory.contest != 0 or memory.turn_since <= pause:
        return False
    before_alarm = max(min(BEFORE_TIME / memory.elapsed, BEFORE), FEWEST_BEFORE)
    i = _find(memory, time, memory.alarm_since + before_alarm)
    if i < 0:
        return False
    if memory.contact_time[0] >= settings.probation and settings.find_changes != 0:
        contest.begin(settings, memory)
    _go_back(memory, i)
    memory.turn_doubted = 1
    return True


@compiled
def audit(settings: Any, memory: Any) -> None:
    """At the end of a contest that the veteran won: was there a turn at all?

    If the displacement has shown none, the alarm was neither a turn nor another tissue: then the
    contact law does not fit.
    """
    if memory.turn_doubted != 0:
        memory.turn_doubted = 0
        model_error.raise_model_error(settings, memory)


@compiled
def _go_back(memory: Any, i: int) -> None:
    """Take parameters and model error from place i; the motion is the last reading."""
    velocity = memory.state[1]
    if memory.bank_count > motion_density.FIRST_READINGS:
        velocity = memory.bank_states[memory.bank_chosen, 1] / memory.bank_step
    state, covariance = memory.state, memory.covariance
    copy_vector(memory.kept_state[i], state)
    copy_matrix(memory.kept_covariance[i], covariance)
    square = max(memory.square_speed, (velocity - state[1]) ** 2) + covariance[1, 1]
    acceleration = covariance[2, 2] + memory.bank_density * TURN_TIME
    motion_density.clear_motion(covariance)
    state[0] = memory.measurement[0]
    covariance[0, 0] = memory.sensor_noise[0]
    covariance[1, 1] = square
    covariance[2, 2] = acceleration
    memory.turn_density = 3.0 * square / TURN_TIME**3
    memory.model_error[0] = memory.kept_error[i]
    memory.alarm_sum[0] = 0.0
    memory.alarm_line[0, :, :] = 0.0
    memory.turn_since = 0.0
    memory.turn_member = memory.kept_member[i]
    memory.kept_since = 0
    if memory.contest == 0:
        memory.kept_count = 0


@compiled
def _held(memory: Any) -> float:
    """Samples for which the parameters stay as they are."""
    return max(HOLD_TIME / max(memory.elapsed, 1e-9), FEWEST_HELD)  # type: ignore[no-any-return]


@compiled
def is_turning(memory: Any) -> bool:
    """True for the samples after a turn, unless they are used for a newcomer."""
    return bool(memory.newcomer == 0 and memory.turn_since < _held(memory))


@compiled
def raise_process_noise(settings: Any, memory: Any) -> None:
    """Raise the jerk density in memory.process_noise to that of a turn while the tool turns."""
    if not is_turning(memory):
        return
    scale = memory.turn_density / settings.jerk_density
    if scale <= memory.process_noise_scale:
        return
    motion_density.scale_motion_noise(memory, scale / memory.process_noise_scale)
    memory.process_noise_scale = scale


@compiled
def product_variance(settings: Any, memory: Any, longest: float) -> float:
    """Variance of the force from velocity times damping, both not known [N^2].

    The second-order term of the damping force in the velocity and in the logarithm of its factor
    B d^n |v|^p, for some time after a turn; times the samples, `longest` at most, over which it
    stays the same.
    """
    if settings.contact_model != HUNT_CROSSLEY or memory.turn_since > COHERENCE * _held(memory):
        return 0.0
    state, covariance = memory.predicted_state, memory.predicted_covariance
    if not (state[0] > 0.0 and covariance[1, 1] > 0.0 and memory.elapsed > 0.0):
        return 0.0
    log_depth = math.log(state[0])
    log_speed = 0.5 * math.log(state[1] * state[1] + covariance[1, 1])
    p = state[6]
    slope = p * math.exp(min(state[4] + state[5] * log_depth + (p - 1.0) * log_speed, 300.0))
    by_p = log_speed + 1.0 / p
    variance = covariance[4, 4] + log_depth**2 * covariance[5, 5] + by_p**2 * covariance[6, 6]
    variance += 2.0 * (log_depth * covariance[4, 5] + by_p * covariance[4, 6])
    variance += 2.0 * log_depth * by_p * covariance[5, 6]
    alike = min(linearisation.coherence_time(settings, memory) / memory.elapsed, longest)
    return float(alike * slope * slope * covariance[1, 1] * max(variance, 0.0))


@compiled
def restrain(settings: Any, memory: Any) -> None:
    """Take from memory.gain what an unknown velocity must not teach."""
    if settings.find_turns == 0 or memory.newcomer != 0:
        return
    if is_turning(memory):
        hold_parameters(settings, memory)
        return
    gain, factor = memory.gain, memory.factor
    variance = factor[1, 0] * factor[1, 0] + factor[1, 1] * factor[1, 1]
    if memory.predicted_state[1] ** 2 < variance:
        last = end_of_parameters(settings.contact_model)
        for i in range(4, last, 2):
            gain[i, 0] = 0.0
            gain[i, 1] = 0.0
