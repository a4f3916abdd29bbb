"""Tempering: the first force readings after a start or a change count less.

A sensor a thousand times better than the first guess collapses the covariance around wrong values
before the linearisation is any good. The force noise is therefore multiplied by
1 + amplitude exp(-k / samples) in the k-th sample in contact since the start or the last change.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hc_estimator.compilation import compiled
from hc_estimator.memory import Field
from hc_estimator.specification import ParameterSpecification

SPECIFICATIONS = (
    ParameterSpecification(
        "tempering_amplitude",
        "float",
        1e4,
        "How many times the force variance is enlarged at the start and after a change; 0 switches "
        "tempering off.",
        minimum=0.0,
        maximum=1e12,
    ),
    ParameterSpecification(
        "tempering_samples",
        "float",
        60.0,
        "Samples in contact over which the enlargement decays by a factor e.",
        minimum=1.0,
        maximum=1e6,
    ),
)

# Samples in contact since the start or the last change.
FIELDS = (Field("tempering_count", np.int64, (), 0),)


@compiled
def tempering_factor(settings: Any, memory: Any) -> float:
    """Factor of the force variance at this sample, 1 or more."""
    if settings.tempering_amplitude == 0.0:
        return 1.0
    decay = math.exp(-memory.tempering_count / settings.tempering_samples)
    return float(1.0 + settings.tempering_amplitude * decay)


@compiled
def is_over(settings: Any, memory: Any) -> bool:
    """True once the factor is below 2: from then on the innovations tell the noise."""
    return bool(tempering_factor(settings, memory) < 2.0)


@compiled
def count_sample(memory: Any) -> None:
    """Count an accepted force in contact."""
    memory.tempering_count += 1


@compiled
def restart(memory: Any) -> None:
    """Temper anew."""
    memory.tempering_count = 0
