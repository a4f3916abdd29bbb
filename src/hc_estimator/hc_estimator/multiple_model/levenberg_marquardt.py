"""Levenberg-Marquardt steps down the cost of `normal_equations`, without allocating.

Marquardt, SIAM J. 11, 1963.
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.linear_algebra import copy_vector, is_definite, leading_cholesky
from hc_estimator.multiple_model.normal_equations import add_prior, gather, prior_cost
from hc_estimator.multiple_model.rows import (
    LARGEST_EXPONENT,
    LARGEST_LOG_STIFFNESS,
    LARGEST_VELOCITY_EXPONENT,
    SMALLEST_EXPONENT,
    SMALLEST_VELOCITY_EXPONENT,
    guess_of,
    is_held,
)

STEPS = 8  # at most
SOFT = 4.0  # ln K below its negative has another limit of ln B
FIRST_DAMPING = 1e-3
LARGEST_DAMPING = 1e6
SMALLEST_GAIN = 1e-3  # relative decrease of the cost at which the fit is done


@compiled
def solve(factor: Any, vector: Any, size: int) -> None:
    """Replace b by the solution x of L L^T x = b, the leading `size` elements of both."""
    for i in range(size):
        for j in range(i):
            vector[i] -= factor[i, j] * vector[j]
        vector[i] /= factor[i, i]
    for i in range(size - 1, -1, -1):
        for j in range(i + 1, size):
            vector[i] -= factor[j, i] * vector[j]
        vector[i] /= factor[i, i]


@compiled
def step(work: Any, values: Any, damping: float, size: int) -> bool:
    """Take a damped step from `values`; False if the information has no factor.

    Args:
        work: `information` and `slope` at the values; `next` takes where the step leads, `factor`
            that of the damped information.
        values: the unknowns.
        damping: added to the diagonal, as a share of it.
        size: number of unknowns in use.
    """
    damped, following = work.factor, work.next
    for i in range(size):
        following[i] = work.slope[i]
        for j in range(i):
            damped[i, j] = work.information[i, j]
        damped[i, i] = work.information[i, i] * (1.0 + damping)
    if not leading_cholesky(damped, damped, size):
        return False
    if is_definite(damped, size):
        solve(work.factor, following, size)
        for i in range(size):
            following[i] += values[i]
    else:  # no way is shown; with more damping one may be
        for i in range(size):
            following[i] = values[i]
    return True


@compiled
def limit(values: Any) -> None:
    """Keep ln K, ln B, n and p where the law means something."""
    least, most = -LARGEST_LOG_STIFFNESS, LARGEST_LOG_STIFFNESS
    values[0] = min(max(values[0], least), most)
    # Tissue that is softer than any that one presses with a finger has less damping as well.
    values[1] = min(max(values[1], least + min(values[0] + SOFT, 0.0)), most)
    values[2] = min(max(values[2], SMALLEST_EXPONENT), LARGEST_EXPONENT)
    values[3] = min(max(values[3], SMALLEST_VELOCITY_EXPONENT), LARGEST_VELOCITY_EXPONENT)


@compiled
def _put_back(settings: Any, values: Any) -> bool:
    """Put what is held fixed where it was given; True if it was elsewhere (B beside another K)."""
    moved = False
    for i in range(4):
        if is_held(settings, i):
            guess = guess_of(settings, i)
            moved = moved or values[i] != guess
            values[i] = guess
    return moved


@compiled
def improve(settings: Any, history: Any, weight: float, squares: float) -> float:
    """Levenberg-Marquardt from history.fit on.

    Args:
        settings: settings record.
        history: points; its fit, and all that belongs to one, is changed.
        weight: of the squares beside the prior.
        squares: what `gather` gave for history.fit, if it came last; NaN: it is to be called.

    Returns:
        Weighted sum of squares at its end; NaN if it broke down.
    """
    values, following = history.fit, history.next
    if _put_back(settings, values) or math.isnan(squares):
        squares = gather(settings, history, values)
    cost = weight * squares + prior_cost(settings, history, values)
    damping = FIRST_DAMPING
    add_prior(settings, history, values, weight)
    for _ in range(STEPS):
        if not step(history, values, damping, 4):
            return math.nan
        limit(following)
        squares_after = gather(settings, history, following)
        after = weight * squares_after + prior_cost(settings, history, following)
        if after < cost:
            gain = cost - after
            cost, squares = after, squares_after
            copy_vector(following, values)
            if gain < SMALLEST_GAIN * cost:
                break
            add_prior(settings, history, values, weight)
            damping *= 0.1
        else:
            damping *= 10.0
            if damping > LARGEST_DAMPING:
                break
    return float(squares)
