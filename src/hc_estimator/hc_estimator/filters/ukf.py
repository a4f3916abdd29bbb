"""`ukf`: the scaled unscented Kalman filter with redrawn points (paper A, section 3)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hc_estimator.adaptation import policy
from hc_estimator.compilation import compiled
from hc_estimator.correction import commit, correct, gate, innovate, measure_unscented
from hc_estimator.prediction import UNSCENTED_SPECIFICATIONS, add_process_noise, predict
from hc_estimator.recovery import recover
from hc_estimator.report import say_range, write_row
from hc_estimator.screening import ACCEPTED, NUMERICAL, screen

SPECIFICATIONS = UNSCENTED_SPECIFICATIONS + policy.SPECIFICATIONS


@compiled
def _use(settings: Any, memory: Any, time: float) -> int:
    """Predict to the sample, update with it and adapt; the decision on the sample."""
    if not predict(settings, memory, True):
        return NUMERICAL
    add_process_noise(memory)
    policy.prepare(settings, memory)
    if not (measure_unscented(settings, memory) and innovate(memory)):
        return NUMERICAL
    decision = gate(settings, memory)
    if decision != ACCEPTED:
        return decision
    correct(settings, memory)
    decision = commit(settings, memory, time)
    if decision == ACCEPTED:
        policy.learn(settings, memory)
    return decision


@compiled
def run(
    settings_array: Any,
    memory_array: Any,
    particles: NDArray[np.float64],
    samples: NDArray[np.float64],
    rows: NDArray[np.float64],
) -> None:
    """Run the filter over samples.

    Args:
        settings_array: one settings record, shape (1,).
        memory_array: one memory record, shape (1,); changed.
        particles: not used by this filter.
        samples: time [s], displacement [mm], force [N], shape (samples, 3).
        rows: takes the estimates, shape (samples, estimate.COLUMNS).
    """
    settings, memory = settings_array[0], memory_array[0]
    for k in range(samples.shape[0]):
        time = samples[k, 0]
        decision = screen(settings, memory, time, samples[k, 1], samples[k, 2])
        if decision == ACCEPTED:
            decision = _use(settings, memory, time)
        recover(settings, memory, time, decision)
        write_row(settings, memory, decision, rows[k])
        say_range(settings, samples[k, 2], rows[k])
