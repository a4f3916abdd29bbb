"""Tempering by what the linearisation leaves out, for as long as it stays the same.

The unscented transform knows how much of the force's variance a linear function of the state
cannot explain, and adds it to the innovation's variance as if it were noise of one sample. It is
not: while the tool does about the same, the error repeats itself in sample after sample, and a
filter that averages it away becomes certain of wrong parameters (with K and B only known as
K + B v^p the covariance collapses along a curved valley). Here that variance counts once per
coherence time of the motion, not once per sample (ours; `hc bench accuracy ablation`). The
coherence time is a share of |v| / |a|, long in slow motion, short in fast.
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.multiple_model.hypotheses import ACCELERATION, VELOCITY
from hc_estimator.specification import ParameterSpecification

SPECIFICATIONS = (
    ParameterSpecification(
        "coherence_share",
        "float",
        0.35,
        "Coherence time of the linearisation error as a share of |v| / |a|; 0 switches tempering "
        "off.",
        minimum=0.0,
        maximum=10.0,
    ),
)

SHORTEST = 0.025  # coherence time [s]
LONGEST = 0.28  # at constant velocity and in a hold [s]
MOTION_TIME = 0.1  # time constant of the mean squares of velocity and acceleration [s]


@compiled
def reset(tool: Any) -> None:
    """Nothing is known of the motion: the coherence time starts at its longest."""
    tool.mean_square_velocity = 1.0
    tool.mean_square_acceleration = 0.0


@compiled
def learn(tool: Any, row: Any, elapsed: float) -> None:
    """Take velocity and acceleration of a row into their mean squares."""
    share = min(1.0, elapsed / MOTION_TIME)
    velocity, acceleration = row.state[VELOCITY], row.state[ACCELERATION]
    tool.mean_square_velocity += share * (velocity * velocity - tool.mean_square_velocity)
    variance = row.covariance[ACCELERATION, ACCELERATION]
    square = acceleration * acceleration - variance
    tool.mean_square_acceleration += share * (square - tool.mean_square_acceleration)


@compiled
def coherent_samples(settings: Any, tool: Any, elapsed: float) -> float:
    """Samples over which the linearisation error stays the same; 0 if there is no tempering."""
    if settings.coherence_share == 0.0 or elapsed <= 0.0:
        return 0.0
    square = tool.mean_square_velocity
    slowest = LONGEST / settings.coherence_share
    rate = max(tool.mean_square_acceleration, 0.0) + square / (slowest * slowest)
    time = settings.coherence_share * math.sqrt(square / (rate + 1e-30))
    return float(max(time, SHORTEST) / elapsed)
