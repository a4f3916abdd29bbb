"""`aukf` and `raukf`: unscented filters that estimate their noise covariances (paper B, section 4).

`aukf` takes the noise from a window of innovations (section 4.1); `raukf` averages that over all
samples since the start or, with the modified weighting, since the last abrupt change (section
4.2). The paper does not say how an abrupt change is found; here the innovations of the force tell,
by a window or a CUSUM (see `adaptation.change_detection`). Nor does it say what ends a noise that
was learnt while the filter was lost: `adaptation.noise_doubt` does, and the filter starts anew.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hc_estimator.adaptation import (
    change_detection,
    covariance_matching,
    noise_doubt,
    policy,
    tempering,
)
from hc_estimator.compilation import compiled
from hc_estimator.correction import commit, correct, gate, innovate, measure_unscented
from hc_estimator.prediction import UNSCENTED_SPECIFICATIONS, add_process_noise, predict
from hc_estimator.recovery import recover, start_anew
from hc_estimator.report import say_range, write_row
from hc_estimator.screening import ACCEPTED, NUMERICAL, screen
from hc_estimator.state_space import registry as state_space

AUKF_SPECIFICATIONS = (
    *covariance_matching.SPECIFICATIONS,
    *UNSCENTED_SPECIFICATIONS,
    *policy.NOISE_SPECIFICATIONS,
    *tempering.SPECIFICATIONS,
)
RAUKF_SPECIFICATIONS = (
    covariance_matching.WEIGHTING_SPECIFICATION,
    *AUKF_SPECIFICATIONS,
    *change_detection.SPECIFICATIONS,
)


@compiled
def _use(settings: Any, memory: Any, time: float) -> int:
    """Predict to the sample, match Q and R, update and learn; the decision on the sample."""
    if not predict(settings, memory, True):
        return NUMERICAL
    covariance_matching.scale_process_noise(settings, memory)
    add_process_noise(memory)
    if not measure_unscented(settings, memory):
        return NUMERICAL
    covariance_matching.match_measurement_noise(settings, memory)
    memory.measurement_noise[0] = memory.next_noise[0]
    memory.measurement_noise[1] = memory.next_noise[1] * tempering.tempering_factor(
        settings, memory
    )
    if not innovate(memory):
        return NUMERICAL
    decision = gate(settings, memory)
    if decision != ACCEPTED:
        return decision
    correct(settings, memory)
    decision = commit(settings, memory, time)
    if decision == ACCEPTED:
        if tempering.is_over(settings, memory):
            covariance_matching.learn(settings, memory)
        memory.change_detected = 0
        if policy.is_touching(memory):
            tempering.count_sample(memory)
            if change_detection.detect(settings, memory):
                memory.change_detected = 1
                change_detection.restart(memory)
                if settings.weighting == covariance_matching.MODIFIED:
                    covariance_matching.abrupt_change(memory)
    return decision


@compiled
def _may_doubt(settings: Any) -> bool:
    """True for the recursive form with the modified weighting, unless it is to be the paper's."""
    if settings.window_only != 0 or settings.weighting != covariance_matching.MODIFIED:
        return False
    return bool(
        settings.adapted_noise != covariance_matching.PROCESS
        and settings.matching_trace != covariance_matching.LITERAL
        and not state_space.is_literal(settings)
    )


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
        decision = screen(settings, memory, time, samples[k, 1], samples[k, 2])
        if decision == ACCEPTED:
            decision = _use(settings, memory, time)
        recover(settings, memory, time, decision)
        if decision == ACCEPTED and _may_doubt(settings) and noise_doubt.doubts(settings, memory):
            start_anew(settings, memory)
        write_row(settings, memory, decision, rows[k])
        say_range(settings, samples[k, 2], rows[k])
