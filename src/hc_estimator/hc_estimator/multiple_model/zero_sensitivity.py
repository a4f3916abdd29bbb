"""How K, B, n and p of a fit depend on contact position and force zero, and what that leaves open.

A zero that is known to so much leaves so much open of the parameters (Schmidt 1966, as for the
delay in `delay_sensitivity`); `zero_doubt` gives it out.
"""

from __future__ import annotations

from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.linear_algebra import clear_vector
from hc_estimator.multiple_model import spline
from hc_estimator.multiple_model.kalman import probability
from hc_estimator.multiple_model.levenberg_marquardt import solve
from hc_estimator.multiple_model.zero_records import BOTH, OF_FORCE, OF_POSITION

# Variance of ln K that zeros in use leave open, over the least before, up to which a fit is asked.
SHOWN = 4.0


@compiled
def note_covariance(zeros: Any, fit: Any) -> None:
    """What the fit says of the zeros and of the parameters, and how these go together."""
    values, column = fit.values, fit.next
    spline.locate(fit, fit.latest)
    stiffness = spline.log_stiffness(fit, values)
    zeros.fit[0] = stiffness
    zeros.fit[1] = stiffness + values[spline.LOG_RATIO]
    zeros.fit[2] = values[spline.EXPONENT]
    zeros.fit[3] = values[spline.VELOCITY_EXPONENT]
    zeros.position = values[spline.POSITION]
    zeros.force = values[spline.FORCE_ZERO]
    zeros.delay = values[spline.DELAY]
    for k in range(3):
        clear_vector(column)
        if fit.held[spline.POSITION + k] == 0:
            column[spline.POSITION + k] = zeros.inflation / fit.weight
        solve(fit.factor, column, fit.unknowns)
        by_stiffness = spline.log_stiffness(fit, column)
        zeros.columns[0, k] = by_stiffness
        zeros.columns[1, k] = by_stiffness + column[spline.LOG_RATIO]
        zeros.columns[2, k] = column[spline.EXPONENT]
        zeros.columns[3, k] = column[spline.VELOCITY_EXPONENT]
        for i in range(3):
            zeros.covariance[i, k] = column[spline.POSITION + i]


@compiled
def note_slopes(zeros: Any, unknown: int) -> None:
    """Derivatives of ln K, ln B, n and p by the zeros with which they were fitted."""
    a, b, c = zeros.covariance[0, 0], zeros.covariance[0, 1], zeros.covariance[1, 1]
    for i in range(4):
        by_position, by_force = zeros.columns[i, 0], zeros.columns[i, 1]
        first, second = 0.0, 0.0
        if unknown == BOTH:
            first = (c * by_position - b * by_force) / (a * c - b * b)
            second = (a * by_force - b * by_position) / (a * c - b * b)
        elif unknown == OF_POSITION:
            first = by_position / a
        elif unknown == OF_FORCE:
            second = by_force / c
        zeros.slopes_by[i, 0] = first
        zeros.slopes_by[i, 1] = second


@compiled
def element_by_slopes(zeros: Any, covariance: Any, i: int, j: int) -> float:
    """Covariance of two of ln K, ln B, n and p (0 to 3) that a covariance of both zeros makes."""
    first, second = zeros.slopes_by[i, 0], zeros.slopes_by[i, 1]
    third, fourth = zeros.slopes_by[j, 0], zeros.slopes_by[j, 1]
    element = first * (covariance[0, 0] * third + covariance[0, 1] * fourth)
    element += second * (covariance[0, 1] * third + covariance[1, 1] * fourth)
    return element  # type: ignore[no-any-return]


@compiled
def note_doubt(zeros: Any, unknown: int, doubt: Any) -> None:
    """What zeros that are unknown leave open of ln K, ln B, n and p.

    Args:
        zeros: fitted with these unknown; the parameters' derivatives by them are set.
        unknown: which zeros; the others are as they were given.
        doubt: takes the covariance, shape (4, 4).
    """
    note_slopes(zeros, unknown)
    for i in range(4):
        for j in range(4):
            doubt[i, j] = element_by_slopes(zeros, zeros.covariance, i, j)


@compiled
def average(zeros: Any, unknown: int, possible: int) -> None:
    """All zeros may be off although fewer explain the points (Bayesian model averaging).

    Hoeting et al., Statistical Science 14, 1999. The chosen fit stays what is used; in
    zeros.change are the parameters of the fit with all.
    """
    share = probability(0.5 * (zeros.cost[unknown] - zeros.cost[possible]))
    for i in range(4):
        zeros.change[i] -= zeros.fit[i]
    for i in range(4):
        for j in range(4):
            both = zeros.doubt_of_both[i, j] + zeros.change[i] * zeros.change[j]
            zeros.doubt_of_fit[i, j] += share * (both - zeros.doubt_of_fit[i, j])


@compiled
def keep_doubt(zeros: Any, shown: float) -> None:
    """What the zeros in use leave open by now: the fit's doubt, and what it would change.

    Points that show far less than others did, as in a hold, are no reason to doubt more: K was
    found from those others. That it may be another zero, is.

    Args:
        zeros: changed.
        shown: variance of ln K by the zeros of the last fit, be they all that is off.
    """
    if shown > SHOWN * zeros.least:
        return
    zeros.least = min(zeros.least, shown)
    position, force = zeros.position, zeros.force
    for i in range(4):
        zeros.change[i] = zeros.slopes_by[i, 0] * position + zeros.slopes_by[i, 1] * force
    for i in range(4):
        for j in range(4):
            zeros.doubt[i, j] = zeros.doubt_of_fit[i, j] + zeros.change[i] * zeros.change[j]
