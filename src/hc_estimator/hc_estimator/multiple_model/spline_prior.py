"""What is likely of splines and parameters before any point: a mean and a precision.

A spline costs what a rate makes likely that wanders as in the rows that follow one, and a surface
what breathing does. The prior is normal, so that the evidence of a fit, with which kinds are
compared, follows from two determinants (MacKay, Neural Computation 4, 1992).
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.linear_algebra import leading_cholesky
from hc_estimator.multiple_model.hypotheses import EXPONENT_ROW, OWN_WALKS, TREND_ROW
from hc_estimator.multiple_model.rows import prior_deviation
from hc_estimator.multiple_model.spline import (
    DELAY,
    EXPONENT,
    FORCE_ZERO,
    LOG_RATIO,
    POSITION,
    SPEED,
    SURFACE_DEVIATION,
    VELOCITY_EXPONENT,
    has,
    stiffness_count,
)
from hc_estimator.multiple_model.spline_records import BAND, BENDS, RELAXES, SPLINE_FIRST, STEADY

SPEED_DEVIATION = 0.1  # of a surface that sinks [mm/s]
LEVEL_DEVIATION = 10.0  # of a coefficient of ln K: any stiffness is as likely
SHARE_DEVIATION = 0.5  # of the force that a memory takes away
# Variance that the speed of such a surface gains per second [mm^2/s^3]: 1 mm at 0.25 Hz.
SURFACE_WALK = 1.0
STEADY_WALK = 1e-4  # the same of a rate of ln K that hardly changes [1/s^3]
# By how much less and more a rate may wander than that, where the fit says so, which it can from
# some intervals on. (MacKay, Neural Computation 4, 1992, equation 4.9.)
CALMER, WILDER = 100.0, 10.0
LEARNED_FROM = 6
LEAST_KNOWN = 0.5  # coefficients that the points determine, at least
SETTLED_WANDERING = 0.7  # change of its logarithm
# Variance of a second difference of the coefficients by that of the rate's wandering and the third
# power of the time between knots.
SECOND_DIFFERENCE = 2.0 / 3.0


@compiled
def _deviation(settings: Any, fit: Any, i: int) -> float:
    """Prior deviation of an unknown; 0 for one that is held, infinite for one without."""
    if i < SPLINE_FIRST and fit.held[i] != 0:
        return 0.0
    if i <= VELOCITY_EXPONENT:
        return prior_deviation(settings, i + 1)
    if i == DELAY:
        return float(fit.delay_deviation)
    if i == SPEED:
        return SPEED_DEVIATION
    if i == POSITION:
        return float(fit.position_deviation)
    if i == FORCE_ZERO:
        return float(fit.air_zero_deviation)
    if i < SPLINE_FIRST + stiffness_count(fit):
        return LEVEL_DEVIATION
    if has(fit, RELAXES):
        return SHARE_DEVIATION
    mean = SURFACE_DEVIATION
    if has(fit, BENDS):
        mean = prior_deviation(settings, 2)
    return mean * math.sqrt(fit.intervals[1] + 3.0)


@compiled
def _guess(settings: Any, fit: Any, i: int) -> float:
    """First guess of an unknown."""
    if i == LOG_RATIO:
        return math.log(settings.initial_damping / settings.initial_stiffness)
    if i == FORCE_ZERO:
        return float(fit.air_zero)
    between = SPLINE_FIRST + stiffness_count(fit)
    if i == EXPONENT or (i >= between and has(fit, BENDS)):
        return settings.initial_displacement_exponent  # type: ignore[no-any-return]
    if i == VELOCITY_EXPONENT:
        return settings.initial_velocity_exponent  # type: ignore[no-any-return]
    return float(fit.level) if i >= SPLINE_FIRST and i < between else 0.0


@compiled
def _usual_wandering(fit: Any, which: int) -> float:
    """Variance that a rate gains per second, before anything is known."""
    if which == 0:
        if has(fit, STEADY):
            return STEADY_WALK
        return OWN_WALKS[TREND_ROW, 0]  # type: ignore[no-any-return]
    return OWN_WALKS[EXPONENT_ROW, 1] if has(fit, BENDS) else SURFACE_WALK


@compiled
def take_prior(settings: Any, fit: Any) -> None:
    """Set fit.guess and fit.prior, the precision by row and distance from the diagonal, of a fit.

    Args:
        settings: settings record.
        fit: laid out.
    """
    prior, size = fit.prior, fit.unknowns
    for i in range(size):
        for j in range(BAND):
            prior[i, j] = 0.0
        deviation = _deviation(settings, fit, i)
        if i < SPLINE_FIRST:
            fit.fixed[i] = 1 if deviation == 0.0 else 0
        prior[i, 0] = 0.0 if deviation == 0.0 else 1.0 / (deviation * deviation)
        fit.guess[i] = _guess(settings, fit, i)
    for which in range(2):
        fit.wandering[which] = _usual_wandering(fit, which)
        add_wandering(fit, which, 1.0)


@compiled
def _second_differences(fit: Any, which: int) -> tuple[int, int]:
    """First coefficient of the first second difference of a spline, and of that after the last."""
    between = SPLINE_FIRST + stiffness_count(fit)
    if which == 0:
        return SPLINE_FIRST, between - 2
    return between, between if has(fit, RELAXES) else fit.unknowns - 2


@compiled
def _precision(fit: Any, which: int) -> float:
    """Precision of a second difference of a spline's coefficients."""
    return 1.0 / (SECOND_DIFFERENCE * fit.wandering[which] * fit.knot[which] ** 3)  # type: ignore[no-any-return]


