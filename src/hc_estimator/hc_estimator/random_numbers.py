"""Random numbers for the kernels: seeded, the same on every machine, and their state is a count.

The n-th number is a hash (SplitMix64, Steele, Lea and Flood 2014) of seed and n, so that a filter
that draws numbers can be saved, restored and recomputed to the last bit.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hc_estimator.compilation import compiled
from hc_estimator.specification import ParameterSpecification

SPECIFICATIONS = (
    ParameterSpecification(
        "seed",
        "int",
        1,
        "Seed of the filter's random numbers.",
        minimum=0,
        maximum=2**31 - 1,
        runtime=False,
    ),
)

GOLDEN = np.uint64(0x9E3779B97F4A7C15)
FIRST = np.uint64(0xBF58476D1CE4E5B9)
SECOND = np.uint64(0x94D049BB133111EB)


@compiled
def uniform(settings: Any, memory: Any) -> float:
    """The next number, uniform in (0, 1), never 0 or 1."""
    memory.random_counter += 1
    bits = np.uint64(settings.seed) * SECOND + np.uint64(memory.random_counter) * GOLDEN
    bits = (bits ^ (bits >> np.uint64(30))) * FIRST
    bits = (bits ^ (bits >> np.uint64(27))) * SECOND
    bits = bits ^ (bits >> np.uint64(31))
    return (float(bits >> np.uint64(12)) + 0.5) * 2.220446049250313e-16  # 2^-52


@compiled
def exponential(settings: Any, memory: Any) -> float:
    """The next number of the exponential distribution with mean 1."""
    return -math.log(uniform(settings, memory))


@compiled
def normal(settings: Any, memory: Any) -> float:
    """The next standard normal number (Box and Muller, one of the pair)."""
    radius = math.sqrt(-2.0 * math.log(uniform(settings, memory)))
    return radius * math.cos(2.0 * math.pi * uniform(settings, memory))


@compiled
def gamma(settings: Any, memory: Any, shape: float) -> float:
    """The next number of the gamma distribution with the given shape and scale 1.

    Marsaglia and Tsang (2000), with their power of a uniform number for shapes below 1.
    """
    boost = 1.0
    if shape < 1.0:
        boost = math.exp(math.log(uniform(settings, memory)) / shape)
        shape += 1.0
    d = shape - 1.0 / 3.0
    c = 1.0 / math.sqrt(9.0 * d)
    while True:
        x = normal(settings, memory)
        v = 1.0 + c * x
        if v <= 0.0:
            continue
        v = v * v * v
        if math.log(uniform(settings, memory)) < 0.5 * x * x + d - d * v + d * math.log(v):
            return boost * d * v
