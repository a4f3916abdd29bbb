"""What zeros that are taken for exact leave open, where something says that they are not.

Before zeros are moved they must be found for certain, and for seconds (`zero_fit`); many never can
be. Until then K, B and n would be said to be known as well as with exact zeros, which they are not
(of contacts whose force zero or contact position is off, 15 and 18 % of the samples had K more than
four deviations off, and 7 and 9 % with this; `hc bench accuracy troubles`). So what is given out is
the average over none, either and both being off, each as likely beforehand (Bayesian model
averaging; Hoeting et al., Statistical Science 14, 1999). A zero that is off is normal, with a share
of the largest depth or force as its deviation. A doubt begins where that is likelier, and lasts
until exact zeros are twice as likely (of 50 um and 0.1 N at 500 readings a second 1 % of the
samples were told wrong so, and 13 % with the factor of 3 that Kass and Raftery, JASA 90, 1995, call
positive evidence): where the motion says nothing at all of the zeros, they are what the user says.
Beneath a surface that moves, which hides a force zero that is off, it is doubted without that. A
zero that the user knows to so much (`zero_doubt`) is not doubted, and tells of the other no more
than that.
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.linear_algebra import clear_matrix, clear_vector
from hc_estimator.multiple_model.kalman import LARGEST_LOG
from hc_estimator.multiple_model.zero_records import BOTH, NONE, OF_FORCE, OF_POSITION
from hc_estimator.multiple_model.zero_sensitivity import element_by_slopes, note_slopes

# Deviations beforehand of zeros that are off, as a share of the largest depth and force.
LIKELY_POSITION = 0.05
LIKELY_ZERO = 0.05
SMALLEST = 1e-9  # of these deviations [mm], [N]
# Bayes factors: for zeros that are off, at which a doubt begins, and under which it ends.
BEGINS, ENDS = 1.5, 0.5


@compiled
def forget(zeros: Any) -> None:
    """Take the zeros in use for exact."""
    clear_matrix(zeros.doubt)
    clear_vector(zeros.off)


@compiled
def doubt(
    settings: Any, zeros: Any, possible: int, largest: tuple[float, float], moves: bool
) -> None:
    """Doubt zeros that are taken for exact, if the points of a fit give reason to.

    Args:
        settings: settings record.
        zeros: of a fit with all that may be unknown; its doubt, and what is off, is set.
        possible: which may be off.
        largest: depth [mm] and force [N].
        moves: True if the surface may move, and hides a force zero that is off: K is off by more
            than it would be known to long before there is evidence for that zero.
    """
    enough = ENDS if zeros.doubt[0, 0] > 0.0 else BEGINS
    forget(zeros)
    note_slopes(zeros, possible)
    known = (settings.contact_position_std**2, settings.force_zero_std**2)
    likely = (
        max(LIKELY_POSITION * largest[0], SMALLEST) ** 2,
        max(LIKELY_ZERO * largest[1], SMALLEST) ** 2,
    )
    doubted = possible
    if known[0] > 0.0:
        doubted &= ~OF_POSITION
    if known[1] > 0.0:
        doubted &= ~OF_FORCE
    total, likeliest = 1.0, 0.0
    for choice in range(1, BOTH + 1):
        if choice & ~doubted != NONE:
            continue
        bayes = _note_posterior(zeros, possible, choice, known, likely)
        if not math.isfinite(bayes):
            continue
        total += bayes
        likeliest = max(likeliest, bayes)
        for i in range(2):
            zeros.off[i] += bayes * zeros.square[i, i]
        for i in range(4):
            for j in range(4):
                zeros.doubt[i, j] += bayes * element_by_slopes(zeros, zeros.square, i, j)
    if not (moves or likeliest > enough):
        forget(zeros)
        return
    for i in range(2):
        zeros.off[i] = math.sqrt(zeros.off[i] / total)
    for i in range(4):
        for j in range(4):
            zeros.doubt[i, j] /= total


@compiled
def _note_posterior(
    zeros: Any,
    possible: int,
    choice: int,
    known: tuple[float, float],
    likely: tuple[float, float],
) -> float:
    """Mean squares of zeros that are off, in zeros.square, and the Bayes factor against none.

    Args:
        zeros: of a fit with all that may be unknown.
        possible: which were.
        choice: which are off.
        known: variances of position [mm^2] and force [N^2] where they are not; 0 for exact.
        likely: the same beforehand where they are.
    """
    square = zeros.square
    clear_matrix(square)
    position, force = zeros.position, zeros.force
    a, b, c = zeros.covariance[0, 0], zeros.covariance[0, 1], zeros.covariance[1, 1]
    if choice != BOTH:
        if possible == BOTH:  # what the other one is known to be says something of it
            by_force, by_position = b / (c + known[1]), b / (a + known[0])
            position, force = position - by_force * force, force - by_position * position
            a, c = a - by_force * b, c - by_position * b
        mean, variance, prior, k = position, a, likely[0], 0
        if choice == OF_FORCE:
            mean, variance, prior, k = force, c, likely[1], 1
        share = prior / (variance + prior)
        square[k, k] = share * (variance + share * mean * mean)
        return math.sqrt(1.0 - share) * math.exp(
            min(0.5 * share * mean * mean / variance, LARGEST_LOG)
        )
    # Precisions without and with the prior.
    determinant = a * c - b * b
    u, v, w = c / determinant, -b / determinant, a / determinant
    x, z = u + 1.0 / likely[0], w + 1.0 / likely[1]
    posterior = x * z - v * v
    pull, push = u * position + v * force, v * position + w * force
    mean, other = (z * pull - v * push) / posterior, (x * push - v * pull) / posterior
    square[0, 0] = z / posterior + mean * mean
    square[0, 1] = square[1, 0] = -v / posterior + mean * other
    square[1, 1] = x / posterior + other * other
    gain = pull * mean + push * other
    shrinks = 1.0 / (likely[0] * likely[1] * posterior)
    return math.sqrt(shrinks) * math.exp(min(0.5 * gain, LARGEST_LOG))
