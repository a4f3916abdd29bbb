"""Change of the tissue: the innovations of the force grow, while the sensor's noise did not.

The normalised innovation squared of the force channel alone, Z_F^2 / S_FF, has mean 1 in a
consistent filter. Its mean over a window of samples in contact, or a one-sided cumulative sum of
its excess (CUSUM), beyond a threshold is called a change; a refractory time follows.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from hc_estimator.compilation import compiled
from hc_estimator.memory import Field
from hc_estimator.specification import ParameterSpecification

LONGEST_WINDOW = 256
NONE = 0  # position in the choices
WINDOW = 1

SPECIFICATIONS = (
    ParameterSpecification(
        "change_detection",
        "str",
        "window",
        "How a change is detected from the innovations of the force: their mean square over a "
        "window, their cumulative excess (CUSUM), or not at all.",
        choices=("none", "window", "cusum"),
    ),
    ParameterSpecification(
        "change_window",
        "int",
        30,
        "Samples in contact in the window.",
        minimum=5,
        maximum=LONGEST_WINDOW,
    ),
    ParameterSpecification(
        "change_threshold",
        "float",
        4.8,
        "Mean of the normalised innovation squared of the force over the window that is called a "
        "change. For 30 samples 3.2 is the chi-square quantile of a false alarm in 1e8; the "
        "default adds half for the scatter of the estimated noise.",
        minimum=1.5,
        maximum=1e6,
    ),
    ParameterSpecification(
        "cusum_drift",
        "float",
        2.0,
        "What the CUSUM subtracts from each normalised innovation squared, each limited to 30.",
        minimum=1.0,
        maximum=100.0,
    ),
    ParameterSpecification(
        "cusum_threshold",
        "float",
        20.0,
        "Cumulative excess that is called a change.",
        minimum=1.0,
        maximum=1e6,
    ),
    ParameterSpecification(
        "change_refractory",
        "int",
        400,
        "Samples in contact after a start or a change during which none is called.",
        minimum=0,
        maximum=10000000,
    ),
)

FIELDS = (
    Field("change_values", np.float64, (LONGEST_WINDOW,)),  # ring of normalised innovations squared
    Field("change_position", np.int64, (), 0, LONGEST_WINDOW - 1),
    Field("change_filled", np.int64, (), 0, LONGEST_WINDOW),
    Field("change_sum", np.float64, ()),  # CUSUM
    Field("change_quiet", np.int64, (), 0),  # samples in contact since the start or the last change
)

LARGEST_TERM = 30.0  # one spike must not call a change


@compiled
def restart(memory: Any) -> None:
    """Forget the innovations; the refractory time begins."""
    memory.change_position = 0
    memory.change_filled = 0
    memory.change_sum = 0.0
    memory.change_quiet = 0


@compiled
def detect(settings: Any, memory: Any) -> bool:
    """Take the innovation of an accepted force in contact and say whether it is a change."""
    if settings.change_detection == NONE:
        return False
    innovation = memory.innovation[1]
    value = min(innovation * innovation / memory.innovation_covariance[1, 1], LARGEST_TERM)
    memory.change_quiet += 1
    quiet = memory.change_quiet > settings.change_refractory
    if settings.change_detection == WINDOW:
        window = settings.change_window
        memory.change_values[memory.change_position] = value
        memory.change_position = (memory.change_position + 1) % LONGEST_WINDOW
        memory.change_filled = min(memory.change_filled + 1, LONGEST_WINDOW)
        if not quiet or memory.change_filled < window:
            return False
        changed = _sum_of_latest(memory, window) > settings.change_threshold * window
    else:
        memory.change_sum = max(0.0, memory.change_sum + value - settings.cusum_drift)
        changed = memory.change_sum > settings.cusum_threshold
    return bool(changed and quiet)


@compiled
def _sum_of_latest(memory: Any, window: int) -> float:
    """Sum of so many latest values, from the newest on."""
    values, position = memory.change_values, memory.change_position
    total = 0.0
    for k in range(position - 1, max(position - window, 0) - 1, -1):
        total += values[k]
    for k in range(LONGEST_WINDOW - 1, LONGEST_WINDOW + position - window - 1, -1):
        total += values[k]
    return total
