"""Least squares over what was felt: constant tissue once more, without a recursive filter's errors.

Twice a recursive filter needs it beside it. At the start its first steps are slow on purpose: as
long as it knows too little for its linearisation to hold, it counts samples as if they were noisy
(`tempering`). And with a contact law that does not fit it is drawn along by the latest misfit, and
pays for a tenth of a newton now with newtons in another depth or direction of motion. The fitted
row takes mean, covariance and, where the law does not fit, model error from the fit, and filters on
until the next one. Whether it is given out is for the judge to say.

Levenberg-Marquardt from the last fit; K, B / K and the exponents keep their prior, so that what the
samples do not show stays where it was. The covariance is that of the linearised law, made wide
enough for what the linearisation leaves out: with K and B only known as K + B v^p the cost is a
curved valley, in which a plain Gauss-Newton covariance is far too certain.
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.contact.registry import contact_gradient
from hc_estimator.linear_algebra import cholesky, copy_matrix, copy_vector
from hc_estimator.multiple_model import history as histories
from hc_estimator.multiple_model.hypotheses import LOG_STIFFNESS, STATES
from hc_estimator.multiple_model.kalman import force_of
from hc_estimator.multiple_model.model_error import SMALLEST_SHARE
from hc_estimator.multiple_model.records import POINTS
from hc_estimator.multiple_model.rows import (
    LARGEST_EXPONENT,
    LARGEST_VELOCITY_EXPONENT,
    SMALLEST_EXPONENT,
    SMALLEST_VELOCITY_EXPONENT,
    prior_deviation,
    seed,
)
from hc_estimator.specification import ParameterSpecification

SPECIFICATIONS = (
    ParameterSpecification(
        "fit_batches",
        "bool",
        True,
        "Hold a least-squares fit to the last ten seconds of contact beside the filters.",
        runtime=False,
    ),
)

PASSES = 5  # of Levenberg-Marquardt with other weights, at most
SETTLED = 1.1  # misfit that gave the weights over what is left, up to which they hold
STEPS = 8  # of Levenberg-Marquardt at most
FIRST_DAMPING = 1e-3
LARGEST_DAMPING = 1e6
SMALLEST_GAIN = 1e-3  # relative decrease of the cost at which the fit is done
FEWEST = 20  # remembered points that make a fit
SHARE = 1.0 / 16.0  # of the time in contact so far after which the fit is made anew
RAREST = 0.5  # time in contact after which it is made anew in any case [s]
# A fit that leaves more than this share of the RMS force says nothing (two tissues, relaxation),
# unless that is no more than the noise, given by a factor of its variance.
LARGEST_MISFIT = 0.2
SMALL_MISFIT = 4.0


@compiled
def update(settings: Any, bank: Any, row: Any, constant: Any, period: float, clock: float) -> None:
    """Take the newest point of the grid, and fit anew if it is time to.

    Args:
        settings: settings record.
        bank: what was felt and the fit to it are changed.
        row: the fitted row; takes the fit, or is switched off where there is none.
        constant: the filter's row, whose motion it takes and from whose parameters it begins.
        period: usual time between two samples [s].
        clock: contact clock [s].
    """
    history, finder = bank.history, bank.delay
    velocity_noise = _velocity_noise(finder, bank.sensor_noise[0])
    if not histories.learn(history, finder, bank.sensor_noise):
        return
    count = history.count - histories.oldest(history)
    due = min(SHARE * count * history.every, RAREST / finder.grid_step)
    if count < FEWEST or history.unfitted < due:
        return
    history.unfitted = 0
    if history.fitted == 0:
        for i in range(4):
            history.fit[i] = constant.state[LOG_STIFFNESS + i]
    share = period / (finder.grid_step * history.every)  # of a reading's variance
    force_noise = share * bank.sensor_noise[1]
    left = _fit(settings, history, force_noise, share * velocity_noise)
    if left < 0.0:
        row.active = 0
        history.fitted = 0
        return
    if row.active == 0:
        row.active = 1
        seed(constant, row, clock, 0.0)
        row.score = constant.score
        row.log_likelihood = constant.log_likelihood
    history.fitted = 1
    row.model_error = left if left > SMALLEST_SHARE * bank.sensor_noise[1] else 0.0
    for i in range(4):
        k = LOG_STIFFNESS + i
        row.state[k] = history.fit[i]
        for j in range(STATES):
            row.covariance[k, j] = 0.0
            row.covariance[j, k] = 0.0
    for i in range(4):
        for j in range(4):
            row.covariance[LOG_STIFFNESS + i, LOG_STIFFNESS + j] = history.covariance[i, j]


@compiled
def _velocity_noise(finder: Any, displacement_noise: float) -> float:
    """Variance of a parabola's slope [mm^2/s^2], times the number of readings in it."""
    half = 0.5 * max(finder.grid_width, 1e-9)
    return float(3.0 * displacement_noise / (half * half))


