"""What zeros that are taken for exact leave open, where something says that they are not.

Before zeros are moved they must be found for certain, and for seconds (`zero_fit`); many never can
be. Until then K, B and n would be said to be known as well as with exact zeros, which they are not
(of contacts whose force zero or contact position is off, 15 and 18 % of the samples had K more than
four deviations off, and 7 and 9 % with this; `hc bench accuracy troubles`). So what is given out is
the average over none, either and both being off, each as likely beforehand (Bayesian model
averaging; Hoeting et al., Statistical Science 14, 1999). A zero that is off is normal, with a share
of the largest depth or force as its deviation. A doubt begins with positive evidence (a Bayes
factor of 3; Kass and Raftery, JASA 90, 1995), and lasts until exact zeros are likelier: where the
motion says nothing at all of the zeros, they are what the user says.
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.linear_algebra import clear_matrix
from hc_estimator.multiple_model.kalman import LARGEST_LOG
from hc_estimator.multiple_model.zero_records import BOTH, OF_FORCE
from hc_estimator.multiple_model.zero_sensitivity import note_slopes

# Deviations beforehand of zeros that are off, as a share of the largest depth and force.
LIKELY_POSITION = 0.05
LIKELY_ZERO = 0.05
SMALLEST = 1e-9  # of these deviations [mm], [N]
POSITIVE = 3.0  # Bayes factor that is evidence for zeros that are off


@compiled
def doubt(zeros: Any, possible: int, largest: tuple[float, float]) -> None:
    """Doubt zeros that are taken for exact, if the points of a fit give reason to.

    Args:
        zeros: of a fit with all that may be unknown; its doubt is set.
        possible: which may be off.
        largest: depth [mm] and force [N].
    """
    enough = 1.0 if zeros.doubt[0, 0] > 0.0 else POSITIVE
    clear_matrix(zeros.doubt)
    note_slopes(zeros, possible)
    first = max(LIKELY_POSITION * largest[0], SMALLEST) ** 2
    second = max(LIKELY_ZERO * largest[1], SMALLEST) ** 2
    total, likeliest = 1.0, 0.0
    for choice in range(1, BOTH + 1):
        if choice & ~possible != 0:
            continue
        bayes = _note_posterior(zeros, possible, choice, first, second)
        if not math.isfinite(bayes):
            continue
        total += bayes
        likeliest = max(likeliest, bayes)
        square = zeros.square
        for i in range(4):
            for j in range(4):
                element = 0.0
                for k in range(2):
                    for m in range(2):
                        element += zeros.slopes_by[i, k] * square[k, m] * zeros.slopes_by[j, m]
                zeros.doubt[i, j] += bayes * element
    for i in range(4):
        for j in range(4):
            zeros.doubt[i, j] = zeros.doubt[i, j] / total if likeliest > enough else 0.0


@compiled
def _note_posterior(zeros: Any, possible: int, choice: int, first: float, second: float) -> float:
    """Mean squares of zeros that are off, in zeros.square, and the Bayes factor against none.

    Args:
        zeros: of a fit with all that may be unknown.
        possible: which were.
        choice: which are off.
        first: variance of the position beforehand [mm^2].
        second: of the force [N^2].
    """
    square = zeros.square
    clear_matrix(square)
    position, force = zeros.position, zeros.force
    a, b, c = zeros.covariance[0, 0], zeros.covariance[0, 1], zeros.covariance[1, 1]
    if choice != BOTH:
        if possible == BOTH:  # the other one is exact
            position, force = position - b / c * force, force - b / a * position
            a, c = a - b * b / c, c - b * b / a
        mean, variance, prior, k = position, a, first, 0
        if choice == OF_FORCE:
            mean, variance, prior, k = force, c, second, 1
        share = prior / (variance + prior)
        square[k, k] = share * (variance + share * mean * mean)
        return math.sqrt(1.0 - share) * math.exp(
            min(0.5 * share * mean * mean / variance, LARGEST_LOG)
        )
    # Precisions without and with the prior.
    determinant = a * c - b * b
    u, v, w = c / determinant, -b / determinant, a / determinant
    x, z = u + 1.0 / first, w + 1.0 / second
    posterior = x * z - v * v
    pull, push = u * position + v * force, v * position + w * force
    mean, other = (z * pull - v * push) / posterior, (x * push - v * pull) / posterior
    square[0, 0] = z / posterior + mean * mean
    square[0, 1] = square[1, 0] = -v / posterior + mean * other
    square[1, 1] = x / posterior + other * other
    gain = pull * mean + push * other
    shrinks = 1.0 / (first * second * posterior)
    return math.sqrt(shrinks) * math.exp(min(0.5 * gain, LARGEST_LOG))
