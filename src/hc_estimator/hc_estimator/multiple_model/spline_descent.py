"""Levenberg-Marquardt down the cost of `spline_fit`, a step at a time.

A fit takes some dozens of steps of a third of a millisecond each. A sensor of 1 kHz does not wait
for that: `go_on` takes one step, and what is left is for later samples (`search`).

Marquardt, SIAM J. 11, 1963.
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.linear_algebra import clear_vector, copy_vector, is_definite, leading_cholesky
from hc_estimator.multiple_model.levenberg_marquardt import (
    FIRST_DAMPING,
    LARGEST_DAMPING,
    step,
)
from hc_estimator.multiple_model.rows import (
    LARGEST_EXPONENT,
    LARGEST_LOG_RATIO,
    LARGEST_VELOCITY_EXPONENT,
    SMALLEST_EXPONENT,
    SMALLEST_LOG_RATIO,
    SMALLEST_VELOCITY_EXPONENT,
)
from hc_estimator.multiple_model.spline import EXPONENT, LOG_RATIO, VELOCITY_EXPONENT
from hc_estimator.multiple_model.spline_fit import follow_bend, gather, weigh
from hc_estimator.multiple_model.spline_prior import (
    add_prior,
    learn_wandering,
    prior_cost,
    take_prior,
)
from hc_estimator.multiple_model.spline_records import (
    PASS_BEGINS,
    PASS_ENDS,
    PASS_GOES_ON,
    SOLVED,
)

PASSES = 3  # with other weights
SETTLED = 0.01  # relative change of the squares with which the weights hold
STEPS = 20  # down the cost, at most
# Decrease of the cost at which the fit is done. Zeros are told from none by a few of these, along a
# valley in which a thousandth of the whole is as much.
SMALLEST_GAIN = 0.05
HOPELESS = 10.0  # squares left over those of the noise at which other weights change nothing


@compiled
def solve_least_squares(
    settings: Any, history: Any, fit: Any, noise: tuple[float, float, float]
) -> float:
    """Fit from fit.values on, all steps at once; as `begin` and `go_on`.

    Returns:
        Weighted sum of squares; NaN if it broke down.
    """
    begin(settings, fit)
    while not go_on(settings, history, fit, noise):
        pass
    return float(fit.squares)


@compiled
def begin(settings: Any, fit: Any) -> None:
    """Begin a fit at fit.values.

    Args:
        settings: settings record.
        fit: laid out.
    """
    _limit(fit.values)
    clear_vector(fit.next)
    take_prior(settings, fit)
    # It goes on from pass to pass: a damped step must not pass for the end.
    fit.damping = FIRST_DAMPING
    fit.before = math.inf
    fit.passes = 0
    fit.phase = PASS_BEGINS


@compiled
def go_on(settings: Any, history: Any, fit: Any, noise: tuple[float, float, float]) -> bool:
    """Take a step; True once the fit is solved.

    Args:
        settings: settings record.
        history: points; their weights are changed.
        fit: begun. Once solved `values`, `factor`, `count`, `expected` and `weight` are those at
            the end, and `squares` the weighted sum of squares: NaN if it broke down.
        noise: as in `spline_fit.weigh`.
    """
    if fit.phase == PASS_BEGINS:
        weigh(settings, history, fit, noise)
        fit.squares = gather(settings, history, fit, fit.values)
        fit.cost = fit.squares + prior_cost(fit, fit.values)
        add_prior(fit, fit.values)
        fit.steps = 0
        fit.phase = PASS_GOES_ON
    elif fit.phase == PASS_GOES_ON:
        _step_down(settings, history, fit)
    elif fit.phase == PASS_ENDS:
        _end_pass(settings, history, fit)
    return bool(fit.phase == SOLVED)


@compiled
def _break_down(fit: Any) -> None:
    """Give the fit up."""
    fit.squares = math.nan
    fit.phase = SOLVED


@compiled
def _step_down(settings: Any, history: Any, fit: Any) -> None:
    """Take a step of a pass."""
    values, following = fit.values, fit.next
    if not step(fit, values, fit.damping, fit.unknowns):
        _break_down(fit)
        return
    follow_bend(settings, history, fit, values)
    _limit(following)
    squares = gather(settings, history, fit, following)
    cost = squares + prior_cost(fit, following)
    fit.steps += 1
    if fit.steps == STEPS:
        fit.phase = PASS_ENDS
    if cost < fit.cost:
        gain = fit.cost - cost
        fit.cost = cost
        fit.squares = squares
        copy_vector(following, values)
        if gain < SMALLEST_GAIN:
            fit.phase = PASS_ENDS
            return
        add_prior(fit, values)
        fit.damping *= 0.1
    else:
        fit.damping *= 10.0
        if fit.damping > LARGEST_DAMPING:
            fit.phase = PASS_ENDS


@compiled
def _end_pass(settings: Any, history: Any, fit: Any) -> None:
    """End a pass, and begin another where other weights would change something."""
    squares = fit.squares
    if not math.isfinite(squares):
        _break_down(fit)
        return
    gather(settings, history, fit, fit.values)
    if not _factorise(fit):
        _break_down(fit)
        return
    fit.passes += 1
    hopeless = squares > HOPELESS * fit.expected
    goes_on = fit.passes < PASSES and not hopeless
    if not hopeless:
        if learn_wandering(fit) and abs(fit.before - squares) < SETTLED * squares:
            goes_on = False
        if not _factorise(fit):
            _break_down(fit)
            return
        fit.before = squares
    fit.weight = 1.0 / max(squares / max(fit.count, 1), 1.0)
    fit.phase = PASS_BEGINS if goes_on else SOLVED


@compiled
def _limit(values: Any) -> None:
    """Keep ln (B / K), n and p where the law means something."""
    values[LOG_RATIO] = min(max(values[LOG_RATIO], SMALLEST_LOG_RATIO), LARGEST_LOG_RATIO)
    values[EXPONENT] = min(max(values[EXPONENT], SMALLEST_EXPONENT), LARGEST_EXPONENT)
    least, most = SMALLEST_VELOCITY_EXPONENT, LARGEST_VELOCITY_EXPONENT
    values[VELOCITY_EXPONENT] = min(max(values[VELOCITY_EXPONENT], least), most)


@compiled
def _factorise(fit: Any) -> bool:
    """Factor of the information that was gathered at fit.values; False if it has none."""
    add_prior(fit, fit.values)
    if not leading_cholesky(fit.information, fit.factor, fit.unknowns):
        return False
    return bool(is_definite(fit.factor, fit.unknowns))
