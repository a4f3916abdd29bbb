"""`rwstukf`: random weighting strong tracking unscented Kalman filter (paper A, section 4).

The unscented filter; when the Mahalanobis test says that the model does not explain the
innovation, the predicted covariance is scaled up and the measurement update alone is repeated
(paper A, figure 1).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hc_estimator.adaptation import policy, strong_tracking
from hc_estimator.compilation import compiled
from hc_estimator.correction import commit, correct, gate, innovate, measure_unscented
from hc_estimator.prediction import UNSCENTED_SPECIFICATIONS, add_process_noise, predict
from hc_estimator.random_numbers import SPECIFICATIONS as RANDOM_SPECIFICATIONS
from hc_estimator.recovery import recover
from hc_estimator.report import say_range, write_row
from hc_estimator.screening import ACCEPTED, NUMERICAL, screen

SPECIFICATIONS = (
    *strong_tracking.SPECIFICATIONS,
    *RANDOM_SPECIFICATIONS,
    *UNSCENTED_SPECIFICATIONS,
    *policy.SPECIFICATIONS,
)


@compiled
def _use(settings: Any, memory: Any, time: float) -> int:
    """Predict to the sample, test it, update with it and adapt; the decision on the sample."""
    if not predict(settings, memory, True):
        return NUMERICAL
    add_process_noise(memory)
    policy.prepare(settings, memory)
    if not (measure_unscented(settings, memory) and innovate(memory)):
        return NUMERICAL
    decision = gate(settings, memory)
    if decision != ACCEPTED:
        return decision
    factor = strong_tracking.scaling_factor(settings, memory)
    if factor != 1.0:
        # The first pass is what the report calls innovation and NIS: it judges the filter.
        innovation, other = memory.innovation[0], memory.innovation[1]
        force, nis = memory.predicted_measurement[1], memory.nis
        strong_tracking.scale_covariance(settings, memory, factor)
        if not (measure_unscented(settings, memory) and innovate(memory)):
            return NUMERICAL
        correct(settings, memory)
        memory.innovation[0], memory.innovation[1] = innovation, other
        memory.predicted_measurement[1], memory.nis = force, nis
    else:
        correct(settings, memory)
    decision = commit(settings, memory, time)
    if decision == ACCEPTED:
        strong_tracking.remember(settings, memory)
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
    """Run the filter over samples; arguments as in `filters.ukf.run`."""
    settings, memory = settings_array[0], memory_array[0]
    for k in range(samples.shape[0]):
        time = samples[k, 0]
        decision = screen(settings, memory, time, samples[k, 1], samples[k, 2])
        if decision == ACCEPTED:
            decision = _use(settings, memory, time)
        recover(settings, memory, time, decision)
        write_row(settings, memory, decision, rows[k])
        say_range(settings, samples[k, 2], rows[k])
