"""What is left open of another place: its height, and whether it is another one at all.

A contact too short to tell a stiffer place from a higher one is explained by both; what that
leaves open of K, B, n and p is averaged over both (Bayesian model averaging, Hoeting et al.,
Statistical Science 14, 1999), and so is whether the place is another (`another_place`).
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.linear_algebra import clear_matrix, copy_matrix, copy_vector
from hc_estimator.multiple_model.place_fit import POSITION


@compiled
def _by_height(covariance: Any, i: int, j: int) -> float:
    """Covariance of two parameters that is that of the height."""
    variance = max(covariance[POSITION, POSITION], 1e-300)
    return covariance[i, POSITION] * covariance[j, POSITION] / variance  # type: ignore[no-any-return]


@compiled
def join(place: Any, share: float) -> None:
    """Take the likelier of both fits, at the old height and at another one.

    What their heights leave open of the parameters is that of both (Bayesian model averaging).

    Args:
        place: `outcome` and `covariance` are those of the likelier fit, and `doubt` is set.
        share: probability that the height is another one.
    """
    by_share = (1.0 - share, share)
    outcomes = (place.outcome, place.outcome_elsewhere)
    covariances = (place.covariance, place.covariance_elsewhere)
    chosen = 1 if share > 0.5 else 0
    clear_matrix(place.doubt)
    for k in range(2):
        outcome, covariance = outcomes[k], covariances[k]
        for i in range(POSITION):
            off = outcome[i] - outcomes[chosen][i]
            for j in range(POSITION):
                both = _by_height(covariance, i, j)
                both += off * (outcome[j] - outcomes[chosen][j])
                place.doubt[i, j] += by_share[k] * both
    for i in range(POSITION):
        for j in range(POSITION):
            covariance = covariances[chosen]
            place.conditional[i, j] = covariance[i, j] - _by_height(covariance, i, j)
    position = outcomes[chosen][POSITION]
    square = 0.0
    for k in range(2):
        off = outcomes[k][POSITION] - position
        square += by_share[k] * (covariances[k][POSITION, POSITION] + off * off)
    place.height_deviation = math.sqrt(square)
    place.is_level = 1 - chosen
    if chosen == 1:
        copy_vector(place.outcome_elsewhere, place.outcome)
        copy_matrix(place.covariance_elsewhere, place.covariance)


@compiled
def leave_open(place: Any, share: float) -> None:
    """What is open of ln K, ln B, n and p if it may be another place with a probability."""
    for i in range(POSITION):
        off = place.outcome[i] - place.before[i]
        for j in range(POSITION):
            other = place.conditional[i, j] + place.doubt[i, j]
            other += off * (place.outcome[j] - place.before[j])
            place.open[i, j] = share * other
