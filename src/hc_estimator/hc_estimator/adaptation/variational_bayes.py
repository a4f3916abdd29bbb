"""Sensor noise by variational Bayes: an inverse gamma distribution of each variance.

Saerkkae and Nummenmaa (2009), with one fixed-point iteration per sample: what is left of the
innovation after the update, and the uncertainty of the state behind it, tell the noise. Unlike
paper B's covariance matching it cannot come out negative. Old samples are forgotten exponentially.
Model error counts as noise here, which `difference_noise` does not see.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from hc_estimator.compilation import compiled
from hc_estimator.memory import Field
from hc_estimator.specification import ParameterSpecification

SPECIFICATIONS = (
    ParameterSpecification(
        "bayes_memory",
        "float",
        200.0,
        "Samples over which variational Bayes averages the noise.",
        minimum=5.0,
        maximum=1e7,
    ),
)

FIELDS = (
    Field("bayes_shape", np.float64, (2,), 0.0),  # alpha of the inverse gamma distributions
    Field("bayes_scale", np.float64, (2,), 0.0),  # beta
)

FIRST_SHAPE = 2.5  # weight of the given noise: that of five samples


@compiled
def restart(memory: Any, channel: int) -> None:
    """Start from the channel's noise in memory.noise."""
    memory.bayes_shape[channel] = FIRST_SHAPE
    memory.bayes_scale[channel] = FIRST_SHAPE * memory.noise[channel]


@compiled
def learn(settings: Any, memory: Any) -> None:
    """Take an accepted sample's innovation into the noise memory.noise.

    With R the noise used, S the innovation covariance and Z the innovation, the residual after
    the update is R S^-1 Z and the measurement's posterior covariance R - R S^-1 R. A missing
    reading says nothing of its noise.
    """
    keep = 1.0 - 1.0 / settings.bayes_memory
    for i in range(2):
        if memory.present[i] == 0:
            continue
        noise = memory.measurement_noise[i]
        residual = 0.0
        for k in range(2):
            residual += noise * memory.inverse[i, k] * memory.innovation[k]
        uncertain = max(noise - noise * memory.inverse[i, i] * noise, 0.0)
        memory.bayes_shape[i] = keep * memory.bayes_shape[i] + 0.5
        memory.bayes_scale[i] = keep * memory.bayes_scale[i] + 0.5 * (
            residual * residual + uncertain
        )
        floor = settings.displacement_noise_floor if i == 0 else settings.force_noise_floor
        memory.bayes_scale[i] = max(memory.bayes_scale[i], floor * floor * memory.bayes_shape[i])
        memory.noise[i] = memory.bayes_scale[i] / memory.bayes_shape[i]