@compiled
def _fit(settings: Any, history: Any, force_noise: float, velocity_noise: float) -> float:
    """Fit the law; its covariance is found with it.

    Args:
        settings: settings record.
        history: points; the fit is changed.
        force_noise: variance of a point's force [N^2].
        velocity_noise: of its velocity [mm^2/s^2].

    Returns:
        Variance of the force that the law misses [N^2]; -1 if the fit says nothing.
    """
    count = history.count - histories.oldest(history)
    left, total = math.inf, 0.0
    for _ in range(PASSES):  # the weights are those of the law found before
        total = _weigh(settings, history, force_noise, velocity_noise)
        before = max(_squares(settings, history, history.fit) / count, 1.0)
        if not _improve(settings, history, 1.0 / min(before, 1e6)):
            return -1.0
        left = max(_squares(settings, history, history.fit) / count, 1.0)
        if before < SETTLED * left:  # else the samples counted for too little beside the prior
            break
    largest = LARGEST_MISFIT**2 * _mean_square_force(history)
    if not left < max(largest, SMALL_MISFIT):
        return -1.0
    _linearise(settings, history, 1.0 / left)
    if not _invert(settings, history) or not _widen(settings, history, 1.0 / left):
        return -1.0
    return float((left - 1.0) * total / count)


@compiled
def _weigh(settings: Any, history: Any, force_noise: float, velocity_noise: float) -> float:
    """Give each point its weight, for the motion is not known exactly either; summed variance."""
    total = 0.0
    for k in range(histories.oldest(history), history.count):
        point, gradient = history.points[k % POINTS], history.gradient
        _find_gradient(settings, history, point)
        variance = force_noise + gradient[1] * gradient[1] * velocity_noise
        total += variance
        point[3] = 1.0 / variance
    return total


@compiled
def _squares(settings: Any, history: Any, values: Any) -> float:
    """Weighted sum of the squared residuals of ln K, ln B, n, p over all samples."""
    total = 0.0
    for k in range(histories.oldest(history), history.count):
        point = history.points[k % POINTS]
        force = force_of(settings, point[0], point[1], values[0], values[1], values[2], values[3])
        total += point[3] * (force - point[2]) ** 2
    return total


@compiled
def _mean_square_force(history: Any) -> float:
    """Weighted mean squared force of all samples."""
    total = 0.0
    for k in range(histories.oldest(history), history.count):
        total += history.points[k % POINTS, 3] * history.points[k % POINTS, 2] ** 2
    return float(total / max(history.count - histories.oldest(history), 1))


@compiled
def _improve(settings: Any, history: Any, weight: float) -> bool:
    """Levenberg-Marquardt from history.fit on; False if it broke down."""
    values, following = history.fit, history.next
    cost = _cost(settings, history, values, weight)
    damping = FIRST_DAMPING
    _linearise(settings, history, weight)
    for _ in range(STEPS):
        copy_matrix(history.information, history.damped)
        copy_vector(history.slope, following)
        for i in range(4):
            history.damped[i, i] *= 1.0 + damping
        if not cholesky(history.damped, history.factor):
            return False
        _solve(history.factor, following)
        for i in range(4):
            following[i] += values[i]
        following[2] = min(max(following[2], SMALLEST_EXPONENT), LARGEST_EXPONENT)
        following[3] = min(max(following[3], SMALLEST_VELOCITY_EXPONENT), LARGEST_VELOCITY_EXPONENT)
        after = _cost(settings, history, following, weight)
        if after < cost:
            gain = cost - after
            cost = after
            copy_vector(following, values)
            if gain < SMALLEST_GAIN * cost:
                break
            _linearise(settings, history, weight)
            damping *= 0.1
        else:
            damping *= 10.0
            if damping > LARGEST_DAMPING:
                break
    return math.isfinite(cost)


