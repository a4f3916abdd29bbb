"""What a fit with splines says of tissue and surface at a time, and how well that is known."""

from __future__ import annotations

from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.linear_algebra import clear_vector
from hc_estimator.multiple_model import spline
from hc_estimator.multiple_model.levenberg_marquardt import solve
from hc_estimator.multiple_model.spline import has
from hc_estimator.multiple_model.spline_records import MOVES, SPLINE_FIRST, VARIES

OUTCOME = 7  # ln K, ln B, n, p; position and speed of the surface; rate of ln K


@compiled
def note_outcome(fit: Any, moving: Any, now: float) -> None:
    """Note parameters, surface and rate of ln K by the fit at a time, and their covariance.

    Args:
        fit: solved.
        moving: its `outcome` and `covariance` are set.
        now: the time [s].
    """
    ahead = min(max(now - fit.latest, 0.0), spline.KNOT)
    used = spline.locate(fit, fit.latest)
    slopes, outcome = moving.slopes, moving.outcome
    for i in range(OUTCOME):
        for j in range(fit.unknowns):
            slopes[i, j] = 0.0
    for i in range(3):
        slopes[1 + i, spline.LOG_RATIO + i] = 1.0
    first = SPLINE_FIRST + 1
    if has(fit, VARIES):
        first = SPLINE_FIRST + 4
        for i in range(4):
            place = fit.places[SPLINE_FIRST + i]
            slopes[0, place] = fit.basis[0, i] + ahead * fit.basis_rate[0, i]
            slopes[6, place] = fit.basis_rate[0, i]
    else:
        slopes[0, SPLINE_FIRST] = 1.0
    for j in range(fit.unknowns):
        slopes[1, j] += slopes[0, j]
    for i in range(first, used):
        place = fit.places[i]
        slopes[4, place] = fit.basis[1, i - first] + ahead * fit.basis_rate[1, i - first]
        slopes[5, place] = fit.basis_rate[1, i - first]
    if not has(fit, MOVES):
        slopes[4, spline.POSITION] = 1.0
        slopes[4, spline.SPEED] = ahead
        slopes[5, spline.SPEED] = 1.0
    for i in range(OUTCOME):
        outcome[i] = _product(slopes, i, fit.values, fit.unknowns)
    column = fit.next
    for i in range(OUTCOME):
        clear_vector(column)
        for j in range(fit.unknowns):
            held = j < SPLINE_FIRST and fit.fixed[j] != 0
            column[j] = 0.0 if held else slopes[i, j] / fit.weight
        solve(fit.factor, column, fit.unknowns)
        for k in range(OUTCOME):
            moving.covariance[k, i] = _product(slopes, k, column, fit.unknowns)
    _let_rates_wander(fit, moving.covariance, max(now - fit.latest, 0.0))


@compiled
def _let_rates_wander(fit: Any, covariance: Any, age: float) -> None:
    """Add what the rates may have done in a time [s] since the latest point, which nobody saw."""
    for i, rate, moves, wanders in ((0, 6, VARIES, 0), (1, 6, VARIES, 0), (4, 5, MOVES, 1)):
        if not has(fit, moves):
            continue
        variance = fit.wandering[wanders] * age
        covariance[i, i] += variance * age * age / 3.0
        covariance[i, rate] += 0.5 * variance * age
        covariance[rate, i] += 0.5 * variance * age
        if i != 1:  # ln B goes with ln K
            covariance[rate, rate] += variance
        else:
            covariance[0, 1] += variance * age * age / 3.0
            covariance[1, 0] += variance * age * age / 3.0


@compiled
def _product(slopes: Any, i: int, values: Any, size: int) -> float:
    """Sum of a row of derivatives times values."""
    total = 0.0
    for j in range(size):
        total += slopes[i, j] * values[j]
    return total
