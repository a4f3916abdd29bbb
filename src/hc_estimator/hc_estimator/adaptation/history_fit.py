"""Least squares over the remembered samples: ln K, ln B, n and p, and how well they are known.

Levenberg-Marquardt from the fit before on; one or two steps suffice then. K, B / K and the
exponents keep their prior, so that what the samples do not show stays where it was. The
covariance is that of the linearised law, made wide enough for what the linearisation leaves out:
with K and B only known as K + B v^p the cost is a curved valley, in which a plain Gauss-Newton
covariance is far too certain (`linearisation` does the same for the filter's own update).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hc_estimator.adaptation import history
from hc_estimator.compilation import compiled
from hc_estimator.contact.registry import contact_force, contact_gradient
from hc_estimator.linear_algebra import cholesky, clear_matrix, copy_matrix, copy_vector
from hc_estimator.state_space.kinematic import exponential

STEPS = 12  # Levenberg-Marquardt steps at most
FIRST_DAMPING = 1e-3
LARGEST_DAMPING = 1e6
SMALLEST_GAIN = 1e-3  # relative decrease of the cost at which the fit is done

FIELDS = (
    ("fit", np.float64, (4,)),  # ln K, ln B, n, p
    ("fit_count", np.int64, ()),  # history_count at the last fit
    ("leave_turns", np.int64, ()),  # 1 if samples of a turn are left out
    ("fit_misfit", np.float64, ()),  # mean square left by it [N^2]; 0: none that says anything
)
SCRATCH = (
    ("fit_next", np.float64, (4,)),
    ("fit_slope", np.float64, (4,)),
    ("fit_information", np.float64, (4, 4)),
    ("fit_damped", np.float64, (4, 4)),
    ("fit_factor", np.float64, (4, 4)),
    ("fit_covariance", np.float64, (4, 4)),
)


@compiled
def restart(memory: Any) -> None:
    """There is no fit."""
    memory.fit_count = 0
    memory.leave_turns = 0
    memory.fit_misfit = 0.0


@compiled
def _left_out(memory: Any, point: Any) -> bool:
    return memory.leave_turns != 0 and point[3] != 0.0  # type: ignore[no-any-return]


@compiled
def force(settings: Any, point: Any, values: Any) -> float:
    """Force [N] of ln K, ln B, n, p at a point that begins with displacement and velocity."""
    return contact_force(
        settings.contact_model,
        point[0],
        point[1],
        exponential(values[0]),
        exponential(values[1]),
        values[2],
        values[3],
    )


@compiled
def _squares(settings: Any, memory: Any, values: Any, first: int) -> tuple[float, int]:
    """Sum of the squared residuals [N^2] from the first sample on, and how many they are."""
    total, count = 0.0, 0
    for k in range(first, memory.history_count):
        point = memory.history[k % history.POINTS]
        if not _left_out(memory, point):
            total += (force(settings, point, values) - point[2]) ** 2
            count += 1
    return total, count


@compiled
def misfit(settings: Any, memory: Any, values: Any, first: int) -> float:
    """Mean squared residual [N^2] of ln K, ln B, n, p over the samples from the first on."""
    total, count = _squares(settings, memory, values, first)
    return total / max(count, 1)


@compiled
def mean_square_force(memory: Any, first: int) -> float:
    """Mean squared force reading [N^2] from the first sample on."""
    total, count = 0.0, 0
    for k in range(first, memory.history_count):
        point = memory.history[k % history.POINTS]
        if not _left_out(memory, point):
            total += point[2] ** 2
            count += 1
    return total / max(count, 1)


@compiled
def improve(settings: Any, memory: Any, weight: float) -> bool:
    """Levenberg-Marquardt from memory.fit on; False if it broke down."""
    values, following = memory.fit, memory.fit_next
    cost = _cost(settings, memory, values, weight)
    damping = FIRST_DAMPING
    _linearise(settings, memory, weight)
    for _ in range(STEPS):
        copy_matrix(memory.fit_information, memory.fit_damped)
        copy_vector(memory.fit_slope, following)
        for i in range(4):
            memory.fit_damped[i, i] *= 1.0 + damping
        if not cholesky(memory.fit_damped, memory.fit_factor):
            return False
        _solve(memory.fit_factor, following)
        for i in range(4):
            following[i] += values[i]
        following[2] = min(
            max(following[2], settings.smallest_displacement_exponent),
            settings.largest_displacement_exponent,
        )
        following[3] = min(
            max(following[3], settings.smallest_velocity_exponent),
            settings.largest_velocity_exponent,
        )
        after = _cost(settings, memory, following, weight)
        if after < cost:
            gain = cost - after
            cost = after
            copy_vector(following, values)
            if gain < SMALLEST_GAIN * cost:
                break
            _linearise(settings, memory, weight)
            damping *= 0.1
        else:
            damping *= 10.0
            if damping > LARGEST_DAMPING:
                break
    return math.isfinite(cost)


@compiled
def _invert(memory: Any) -> bool:
    """Inverse of fit_information, in fit_covariance; zero for what is held fixed."""
    if not cholesky(memory.fit_information, memory.fit_factor):
        return False
    prior, column = memory.prior_variance, memory.fit_next
    for i in range(4):
        for j in range(4):
            column[j] = 1.0 if i == j else 0.0
        _solve(memory.fit_factor, column)
        for j in range(i + 1):
            element = column[j] if prior[i] > 0.0 and prior[j] > 0.0 else 0.0
            memory.fit_covariance[i, j] = element
            memory.fit_covariance[j, i] = element
    return True


@compiled
def find_covariance(settings: Any, memory: Any, noise: float) -> bool:
    """Covariance of memory.fit, in fit_covariance; `noise` [N^2] is that of one sample."""
    _linearise(settings, memory, 1.0 / noise)
    return _invert(memory)


@compiled
def widen_covariance(settings: Any, memory: Any, noise: float) -> bool:
    """Add to fit_covariance how far what is nonlinear in the law can have moved the fit.

    Along each column of a Cholesky factor of the covariance the force of every sample curves away
    from its tangent. Least squares over those curvatures is the way that the fit would take.
    """
    factor, values, gradient = memory.fit_factor, memory.fit_next, memory.gradient
    moved, prior = memory.fit_information, memory.prior_variance
    copy_matrix(memory.fit_covariance, memory.fit_damped)
    for i in range(4):
        if prior[i] <= 0.0:  # held fixed
            memory.fit_damped[i, i] = 1.0
    if not cholesky(memory.fit_damped, factor):
        return False
    clear_matrix(moved)
    for k in range(history.oldest(memory), memory.history_count):
        point = memory.history[k % history.POINTS]
        if _left_out(memory, point):
            continue
        centre = force(settings, point, memory.fit)
        _find_gradient(settings, memory, point)
        for j in range(4):
            if prior[j] <= 0.0:
                continue
            second = -2.0 * centre
            for sign in (-1.0, 1.0):
                for i in range(4):
                    step = factor[i, j] if i >= j else 0.0
                    values[i] = memory.fit[i] + sign * step
                second += force(settings, point, values)
            for i in range(4):
                moved[i, j] += gradient[2 + i] * second / noise
    copy_matrix(memory.fit_covariance, memory.fit_damped)
    for j in range(4):
        for i in range(4):
            total = 0.0
            for m in range(4):
                total += memory.fit_damped[i, m] * moved[m, j]
            values[i] = total
        for i in range(4):
            for m in range(4):
                memory.fit_covariance[i, m] += values[i] * values[m]
    return True


@compiled
def _find_gradient(settings: Any, memory: Any, point: Any) -> None:
    """Derivative of the force after ln K, ln B, n, p at memory.fit, in memory.gradient[2:]."""
    gradient = memory.gradient
    stiffness, damping = exponential(memory.fit[0]), exponential(memory.fit[1])
    contact_gradient(
        settings.contact_model,
        point[0],
        point[1],
        stiffness,
        damping,
        memory.fit[2],
        memory.fit[3],
        gradient,
    )
    gradient[2] *= stiffness
    gradient[3] *= damping
    for i in range(4):
        if memory.prior_variance[i] <= 0.0:  # held fixed
            gradient[2 + i] = 0.0


@compiled
def _stiffness_off(settings: Any, values: Any) -> float:
    """Logarithm of K, from that of the first guess."""
    return values[0] - math.log(settings.initial_stiffness)  # type: ignore[no-any-return]


@compiled
def _damping_off(settings: Any, values: Any) -> float:
    """Logarithm of B / K, from that of the first guess."""
    guess = math.log(settings.initial_damping / settings.initial_stiffness)
    return values[1] - values[0] - guess  # type: ignore[no-any-return]


@compiled
def _cost(settings: Any, memory: Any, values: Any, weight: float) -> float:
    """Weighted squared residuals and squared distance from the prior."""
    first = history.oldest(memory)
    total = weight * _squares(settings, memory, values, first)[0]
    prior = memory.prior_variance
    if prior[0] > 0.0:
        total += _stiffness_off(settings, values) ** 2 / prior[0]
    if prior[0] > 0.0 and prior[1] > 0.0:
        total += _damping_off(settings, values) ** 2 / prior[1]
    if prior[2] > 0.0:
        total += (values[2] - settings.initial_displacement_exponent) ** 2 / prior[2]
    if prior[3] > 0.0:
        total += (values[3] - settings.initial_velocity_exponent) ** 2 / prior[3]
    return total


@compiled
def _linearise(settings: Any, memory: Any, weight: float) -> None:
    """Normal equations of `_cost` at memory.fit."""
    values, prior = memory.fit, memory.prior_variance
    information, slope, gradient = memory.fit_information, memory.fit_slope, memory.gradient
    for i in range(4):
        slope[i] = 0.0
        for j in range(4):
            information[i, j] = 0.0
    for k in range(history.oldest(memory), memory.history_count):
        point = memory.history[k % history.POINTS]
        if _left_out(memory, point):
            continue
        residual = point[2] - force(settings, point, values)
        _find_gradient(settings, memory, point)
        for i in range(4):
            slope[i] += weight * gradient[2 + i] * residual
            for j in range(i + 1):
                information[i, j] += weight * gradient[2 + i] * gradient[2 + j]
    if prior[0] > 0.0:
        slope[0] -= _stiffness_off(settings, values) / prior[0]
        information[0, 0] += 1.0 / prior[0]
    if prior[0] > 0.0 and prior[1] > 0.0:
        off = _damping_off(settings, values) / prior[1]
        slope[0] += off
        slope[1] -= off
        information[0, 0] += 1.0 / prior[1]
        information[1, 1] += 1.0 / prior[1]
        information[1, 0] -= 1.0 / prior[1]
    if prior[2] > 0.0:
        slope[2] += (settings.initial_displacement_exponent - values[2]) / prior[2]
        information[2, 2] += 1.0 / prior[2]
    if prior[3] > 0.0:
        slope[3] += (settings.initial_velocity_exponent - values[3]) / prior[3]
        information[3, 3] += 1.0 / prior[3]
    for i in range(4):
        if prior[i] <= 0.0:
            information[i, i] = 1.0
        for j in range(i):
            information[j, i] = information[i, j]


@compiled
def _solve(factor: Any, vector: Any) -> None:
    """Replace b by the solution x of L L^T x = b."""
    for i in range(4):
        for j in range(i):
            vector[i] -= factor[i, j] * vector[j]
        vector[i] /= factor[i, i]
    for i in range(3, -1, -1):
        for j in range(i + 1, 4):
            vector[i] -= factor[j, i] * vector[j]
        vector[i] /= factor[i, i]