@compiled
def _prior_off(settings: Any, values: Any, i: int) -> float:
    """Distance of ln K, ln (B / K), n or p from its first guess, in deviations; 0 if held fixed."""
    deviation = prior_deviation(settings, i)
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
def _cost(settings: Any, history: Any, values: Any, weight: float) -> float:
    """Weighted squared residuals and squared distance from the prior."""
    total = weight * _squares(settings, history, values)
    for i in range(4):
        total += _prior_off(settings, values, i) ** 2
    return total


@compiled
def _find_gradient(settings: Any, history: Any, point: Any) -> None:
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
def _linearise(settings: Any, history: Any, weight: float) -> None:
    """Normal equations of `_cost` at history.fit."""
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
        _find_gradient(settings, history, point)
        for i in range(4):
            share = weight * point[3] * gradient[2 + i]
            slope[i] += share * residual
            for j in range(i + 1):
                information[i, j] += share * gradient[2 + j]
    for i in range(4):
        deviation = prior_deviation(settings, i)
        if deviation <= 0.0:
            information[i, i] = 1.0
            continue
        off = _prior_off(settings, values, i) / deviation
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


@compiled
def _invert(settings: Any, history: Any) -> bool:
    """Inverse of the information, in history.covariance; zero for what is held fixed."""
    if not cholesky(history.information, history.factor):
        return False
    column = history.next
    for i in range(4):
        for j in range(4):
            column[j] = 1.0 if i == j else 0.0
        _solve(history.factor, column)
        for j in range(i + 1):
            fixed = prior_deviation(settings, i) <= 0.0 or prior_deviation(settings, j) <= 0.0
            element = 0.0 if fixed else column[j]
            history.covariance[i, j] = element
            history.covariance[j, i] = element
    return True


@compiled
def _widen(settings: Any, history: Any, weight: float) -> bool:
    """Add to the covariance how far what is nonlinear in the law can have moved the fit.

    Along each column of a Cholesky factor of the covariance the force of every sample curves away
    from its tangent. Least squares over those curvatures is the way that the fit would take.
    """
    factor, values, gradient = history.factor, history.next, history.gradient
    moved = history.information
    copy_matrix(history.covariance, history.damped)
    for i in range(4):
        if prior_deviation(settings, i) <= 0.0:
            history.damped[i, i] = 1.0
    if not cholesky(history.damped, factor):
        return False
    for i in range(4):
        for j in range(4):
            moved[i, j] = 0.0
    fit = history.fit
    for k in range(histories.oldest(history), history.count):
        point = history.points[k % POINTS]
        centre = force_of(settings, point[0], point[1], fit[0], fit[1], fit[2], fit[3])
        _find_gradient(settings, history, point)
        for j in range(4):
            if prior_deviation(settings, j) <= 0.0:
                continue
            second = -2.0 * centre
            for sign in (-1.0, 1.0):
                for i in range(4):
                    values[i] = fit[i] + (sign * factor[i, j] if i >= j else 0.0)
                second += force_of(
                    settings, point[0], point[1], values[0], values[1], values[2], values[3]
                )
            for i in range(4):
                moved[i, j] += weight * point[3] * gradient[2 + i] * second
    copy_matrix(history.covariance, history.damped)
    for j in range(4):
        for i in range(4):
            total = 0.0
            for m in range(4):
                total += history.damped[i, m] * moved[m, j]
            values[i] = total
        for i in range(4):
            for m in range(4):
                history.covariance[i, m] += values[i] * values[m]
    return True
