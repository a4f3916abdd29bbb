"""Cost of a fit of the contact law to what was felt, with a prior, and its normal equations.

The prior is on ln K, ln (B / K), n and p. What is held (`history.held`) stays at its first guess.
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.contact.registry import contact_gradient
from hc_estimator.multiple_model import history as histories
from hc_estimator.multiple_model.kalman import force_of
from hc_estimator.multiple_model.records import POINTS
from hc_estimator.multiple_model.rows import prior_deviation

HELD_SHARE = 1e-3  # of the prior's deviation that is left to what is held


@compiled
def find_gradient(settings: Any, history: Any, point: Any) -> None:
    """Derivative of the force after ln K, ln B, n, p at history.fit, in history.gradient[2:]."""
    fit, gradient = history.fit, history.gradient
    stiffness, damping = math.exp(fit[0]), math.exp(fit[1])
    model = settings.contact_model
    contact_gradient(model, point[0], point[1], stiffness, damping, fit[2], fit[3], gradient)
    gradient[2] *= stiffness
    gradient[3] *= damping
    for i in range(4):
        if prior_deviation(settings, i) <= 0.0:  # held fixed
            gradient[2 + i] = 0.0


@compiled
def squares(settings: Any, history: Any, values: Any) -> float:
    """Weighted sum of the squared residuals of ln K, ln B, n, p over all samples.

    What noise of the velocity adds to it on average is taken off: it grows with the damping, so
    that a fit would call every damping too small (errors in variables; corrected least squares,
    Nakamura, Biometrika 77, 1990).
    """
    k, b, n, p = values[0], values[1], values[2], values[3]
    spread = history.velocity_std
    total = 0.0
    for i in range(histories.oldest(history), history.count):
        point = history.points[i % POINTS]
        force = force_of(settings, point[0], point[1], k, b, n, p)
        total += point[3] * (force - point[2]) ** 2
        if spread > 0.0:
            above = force_of(settings, point[0], point[1] + spread, k, b, n, p)
            below = force_of(settings, point[0], point[1] - spread, k, b, n, p)
            total -= point[3] * (0.5 * (above - below)) ** 2
    return total


@compiled
def deviation_in(settings: Any, history: Any, i: int) -> float:
    """Deviation of ln K, ln (B / K), n or p about its first guess; 0 for what is no unknown."""
    share = HELD_SHARE if history.held[i] != 0 else 1.0
    return share * prior_deviation(settings, i)


@compiled
def prior_off(settings: Any, history: Any, values: Any, i: int) -> float:
    """Distance of ln K, ln (B / K), n or p from its first guess, in deviations; 0 if no unknown."""
    deviation = deviation_in(settings, history, i)
    if deviation == 0.0 or (i == 1 and prior_deviation(settings, 0) == 0.0):
        return 0.0
    if i == 0:
        off = values[0] - math.log(settings.initial_stiffness)
    elif i == 1:
        guess = math.log(settings.initial_damping / settings.initial_stiffness)
        off = values[1] - values[0] - guess
    elif i == 2:
        off = values[2] - settings.initial_displacement_exponent
    else:
        off = values[3] - settings.initial_velocity_exponent
    return off / deviation  # type: ignore[no-any-return]


@compiled
def cost_of(settings: Any, history: Any, values: Any, weight: float) -> float:
    """Weighted squared residuals and squared distance from the prior."""
    total = weight * squares(settings, history, values)
    for i in range(4):
        total += prior_off(settings, history, values, i) ** 2
    return total


@compiled
def linearise(settings: Any, history: Any, weight: float) -> None:
    """Normal equations of `cost_of` at history.fit."""
    information, slope, gradient = history.information, history.slope, history.gradient
    values = history.fit
    for i in range(4):
        slope[i] = 0.0
        for j in range(4):
            information[i, j] = 0.0
    for k in range(histories.oldest(history), history.count):
        point = history.points[k % POINTS]
        force = force_of(settings, point[0], point[1], values[0], values[1], values[2], values[3])
        residual = point[2] - force
        find_gradient(settings, history, point)
        for i in range(4):
            share = weight * point[3] * gradient[2 + i]
            slope[i] += share * residual
            for j in range(i + 1):
                information[i, j] += share * gradient[2 + j]
        if history.velocity_std > 0.0:
            _correct_slope(settings, history, point, weight)
    for i in range(4):
        deviation = deviation_in(settings, history, i)
        if deviation <= 0.0:
            information[i, i] = 1.0
            continue
        off = prior_off(settings, history, values, i) / deviation
        square = 1.0 / (deviation * deviation)
        slope[i] -= off
        information[i, i] += square
        if i == 1 and prior_deviation(settings, 0) > 0.0:
            slope[0] += off
            information[0, 0] += square
            information[1, 0] -= square
    for i in range(4):
        for j in range(i):
            information[j, i] = information[i, j]


@compiled
def _correct_slope(settings: Any, history: Any, point: Any, weight: float) -> None:
    """Derivative of what `squares` takes off for a point; history.next is overwritten."""
    shifted, gradient, fit = history.next, history.gradient, history.fit
    for side in (-1.0, 1.0):
        for other in (-1.0, 1.0):
            shifted[0] = point[0]
            shifted[1] = point[1] + other * history.velocity_std
            force = force_of(settings, shifted[0], shifted[1], fit[0], fit[1], fit[2], fit[3])
            shifted[1] = point[1] + side * history.velocity_std
            find_gradient(settings, history, shifted)
            for i in range(4):
                history.slope[i] += (
                    0.25 * weight * point[3] * side * other * force * gradient[2 + i]
                )


@compiled
def solve(factor: Any, vector: Any) -> None:
    """Replace b by the solution x of L L^T x = b."""
    for i in range(4):
        for j in range(i):
            vector[i] -= factor[i, j] * vector[j]
        vector[i] /= factor[i, i]
    for i in range(3, -1, -1):
        for j in range(i + 1, 4):
            vector[i] -= factor[j, i] * vector[j]
        vector[i] /= factor[i, i]
