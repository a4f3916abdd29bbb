"""Weights of particles: their logarithms, effective sample size, systematic resampling.

The weights are vectors, shape (count,): logarithms, which survive any likelihood, and what they are
the logarithms of beside them, because everybody needs those.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hc_estimator.compilation import compiled
from hc_estimator.random_numbers import uniform
from hc_estimator.specification import ParameterSpecification
from hc_estimator.vector_mathematics import exponential, largest, total, total_product
from hc_msgs_py.compilation import inlined_always

RESAMPLING_THRESHOLD = ParameterSpecification(
    "resampling_threshold",
    "float",
    0.5,
    "Resample when the effective sample size falls below this share of the particles; 1 "
    "resamples at every sample, as paper C does.",
    minimum=0.0,
    maximum=1.0,
)
SURVIVING_SHARE = ParameterSpecification(
    "surviving_share",
    "float",
    0.5,
    "No sample may reduce the effective sample size below this share of what it was: its "
    "likelihood is flattened as far as needed. 0 takes every likelihood as it is.",
    minimum=0.0,
    maximum=0.99,
)

NEGLIGIBLE = (
    -340.0
)  # logarithm of what is no weight: its square would be no normal number, and slow
CLOSE_ENOUGH = 0.99  # share of the loss that is allowed from which on no nearer power is sought
LONGEST_GUESSING = 8  # trials; bisection after that
LONGEST_SEARCH = 24  # trials: those of bisection halve 60 binary digits of the power to 0.001


@inlined_always
def _weight(logarithm: float) -> float:
    return 0.0 if logarithm < NEGLIGIBLE else exponential(logarithm)


@compiled
def weights_of(logarithms: NDArray[np.float64], weights: NDArray[np.float64]) -> None:
    """Write the weights of normalised logarithms."""
    for k in range(weights.shape[0]):
        weights[k] = _weight(logarithms[k])


@compiled
def effective_sample_size(weights: NDArray[np.float64]) -> float:
    """1 over the sum of the squared normalised weights: between 1 and the number of particles."""
    return 1.0 / total_product(weights, weights)


@compiled
def draw_places(
    settings: Any, memory: Any, weights: NDArray[np.float64], places: NDArray[np.float64]
) -> None:
    """Systematic resampling (Kitagawa 1996): who is drawn, with one random number for all.

    Args:
        settings: settings record (seed).
        memory: memory record (count of random numbers).
        weights: normalised weights.
        places: takes the place of the particle that is drawn for each, in ascending order.
    """
    count = weights.shape[0]
    position = uniform(settings, memory) / count
    source = 0
    cumulated = weights[0]
    for k in range(count):
        while cumulated < position and source < count - 1:
            source += 1
            cumulated += weights[source]
        places[k] = source
        position += 1.0 / count


@compiled
def _shared_out(
    power: float,
    before: NDArray[np.float64],
    gains: NDArray[np.float64],
    weights: NDArray[np.float64],
) -> tuple[float, float, float]:
    """Weights with the likelihood to a power, the largest being 1.

    Args:
        power: of the likelihood.
        before: logarithms of the weights before.
        gains: log likelihoods; -inf of what has no weight.
        weights: takes the weights.

    Returns:
        The logarithm that was taken off all of them (not finite: no weight is left), their sum and
        the effective sample size.
    """
    for k in range(weights.shape[0]):
        weights[k] = before[k] + power * gains[k]
    highest = largest(weights)
    for k in range(weights.shape[0]):
        weights[k] = _weight(weights[k] - highest)
    first = total(weights)
    return highest, first, first * first / total_product(weights, weights)


@compiled
def _scatter(
    before: NDArray[np.float64], gains: NDArray[np.float64], weights: NDArray[np.float64]
) -> float:
    """Variance of the log likelihoods over the particles that have one; weights are overwritten.

    To first order what the sample size's logarithm loses is that, times the square of the power.
    """
    for k in range(weights.shape[0]):
        weights[k] = _weight(before[k]) if gains[k] > -math.inf else 0.0
    whole = total(weights)
    if whole == 0.0:
        return 0.0
    for k in range(weights.shape[0]):
        gains_k = gains[k] if gains[k] > -math.inf else 0.0
        weights[k] *= gains_k
    mean = total(weights) / whole
    for k in range(weights.shape[0]):
        apart = gains[k] - mean if gains[k] > -math.inf else 0.0
        weights[k] = _weight(before[k]) * apart * apart
    return total(weights) / whole


@compiled
def flatten(
    before: NDArray[np.float64],
    logarithms: NDArray[np.float64],
    weights: NDArray[np.float64],
    smallest_share: float,
) -> float:
    """Raise the likelihoods of one sample to a power below 1 if they would leave few particles.

    A precise sensor can kill all particles but one in a single sample, and what one particle
    knows no resampling can spread again. The power is chosen such that the effective sample size
    keeps the given share of what it was, or up to a hundredth of the loss more; the information
    given up comes back with the samples that follow.

    The logarithm of the sample size falls with the square of a small power, which gives a first
    guess, and the secant of two trials gives the next; where that leads nowhere the power's
    logarithm is bisected.

    Args:
        before: normalised logarithms of the weights before the sample; changed.
        logarithms: those with the sample's log likelihoods added; normalised on return.
        weights: takes the normalised weights.
        smallest_share: share of the effective sample size that is kept.

    Returns:
        The power, between 0 and 1; NaN if no particle has a finite weight.
    """
    weights_of(before, weights)
    size_before = 1.0 / total_product(weights, weights)
    for k in range(weights.shape[0]):
        old, new = before[k], logarithms[k]
        dead = old == -math.inf or math.isnan(new)
        before[k] = 0.0 if dead else old
        logarithms[k] = -math.inf if dead else new - old
    power = 1.0
    highest, first, size = _shared_out(power, before, logarithms, weights)
    if not math.isfinite(highest):
        return math.nan
    if size < smallest_share * size_before:
        wanted = -math.log(smallest_share)
        aim = 0.5 * (1.0 + CLOSE_ENOUGH) * wanted
        lower, upper = -60.0, 0.0  # binary logarithms of powers that are small enough, and not
        last_at, last_loss, slope = 0.0, math.log(size_before / size), 2.0
        at = 0.5 * math.log2(aim / max(_scatter(before, logarithms, weights), aim))
        for trial in range(LONGEST_SEARCH):
            if not (lower < at < upper and trial < LONGEST_GUESSING):
                at = 0.5 * (lower + upper)
            power = 2.0**at
            highest, first, size = _shared_out(power, before, logarithms, weights)
            loss = max(math.log(size_before / size), 1e-9 * wanted)
            if loss <= wanted:
                lower = at
                if loss >= CLOSE_ENOUGH * wanted:
                    break
            else:
                upper = at
            if at != last_at and trial > 0:
                slope = min(max((math.log2(loss / last_loss)) / (at - last_at), 0.5), 4.0)
            last_at, last_loss = at, loss
            at += math.log2(aim / loss) / slope
        if last_at != lower:
            power = 2.0**lower
            highest, first, size = _shared_out(power, before, logarithms, weights)
    shift = highest + math.log(first)
    for k in range(weights.shape[0]):
        logarithms[k] = before[k] + power * logarithms[k] - shift
        weights[k] /= first
    return power
