"""Tempering by what the linearisation leaves out, for as long as it stays the same.

The unscented transform knows how much of the force's variance a linear function of the state
cannot explain, and adds it to S as if it were noise of one sample. It is not: while the tool does
about the same, the error repeats itself in sample after sample, and a filter that averages it away
becomes certain of wrong parameters (with K and B only known as K + B v^p the covariance collapses
along a curved valley). Here that variance counts once per coherence time of the motion, not once
per sample: the force noise is enlarged by curvature x coherence time / sample time. The
coherence time is a share of |v| / |a|, long in slow motion, short in fast. The enlargement is huge
at the first contact and after a change, vanishes as the parameters become known, and returns
whenever their covariance grows; it needs no counting of samples.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hc_estimator.compilation import compiled
from hc_estimator.specification import ParameterSpecification

SPECIFICATIONS = (
    ParameterSpecification(
        "coherence_share",
        "float",
        0.35,
        "Coherence time of the linearisation error as a share of |v| / |a|; 0 switches this "
        "tempering off.",
        minimum=0.0,
        maximum=10.0,
    ),
    ParameterSpecification(
        "coherence_shortest",
        "float",
        0.025,
        "The coherence time does not fall below this.",
        minimum=0.0,
        maximum=10.0,
        unit="s",
    ),
    ParameterSpecification(
        "coherence_longest",
        "float",
        0.28,
        "The coherence time does not exceed this (constant velocity, hold).",
        minimum=1e-3,
        maximum=100.0,
        unit="s",
    ),
)

MOTION_TIME = 0.1  # time constant of the mean squares of velocity and acceleration [s]

FIELDS = (
    ("mean_square_velocity", np.float64, ()),
    ("mean_square_acceleration", np.float64, ()),  # less its own variance; may be negative
)


@compiled
def initialise(memory: Any) -> None:
    """Nothing is known of the motion: the coherence time starts at its longest."""
    memory.mean_square_velocity = 1.0
    memory.mean_square_acceleration = 0.0


@compiled
def learn(memory: Any) -> None:
    """Take velocity and acceleration of the state into their mean squares."""
    share = min(1.0, memory.elapsed / MOTION_TIME)
    velocity, acceleration = memory.state[1], memory.state[2]
    memory.mean_square_velocity += share * (velocity * velocity - memory.mean_square_velocity)
    memory.mean_square_acceleration += share * (
        acceleration * acceleration - memory.covariance[2, 2] - memory.mean_square_acceleration
    )


@compiled
def coherence_time(settings: Any, memory: Any) -> float:
    """How long the linearisation error stays the same [s]."""
    if settings.coherence_share == 0.0:
        return 0.0
    square = memory.mean_square_velocity
    slowest = settings.coherence_longest / settings.coherence_share
    rate = max(memory.mean_square_acceleration, 0.0) + square / (slowest * slowest)
    time = settings.coherence_share * math.sqrt(square / (rate + 1e-30))
    return max(time, settings.coherence_shortest)  # type: ignore[no-any-return]


@compiled
def enlargement(settings: Any, memory: Any) -> float:
    """What the force variance gains at this sample [N^2]; memory.curvature is that of h."""
    if memory.elapsed <= 0.0:
        return 0.0
    samples = coherence_time(settings, memory) / memory.elapsed
    return max(memory.curvature[1, 1], 0.0) * samples  # type: ignore[no-any-return]
