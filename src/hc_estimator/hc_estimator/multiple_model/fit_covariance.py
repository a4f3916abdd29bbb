"""What is known after a fit: its covariance, without what only looks like knowledge.

The covariance is that of the linearised law, made wide enough for what the linearisation leaves
out: with K and B only known as K + B v^p the cost is a curved valley, in which a plain Gauss-Newton
covariance is far too certain. And velocities that are nothing but noise seem to show what the force
does at other velocities: that much information is taken off again (errors in variables; Fuller,
Measurement Error Models, 1987). The widening is ours.
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.linear_algebra import cholesky, clear_matrix, copy_matrix, eigen
from hc_estimator.multiple_model import history as histories
from hc_estimator.multiple_model.kalman import exp_limited, force_of
from hc_estimator.multiple_model.levenberg_marquardt import solve
from hc_estimator.multiple_model.normal_equations import law_at
from hc_estimator.multiple_model.point_velocity import velocity_at
from hc_estimator.multiple_model.records import POINTS
from hc_estimator.multiple_model.rows import is_held, prior_deviation

LEAST_SHARE = 1e-6  # of the information that stays in any direction


@compiled
def invert(settings: Any, history: Any) -> bool:
    """Inverse of the information, in history.covariance; zero for what is held fixed."""
    if not cholesky(history.information, history.factor):
        return False
    column = history.next
    for i in range(4):
        for j in range(4):
            column[j] = 1.0 if i == j else 0.0
        solve(history.factor, column, 4)
        for j in range(i + 1):
            fixed = is_held(settings, i) or is_held(settings, j)
            element = 0.0 if fixed else column[j]
            history.covariance[i, j] = element
            history.covariance[j, i] = element
    return True


@compiled
def _factorise(settings: Any, history: Any) -> bool:
    """Factor of the covariance, with a variance of one for what is held fixed; False if none."""
    copy_matrix(history.covariance, history.damped)
    for i in range(4):
        if is_held(settings, i):
            history.damped[i, i] = 1.0
    return cholesky(history.damped, history.factor)


@compiled
def widen(settings: Any, history: Any, weight: float) -> bool:
    """Add to the covariance how far what is nonlinear in the law can have moved the fit.

    Along each column of a Cholesky factor of the covariance the force of every sample curves away
    from its tangent. Least squares over those curvatures is the way that the fit would take.
    """
    factor, values, gradient = history.factor, history.next, history.gradient
    moved = history.information
    if not _factorise(settings, history):
        return False
    clear_matrix(moved)
    fit = history.fit
    stiffness, damping = exp_limited(fit[0]), exp_limited(fit[1])
    for k in range(histories.oldest(history), history.count):
        point = history.points[k % POINTS]
        depth, velocity = point.depth, velocity_at(history, point)
        centre = law_at(settings, stiffness, damping, fit[2], fit[3], depth, velocity, gradient)
        for j in range(4):
            if is_held(settings, j):
                continue
            second = -2.0 * centre
            for sign in (-1.0, 1.0):
                for i in range(4):
                    values[i] = fit[i] + (sign * factor[i, j] if i >= j else 0.0)
                second += force_of(
                    settings, depth, velocity, values[0], values[1], values[2], values[3]
                )
            for i in range(4):
                if not is_held(settings, i):
                    moved[i, j] += weight * point.weight * gradient[2 + i] * second
    copy_matrix(history.covariance, history.damped)
    for j in range(4):
        for i in range(4):
            total = 0.0
            for m in range(4):
                total += history.damped[i, m] * moved[m, j]
            values[i] = total
        _limit_by_prior(settings, values)
        for i in range(4):
            for m in range(4):
                history.covariance[i, m] += values[i] * values[m]
    return True


@compiled
def _limit_by_prior(settings: Any, way: Any) -> None:
    """Bring a way in ln K, ln B, n, p down to the prior's deviations of ln K, ln (B / K), n, p."""
    joined = not (is_held(settings, 0) or is_held(settings, 1))
    if joined:
        way[1] -= way[0]
    for i in range(4):
        deviation = prior_deviation(settings, i)
        way[i] = min(max(way[i], -deviation), deviation)
    if joined:
        way[1] += way[0]


@compiled
def share_of_noise(history: Any, i: int, weight: float) -> float:
    """Share of noise of the velocity in what history.covariance claims to know of a parameter.

    Args:
        history: the points are gathered, and their information is inverted.
        i: parameter, 0 to 3.
        weight: of the fit's squares.
    """
    covariance, false = history.covariance, history.false
    total = 0.0
    for j in range(4):
        for k in range(4):
            total += covariance[j, i] * false[j, k] * covariance[k, i]
    return float(weight * total / max(covariance[i, i], 1e-300))


@compiled
def take_off_velocity_noise(settings: Any, history: Any, weight: float, independent: float) -> None:
    """Take history.false off the information whose inverse history.covariance is.

    Where that is all there is (one velocity, or none) the difference of the two is noise itself:
    two deviations more are taken off, and the prior stays.

    Args:
        settings: settings record.
        history: history.covariance is changed.
        weight: of the fit's squares.
        independent: number of points whose errors are independent of one another.
    """
    false, factor, way = history.false, history.factor, history.next
    # In coordinates in which all information, that of the prior included, is the unit matrix.
    if not _factorise(settings, history):
        return
    doubtful = 1.0 + 2.0 * math.sqrt(2.0 / max(independent, 2.0))
    shares = history.damped
    finite = True
    for i in range(4):
        for j in range(4):
            total = 0.0
            for k in range(i, 4):
                for m in range(j, 4):
                    total += factor[k, i] * false[k, m] * factor[m, j]
            shares[i, j] = doubtful * weight * total
            finite = finite and math.isfinite(total)
    if not finite:
        return
    direction = history.direction
    eigen(shares, direction)
    clear_matrix(history.covariance)
    for m in range(4):
        for i in range(4):
            way[i] = 0.0
            for j in range(i + 1):
                way[i] += factor[i, j] * direction[j, m]
        left = max(1.0 - shares[m, m], min(_prior_information(settings, way), 1.0), LEAST_SHARE)
        for i in range(4):
            for j in range(4):
                free = not (is_held(settings, i) or is_held(settings, j))
                history.covariance[i, j] += way[i] * way[j] / left if free else 0.0


@compiled
def _prior_information(settings: Any, way: Any) -> float:
    """Information of the prior along a change of ln K, ln B, n, p, times its square."""
    total = 0.0
    for i in range(4):
        deviation = prior_deviation(settings, i)
        if deviation > 0.0:
            off = way[1] - way[0] if i == 1 and not is_held(settings, 0) else way[i]
            total += (off / deviation) ** 2
    return total
