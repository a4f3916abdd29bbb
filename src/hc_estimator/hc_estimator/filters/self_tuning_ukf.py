"""`self_tuning_ukf`: the unscented filter that finds noise, motion, misfit and changes by itself.

The update is that of `ukf`; what is adapted, and why, stands in `adaptation.self_tuning` and the
modules that it names. During a contest between two hypotheses (see `adaptation.contest`) each
sample is used twice.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hc_estimator.adaptation import (
    contest,
    force_estimate,
    hindsight,
    manoeuvre,
    model_error,
    motion_density,
    self_tuning,
)
from hc_estimator.compilation import compiled
from hc_estimator.correction import (
    apply_gain,
    commit,
    find_gain,
    gate,
    innovate,
    measure_unscented,
)
from hc_estimator.prediction import UNSCENTED_SPECIFICATIONS, add_process_noise, predict
from hc_estimator.recovery import recover
from hc_estimator.screening import ACCEPTED, NUMERICAL, OUTLIER, screen

SPECIFICATIONS = UNSCENTED_SPECIFICATIONS + self_tuning.SPECIFICATIONS

FIELDS = (
    *self_tuning.FIELDS,
    ("reported", np.float64, (5,)),  # innovation (2), NIS, predicted measurement (2)
)


@compiled
def _innovate(settings: Any, memory: Any) -> bool:
    """Predict the hypothesis in memory.state and its measurement; False on failure."""
    if not predict(settings, memory, True):
        return False
    motion_density.scale_process_noise(settings, memory)
    manoeuvre.raise_process_noise(settings, memory)
    add_process_noise(memory)
    if not measure_unscented(settings, memory):
        return False
    self_tuning.prepare(settings, memory)
    return innovate(memory)


@compiled
def _correct(settings: Any, memory: Any) -> None:
    """Update with what an uncertain velocity leaves of the gain."""
    find_gain(settings, memory)
    manoeuvre.restrain(settings, memory)
    apply_gain(memory)


@compiled
def _use_for_rival(settings: Any, memory: Any) -> None:
    """Use the sample for the rival hypothesis; a rival that fails numerically is out."""
    contest.exchange(memory)
    memory.newcomer = 1 - memory.newcomer_leads
    sound = _innovate(settings, memory)
    if sound:
        _correct(settings, memory)
        memory.state[:] = memory.updated_state
        memory.covariance[:, :] = memory.updated_covariance
        sound = self_tuning.finite(memory)
    if sound and self_tuning.learn_innovation(settings, memory):
        model_error.raise_model_error(settings, memory)
    contest.exchange(memory)
    if not sound:
        memory.contest = 0
        memory.newcomer_leads = 0


@compiled
def _use(settings: Any, memory: Any, time: float) -> int:
    """Predict to the sample, update with it and adapt; the decision on the sample."""
    if memory.motion_anew != 0:
        memory.restart = 1
    if memory.guessed == 0:
        self_tuning.guess_stiffness(settings, memory)
    memory.newcomer = memory.newcomer_leads
    if not _innovate(settings, memory):
        return NUMERICAL
    decision = gate(settings, memory)
    if decision == OUTLIER:
        self_tuning.learn_refused(settings, memory)
    if decision != ACCEPTED:
        return decision
    _correct(settings, memory)
    decision = commit(settings, memory, time)
    if decision != ACCEPTED:
        return decision
    memory.motion_anew = 0
    memory.change_detected = 0
    force_estimate.find(settings, memory)
    memory.reported[0] = memory.innovation[0]
    memory.reported[1] = memory.innovation[1]
    memory.reported[2] = memory.nis
    memory.reported[3] = memory.predicted_measurement[0]
    memory.reported[4] = memory.predicted_measurement[1]
    self_tuning.learn_readings(settings, memory)
    alarm = self_tuning.learn_innovation(settings, memory)
    self_tuning.correct_density(settings, memory)
    if manoeuvre.answer(settings, memory, time, alarm):
        alarm = False
        if memory.turn_doubted == 0:
            force_estimate.trust_sensor(memory)
    elif memory.contest != 0:
        _use_for_rival(settings, memory)
    self_tuning.decide(settings, memory, alarm)
    manoeuvre.keep(memory, time)
    memory.innovation[0] = memory.reported[0]
    memory.innovation[1] = memory.reported[1]
    memory.nis = memory.reported[2]
    memory.predicted_measurement[0] = memory.reported[3]
    memory.predicted_measurement[1] = memory.reported[4]
    return ACCEPTED


@compiled
def run(
    settings_array: Any,
    memory_array: Any,
    particles: NDArray[np.float64],
    samples: NDArray[np.float64],
    rows: NDArray[np.float64],
) -> None:
    """Run the filter over samples; arguments as in `filters.ukf.run`."""
    settings, memory = settings_array[0], memory_array[0]
    for k in range(samples.shape[0]):
        time = samples[k, 0]
        told = hindsight.note_told(memory)
        decision = screen(settings, memory, time, samples[k, 1], samples[k, 2])
        if decision == ACCEPTED:
            decision = _use(settings, memory, time)
        recover(settings, memory, decision)
        hindsight.write(settings, memory, decision, rows[k], told)