@compiled
def add_wandering(fit: Any, which: int, sign: float) -> None:
    """Add what a rate that wanders makes likely of a spline to the prior, or take it away.

    Args:
        fit: its prior is changed.
        which: 0: spline of the stiffness, 1: the second one.
        sign: 1 to add, -1 to take away.
    """
    prior = fit.prior
    first, end = _second_differences(fit, which)
    for i in range(first, end):
        precision = sign * _precision(fit, which)
        for a in range(3):
            by_a = -2.0 if a == 1 else 1.0
            for b in range(a + 1):
                by_b = -2.0 if b == 1 else 1.0
                prior[i + a, a - b] += by_a * by_b * precision


@compiled
def learn_wandering(fit: Any) -> bool:
    """Let rates wander as makes the splines likeliest; True if that has hardly changed.

    Args:
        fit: its values are those of a fit, and `factor` that of its information.
    """
    values, settled = fit.values, True
    for which in range(2):
        usual = _usual_wandering(fit, which)
        if fit.intervals[which] < LEARNED_FROM:
            continue
        first, end = _second_differences(fit, which)
        precision, bend, known = _precision(fit, which), 0.0, float(end - first)
        for i in range(first, end):
            difference = values[i] - 2.0 * values[i + 1] + values[i + 2]
            bend += precision * difference * difference
            known -= precision * _squared_solution(fit, i)
        before = fit.wandering[which]
        wanted = before * bend / max(known, LEAST_KNOWN)
        after = min(max(wanted, usual / CALMER), usual * WILDER)
        settled = settled and abs(math.log(after / before)) < SETTLED_WANDERING
        add_wandering(fit, which, -1.0)
        fit.wandering[which] = after
        add_wandering(fit, which, 1.0)
    return settled


@compiled
def _squared_solution(fit: Any, first: int) -> float:
    """Squared norm of L^-1 d of the factor L and the second difference d at a coefficient."""
    factor, solution = fit.factor, fit.next
    total = 0.0
    for i in range(first, fit.unknowns):
        here = 0.0
        if i <= first + 2:
            here = -2.0 if i == first + 1 else 1.0
        for j in range(first, i):
            here -= factor[i, j] * solution[j]
        solution[i] = here / factor[i, i]
        total += solution[i] * solution[i]
    return total


@compiled
def prior_cost(fit: Any, values: Any) -> float:
    """Squared distance from the prior."""
    total, prior, guess = 0.0, fit.prior, fit.guess
    for i in range(fit.unknowns):
        here = values[i] - guess[i]
        total += prior[i, 0] * here * here
        for j in range(max(i - BAND + 1, 0), i):
            total += 2.0 * prior[i, i - j] * here * (values[j] - guess[j])
    return total


@compiled
def add_prior(fit: Any, values: Any) -> None:
    """Normal equations of the cost, from what was gathered at `values`."""
    information, slope, prior, guess = fit.information, fit.slope, fit.prior, fit.guess
    for i in range(fit.unknowns):
        slope[i] = fit.pull[i]
        for j in range(i + 1):
            information[i, j] = fit.seen[i, j]
    for i in range(fit.unknowns):
        here = values[i] - guess[i]
        slope[i] -= prior[i, 0] * here
        information[i, i] += prior[i, 0]
        for j in range(max(i - BAND + 1, 0), i):
            slope[i] -= prior[i, i - j] * (values[j] - guess[j])
            slope[j] -= prior[i, i - j] * here
            information[i, j] += prior[i, i - j]
    for i in range(SPLINE_FIRST):
        if fit.fixed[i] != 0:
            _hold(information, slope, i, fit.unknowns)


@compiled
def _hold(information: Any, slope: Any, i: int, size: int) -> None:
    """Take an unknown out of the normal equations."""
    slope[i] = 0.0
    for j in range(i):
        information[i, j] = 0.0
    for j in range(i + 1, size):
        information[j, i] = 0.0
    information[i, i] = 1.0


@compiled
def log_evidence(fit: Any, squares: float) -> float:
    """Laplace's logarithm of the evidence of a fit that is solved, up to what all kinds share.

    Args:
        fit: solved; its matrix `seen` is overwritten.
        squares: weighted sum of squares.
    """
    total, precision = squares + prior_cost(fit, fit.values), fit.seen
    for i in range(fit.unknowns):
        total += 2.0 * math.log(fit.factor[i, i])
        for j in range(i):
            precision[i, j] = fit.prior[i, i - j] if i - j < BAND else 0.0
        is_held = i < SPLINE_FIRST and fit.fixed[i] != 0
        precision[i, i] = 1.0 if is_held else fit.prior[i, 0]
    if not leading_cholesky(precision, precision, fit.unknowns):
        return -math.inf
    for i in range(fit.unknowns):
        total -= 2.0 * math.log(precision[i, i])
    return -0.5 * total
