"""Random-weighted strong tracking: the scaling factor of the predicted covariance (paper A).

When the Mahalanobis distance of the innovation (Eq. 51, which is Z^T S^-1 Z) exceeds a threshold,
the predicted covariance is multiplied by a factor that makes the innovation covariance expected by
the filter match the one seen in a window (Eq. 29 and 47), and the measurement update is repeated.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hc_estimator.compilation import compiled
from hc_estimator.contact.registry import end_of_parameters
from hc_estimator.memory import Field
from hc_estimator.random_numbers import exponential
from hc_estimator.specification import ParameterSpecification

LONGEST_WINDOW = 256
GUARDED = 0  # positions in the choices
LITERAL = 1
ABSOLUTE = 2

SPECIFICATIONS = (
    ParameterSpecification(
        "innovation_window",
        "int",
        8,
        "Number M of innovations in the window (paper A, Eq. 46; its experiments use 4 and 5).",
        minimum=1,
        maximum=LONGEST_WINDOW,
        runtime=False,
    ),
    ParameterSpecification(
        "window_includes_present",
        "bool",
        True,
        "Count the present innovation in the window. Eq. 46 counts from the one before; then the "
        "first sample of a disturbance finds no reason to scale.",
    ),
    ParameterSpecification(
        "mahalanobis_threshold",
        "float",
        13.82,
        "Threshold of the squared Mahalanobis distance (paper A, Eq. 52). 13.82 is the chi-square "
        "quantile of 99.9 % for two measurements, 9.21 that of 99 %.",
        minimum=0.0,
        maximum=1e6,
    ),
    ParameterSpecification(
        "scaling_form",
        "str",
        "guarded",
        "The scaling factor of Eq. 29: limited to 1 and the largest scaling, literally as printed "
        "(it may be below 1 or negative, the update then fails), or its absolute value.",
        choices=("guarded", "literal", "absolute"),
    ),
    ParameterSpecification(
        "largest_scaling",
        "float",
        10.0,
        "Upper limit of the scaling factor in its guarded form.",
        minimum=1.0,
        maximum=1e6,
    ),
)

FIELDS = (
    # Ring of |Z|^2 / tr R for two readings.
    Field("tracking_values", np.float64, (LONGEST_WINDOW,)),
    Field("tracking_position", np.int64, (), 0, LONGEST_WINDOW - 1),
    Field("tracking_filled", np.int64, (), 0, LONGEST_WINDOW),
)


@compiled
def restart(memory: Any) -> None:
    """Empty the window."""
    memory.tracking_position = 0
    memory.tracking_filled = 0


@compiled
def _relative_square(memory: Any) -> float:
    """Squared length of the innovation, each channel in units of its measurement noise.

    Where a reading is missing the other one stands for it.
    """
    total = 0.0
    for i in range(2):
        if memory.present[i] != 0:
            total += memory.innovation[i] ** 2 / memory.measurement_noise[i]
    return 2.0 * total / (memory.present[0] + memory.present[1])  # type: ignore[no-any-return]


@compiled
def remember(settings: Any, memory: Any) -> None:
    """Put the innovation of the first pass of an accepted sample into the window."""
    memory.tracking_values[memory.tracking_position] = memory.first_square
    memory.tracking_position = (memory.tracking_position + 1) % settings.innovation_window
    memory.tracking_filled = min(memory.tracking_filled + 1, settings.innovation_window)


@compiled
def scaling_factor(settings: Any, memory: Any) -> float:
    """The factor gamma of the predicted covariance for this sample; 1 leaves it as it is.

    Eq. 29 with Dirichlet weights v_j (exponential numbers over their sum). Traces of a matrix of
    mm^2 and N^2 have no meaning, so both channels count in units of their noise: for R = r I, as
    in the paper, that is Eq. 29 to the letter. Where readings come alone the window holds both
    channels' in turn.
    """
    memory.first_square = _relative_square(memory)
    if memory.nis <= settings.mahalanobis_threshold:
        return 1.0
    weights = 0.0
    total = 0.0
    for j in range(memory.tracking_filled):
        weight = exponential(settings, memory)
        weights += weight
        total += weight * memory.tracking_values[j]
    if settings.window_includes_present != 0:
        weight = exponential(settings, memory)
        weights += weight
        total += weight * memory.first_square
    if weights == 0.0:
        return 1.0
    expected = 0.0
    for i in range(2):
        spread = memory.innovation_covariance[i, i] - memory.measurement_noise[i]
        expected += spread / memory.measurement_noise[i]
    if not expected > 0.0:
        return 1.0
    factor: float = (total / weights - 2.0) / expected
    if settings.scaling_form == GUARDED:
        return float(min(max(factor, 1.0), settings.largest_scaling))
    if settings.scaling_form == ABSOLUTE:
        return abs(factor)
    return factor


@compiled
def scale_covariance(settings: Any, memory: Any, factor: float) -> None:
    """Multiply the predicted covariance by the factor (Eq. 26).

    In the guarded form no parameter's variance is raised above its prior: the factor would
    otherwise multiply, again and again, what no measurement ever brings down.
    """
    covariance = memory.predicted_covariance
    last = end_of_parameters(settings.contact_model)
    for i in range(7):
        memory.point[i] = math.sqrt(abs(factor))
        if settings.scaling_form == GUARDED and 3 <= i < last:
            room = memory.prior_variance[i - 3]
            if covariance[i, i] * factor > room:
                rise = room / covariance[i, i] if covariance[i, i] > 0.0 else 1.0
                memory.point[i] = math.sqrt(max(rise, 1.0))
    sign = -1.0 if factor < 0.0 else 1.0
    for i in range(7):
        for j in range(7):
            covariance[i, j] *= sign * memory.point[i] * memory.point[j]
