"""What is believed beforehand of the place that a new contact is with (`another_place`).

Either it is the place before, whose tissue may have changed by a little meanwhile, or it is another
one, alike but no more.
"""

from __future__ import annotations

from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.linear_algebra import clear_matrix, copy_vector
from hc_estimator.multiple_model import place_fit
from hc_estimator.multiple_model.place_fit import DELAY, POSITION, RATE

OUT_TIME = 0.05  # without a force, though there is one by the law, before a contact is new [s]
FEWEST = 6  # points of a contact
LONGEST = 2.0  # time of a contact that is used [s]
# Of ln K, ln B / K, n and p about those of the place before, and of the height [mm].
DEVIATIONS = (1.0, 1.0, 0.3, 0.1)
HEIGHT_DEVIATION = 1.0
UNEVEN = 0.03  # of a surface that is level [mm]
VARIES = 0.01  # deviation of ln K and ln B by which the same place is another later on
LEAST_VARIANCE = 1e-8
CONSISTENT = 1.5  # squares left, in those of the noise, up to which a law fits


@compiled
def set_same(place: Any) -> None:
    """It is the place before: what was known of K and n is the prior, and about its height.

    Exactly at its height each tap on a surface that sinks was another place, known by that one tap.

    Args:
        place: its prior is set.
    """
    copy_vector(place.before, place.guess)
    _set_known(place, place.before_covariance, UNEVEN**2, place.joint != 0)


@compiled
def set_found(place: Any) -> None:
    """It is the tissue of the last fit, at a height of its own."""
    copy_vector(place.outcome, place.guess)
    place.guess[POSITION] = place.before[POSITION]
    _set_known(place, place.covariance, HEIGHT_DEVIATION**2, False)


@compiled
def _set_known(place: Any, known: Any, height_variance: float, jointly: bool) -> None:
    """Tissue and deviations are known, but for a little that it may have changed meanwhile.

    B and p are as free as another one's: what parabolas miss of a quick motion looks like damping.
    """
    clear_matrix(place.seen)
    for i in range(POSITION):
        for j in range(POSITION):
            place.seen[i, j] = known[i, j]
        place.seen[i, i] += LEAST_VARIANCE
    for i in range(2):
        for j in range(2):
            place.seen[i, j] += VARIES**2
    for i in (1, 3):
        place.seen[i, i] += DEVIATIONS[i] ** 2
    if jointly:
        for i in range(DELAY + 1):
            for j in range(DELAY + 1):
                if max(i, j) >= POSITION:
                    place.seen[i, j] = known[i, j]
        place.seen[POSITION, POSITION] += height_variance
        place.seen[DELAY, DELAY] += LEAST_VARIANCE
    else:
        place.seen[POSITION, POSITION] = height_variance
        place.seen[DELAY, DELAY] = max(place.delay_doubt, LEAST_VARIANCE)
        place.guess[DELAY] = 0.0
    place.seen[RATE, RATE] = max(place.square_rate, LEAST_VARIANCE)
    place.guess[RATE] = 0.0
    place_fit.invert(place.seen, place)


@compiled
def set_other(place: Any, height_variance: float) -> None:
    """It is another place: alike, but no more.

    Args:
        place: its prior is set.
        height_variance: of where the contact begins [mm^2].
    """
    prior, before = place.prior, place.before_covariance
    clear_matrix(prior)
    for i in range(POSITION):
        prior[i, i] = 1.0 / (DEVIATIONS[i] ** 2 + before[i, i])
    prior[POSITION, POSITION] = 1.0 / max(height_variance, LEAST_VARIANCE)
    prior[DELAY, DELAY] = 1.0 / max(place.delay_doubt, LEAST_VARIANCE)
    prior[RATE, RATE] = 1.0 / max(place.square_rate, LEAST_VARIANCE)
    # That of B is one of B / K.
    prior[0, 0] += prior[1, 1]
    prior[0, 1] = prior[1, 0] = -prior[1, 1]
    copy_vector(place.before, place.guess)
    place.guess[DELAY] = place.delay if place.joint != 0 else 0.0
    place.guess[RATE] = 0.0


@compiled
def weight_of(left: float) -> float:
    """Weight of the points' squares, of which a fit leaves so many times the noise's.

    What the law misses is no reason for another place.
    """
    return 1.0 / max(left, 1.0)


@compiled
def most_points(bank: Any) -> float:
    """Points of the longest contact that is used."""
    return LONGEST / (bank.history.every * bank.delay.grid_step)  # type: ignore[no-any-return]
