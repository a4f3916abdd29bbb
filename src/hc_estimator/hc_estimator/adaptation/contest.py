"""Changed tissue or wrong contact law? Two hypotheses run side by side, and the data decide.

After an alarm the filter is split. The veteran goes on and may only enlarge its model error; the
newcomer forgets the parameters and begins anew (the static multiple-model estimator of Magill,
IEEE Trans. AC 10, 1965, with forgetting). Their predictive log likelihoods are compared over the
last half second of contact. The newcomer's estimate is given out as soon as it is clearly the
likelier; where it is not, nothing was lost. At the end of the probation it stays only if it still
predicts better. A contact law that does not fit makes each newcomer better for a fraction of a
period and no better than the veteran over a whole one: no change is called, and the misfit
becomes model error.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from hc_estimator.adaptation import model_error, motion_density
from hc_estimator.compilation import compiled
from hc_estimator.contact.registry import end_of_parameters
from hc_estimator.specification import ParameterSpecification

SPECIFICATIONS = (
    ParameterSpecification(
        "find_changes",
        "bool",
        True,
        "Let a changed tissue be found; otherwise every misfit is model error.",
    ),
    ParameterSpecification(
        "probation",
        "float",
        2.0,
        "Time in contact over which a possible new tissue is compared with the old one; at the "
        "start, time during which misfit is never taken for a change.",
        minimum=0.1,
        maximum=100.0,
        unit="s",
    ),
    ParameterSpecification(
        "contest_memory",
        "float",
        0.5,
        "Time over which the log likelihoods are compared.",
        minimum=0.02,
        maximum=100.0,
        unit="s",
    ),
    ParameterSpecification(
        "contest_lead",
        "float",
        10.0,
        "Log likelihood ratio at which the other hypothesis is given out.",
        minimum=0.0,
        maximum=1e4,
    ),
    ParameterSpecification(
        "contest_keep",
        "float",
        20.0,
        "Log likelihood ratio that a new tissue needs at the end of its probation.",
        minimum=0.0,
        maximum=1e4,
    ),
    ParameterSpecification(
        "restart_stiffness_log_std",
        "float",
        1.0,
        "Standard deviation of ln K about its old value where a new tissue is tried.",
        minimum=1e-3,
        maximum=10.0,
    ),
    ParameterSpecification(
        "restart_damping_log_std",
        "float",
        1.0,
        "Standard deviation of ln B about its old value where a new tissue is tried.",
        minimum=1e-3,
        maximum=10.0,
    ),
    ParameterSpecification(
        "restart_displacement_exponent_std",
        "float",
        0.3,
        "Standard deviation of n about its old value where a new tissue is tried.",
        minimum=1e-3,
        maximum=10.0,
    ),
    ParameterSpecification(
        "restart_velocity_exponent_std",
        "float",
        0.1,
        "Standard deviation of p about its old value where a new tissue is tried.",
        minimum=1e-3,
        maximum=10.0,
    ),
)

# A model that fitted for so long [s] is believed: a lead over it is called a change at once.
TRUSTED_AFTER = 5.0
LONG_AGO = 1e9
SETTLED = 10.0  # log likelihood ratio for the veteran from which on the contest need not go on
SEEN_LATE = 80.0  # samples that a jump of the noise may need to be seen

FIELDS = (
    ("rival_state", np.float64, (7,)),
    ("rival_covariance", np.float64, (7, 7)),
    ("contest", np.int64, ()),  # 1 while two hypotheses run
    ("newcomer_leads", np.int64, ()),  # 1 while the newcomer is the one in memory.state
    ("newcomer", np.int64, ()),  # 1 while the sample is used for the newcomer
    ("contest_ratio", np.float64, ()),  # log likelihood ratio of newcomer to veteran
    ("contest_time", np.float64, ()),  # in contact [s]
    ("contest_called", np.int64, ()),  # 1 once this contest was called a change
    ("contest_trusted", np.int64, ()),  # 1 if the veteran fitted well before
    ("fitting_time", np.float64, ()),  # in contact without model error [s]
)


@compiled
def initialise(memory: Any) -> None:
    """One hypothesis, believed until the data object."""
    memory.contest = 0
    memory.newcomer_leads = 0
    memory.newcomer = 0
    memory.fitting_time = LONG_AGO
    model_error.restart(memory, 0)
    model_error.restart(memory, 1)


@compiled
def exchange(memory: Any) -> None:
    """Swap the hypothesis in memory.state with its rival."""
    for i in range(7):
        value = memory.state[i]
        memory.state[i] = memory.rival_state[i]
        memory.rival_state[i] = value
        for j in range(7):
            value = memory.covariance[i, j]
            memory.covariance[i, j] = memory.rival_covariance[i, j]
            memory.rival_covariance[i, j] = value
    for i in range(model_error.DELAY):
        for j in range(4):
            value = memory.alarm_line[0, i, j]
            memory.alarm_line[0, i, j] = memory.alarm_line[1, i, j]
            memory.alarm_line[1, i, j] = value
    position = memory.alarm_position[0]
    memory.alarm_position[0] = memory.alarm_position[1]
    memory.alarm_position[1] = position
    _swap(memory.model_error)
    _swap(memory.alarm_sum)
    _swap(memory.contact_time)
    _swap(memory.evidence)


@compiled
def _swap(pair: Any) -> None:
    value = pair[0]
    pair[0] = pair[1]
    pair[1] = value


@compiled
def begin(settings: Any, memory: Any) -> None:
    """Split: memory.state stays the veteran, the rival becomes the newcomer."""
    memory.contest = 1
    memory.newcomer_leads = 0
    memory.contest_ratio = 0.0
    memory.contest_time = 0.0
    memory.contest_called = 0
    memory.contest_trusted = 1 if memory.fitting_time > TRUSTED_AFTER else 0
    memory.alarm_line[0, :, :] = 0.0
    memory.rival_state[:] = memory.state
    memory.rival_covariance[:, :] = memory.covariance
    # What the veteran made of the motion since the change is as wrong as its contact law.
    motion_density.set_motion(memory, memory.rival_state, memory.rival_covariance)
    model_error.restart(memory, 1)
    last = end_of_parameters(settings.contact_model)
    covariance = memory.rival_covariance
    for i in range(3, last):
        for j in range(7):
            covariance[i, j] = 0.0
            covariance[j, i] = 0.0
    deviations = (
        settings.restart_stiffness_log_std,
        settings.restart_damping_log_std,
        settings.restart_displacement_exponent_std,
        settings.restart_velocity_exponent_std,
    )
    for i in range(last - 3):
        if memory.prior_variance[i] > 0.0:
            covariance[3 + i, 3 + i] = deviations[i] ** 2


@compiled
def cancel(memory: Any) -> None:
    """End the contest as if it had never begun."""
    if memory.newcomer_leads != 0:
        exchange(memory)
    memory.contest = 0
    memory.newcomer_leads = 0


@compiled
def judge(settings: Any, memory: Any) -> None:
    """After both hypotheses have used a sample: who leads, and is it over?"""
    if memory.predicted_state[0] > 0.0:
        newcomer = 0 if memory.newcomer_leads != 0 else 1
        gain = memory.evidence[newcomer] - memory.evidence[1 - newcomer]
        forgotten = memory.contest_ratio * memory.elapsed / settings.contest_memory
        memory.contest_ratio += gain - forgotten
        memory.contest_time += memory.elapsed
    ratio = memory.contest_ratio
    if memory.newcomer_leads == 0 and ratio > settings.contest_lead:
        exchange(memory)
        memory.newcomer_leads = 1
    elif memory.newcomer_leads != 0 and ratio < -settings.contest_lead:
        exchange(memory)
        memory.newcomer_leads = 0
    # A noise that jumped is seen by then, and cancels the contest.
    late = memory.contest_time > SEEN_LATE * memory.elapsed
    if memory.newcomer_leads != 0 and memory.contest_trusted != 0 and late:
        _call(memory)
    if late and memory.newcomer_leads == 0 and ratio < -SETTLED:
        memory.contest = 0
    elif memory.contest_time > settings.probation:
        memory.contest = 0
        if memory.newcomer_leads != 0:
            if ratio < settings.contest_keep:
                exchange(memory)
                memory.fitting_time = 0.0
            else:
                _call(memory)
        memory.newcomer_leads = 0


@compiled
def _call(memory: Any) -> None:
    """Call it a change, once."""
    if memory.contest_called == 0:
        memory.contest_called = 1
        memory.change_detected = 1
