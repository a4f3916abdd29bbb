"""Is another place another tissue as well, so that a change is called?

Its K or n is clearly another one, and its tissue, at a height of its own, does not explain the
contact before: at a zero that was wrong K and n were those of no tissue, however well the law
fitted there. Where the law did not fit the contacts before, nobody knows what tissue they were of.
(Ours; `hc bench accuracy places`.)
"""

from __future__ import annotations

from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.linear_algebra import copy_vector
from hc_estimator.multiple_model import history as histories
from hc_estimator.multiple_model import place_delay, place_fit, place_prior
from hc_estimator.multiple_model.change import is_different
from hc_estimator.multiple_model.place_prior import CONSISTENT, FEWEST, OUT_TIME
from hc_estimator.multiple_model.records import POINTS

CALLED_AFTER = 2  # contacts in a row that the law has to have fitted before a change is called


@compiled
def is_one(settings: Any, bank: Any) -> bool:
    """True if the place of the last fit is clearly of another tissue than the one before.

    Args:
        settings: settings record.
        bank: its record `place`, whose fits at other points are overwritten.
    """
    place = bank.place
    if place.fitting_in_a_row < CALLED_AFTER or not _is_other_tissue(place):
        return False
    return not _explains_before(settings, bank)


@compiled
def _is_other_tissue(place: Any) -> bool:
    """True if K or n of the last fit is clearly another than before the contact."""
    for i in (0, 2):
        off = place.outcome[i] - place.before[i]
        variance = place.covariance[i, i] + place.before_covariance[i, i]
        if is_different(off, variance):
            return True
    return False


@compiled
def _explains_before(settings: Any, bank: Any) -> bool:
    """True if the tissue of the place explains the contact before it as well, at another height."""
    place, history = bank.place, bank.history
    begin, first, last = _contact_before(bank), place.first, place.last
    if history.contact - begin < FEWEST:
        return False
    place.first, place.last = begin, history.contact
    place_delay.leave_open(place, bank.delay)
    place_prior.set_found(place)
    copy_vector(place.guess, place.values)
    cost = place_fit.fit(settings, place, history, histories.noise_of_points(bank), 1.0, 2)
    cost += place_fit.prior_cost(place, place.values)
    explains = cost < CONSISTENT * place.expected
    place.first, place.last = first, last
    place.late = 0
    return bool(explains)


@compiled
def _contact_before(bank: Any) -> int:
    """Number of the first point of the contact before the present one."""
    history = bank.history
    oldest = max(history.count - POINTS, history.contact - int(place_prior.most_points(bank)), 0)
    longest = OUT_TIME + history.every * bank.delay.grid_step
    first = history.contact
    while first > oldest:
        here, before = (
            history.points[first % POINTS].time,
            history.points[(first - 1) % POINTS].time,
        )
        if first < history.contact and here - before > longest:
            break
        first -= 1
    return int(first)
