"""Random numbers for the kernels: seeded, the same on every machine, and their state is a count.

The n-th number is a hash (SplitMix64, Steele, Lea and Flood 2014) of seed and n, so that a filter
that draws numbers can be saved, restored and recomputed to the last bit.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hc_estimator.compilation import compiled
from hc_estimator.specification import ParameterSpecification
from hc_estimator.vector_mathematics import logarithm, sine_and_cosine
from hc_msgs_py.compilation import inlined_always

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


@inlined_always
def _hashed(start: np.uint64, number: int) -> float:
    """The number of `uniform` so many after that of a count, without a branch."""
    bits = start + np.uint64(number) * GOLDEN
    bits = (bits ^ (bits >> np.uint64(30))) * FIRST
    bits = (bits ^ (bits >> np.uint64(27))) * SECOND
    bits = bits ^ (bits >> np.uint64(31))
    # The upper 52 bits as the fraction of a number from 1 to 2, and half of the last one more.
    from_1 = np.uint64((bits >> np.uint64(12)) | np.uint64(0x3FF0000000000000)).view(np.float64)
    return (from_1 - 1.0) + 1.1102230246251565e-16


@inlined_always
def _normal_pair(start: np.uint64, number: int) -> tuple[float, float]:
    """Both numbers that Box and Muller make of one pair of uniform ones."""
    radius = math.sqrt(-2.0 * logarithm(_hashed(start, 2 * number + 1)))
    sine, cosine = sine_and_cosine(_hashed(start, 2 * number + 2))
    return radius * cosine, radius * sine


@compiled
def fill_normal(settings: Any, memory: Any, target: NDArray[np.float64]) -> None:
    """Fill a vector with the next standard normal numbers, 4 ns each: `normal` takes 45.

    The uniform numbers are those of `uniform`, two for two normal ones; an odd one at the end takes
    two as well.
    """
    pairs = target.shape[0] // 2
    first = target.shape[0] - pairs
    start = np.uint64(settings.seed) * SECOND + np.uint64(memory.random_counter) * GOLDEN
    one, other = target[:first], target[first:]
    for k in range(pairs):
        one[k], other[k] = _normal_pair(start, k)
    if first > pairs:
        one[pairs], _ = _normal_pair(start, pairs)
    memory.random_counter += 2 * first


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
