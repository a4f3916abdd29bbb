"""Least squares over what was felt: constant tissue once more, without a recursive filter's errors.

Twice a recursive filter needs it beside it. At the start its first steps are slow on purpose: as
long as it knows too little for its linearisation to hold, it counts samples as if they were noisy
(`tempering`). And with a contact law that does not fit it is drawn along by the latest misfit, and
pays for a tenth of a newton now with newtons in another depth or direction of motion. The fitted
row takes mean, covariance and, where the law does not fit, model error from the fit, and filters on
until the next one. Whether it is given out is for the judge to say.

Levenberg-Marquardt from the last fit; K, B / K and the exponents keep their prior, so that what the
samples do not show stays where it was. A fit beside the recursive rows is ours (`hc bench accuracy
ablation`, least squares over remembered points).
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.linear_algebra import clear_matrix, clear_vector, copy_matrix, copy_vector
from hc_estimator.multiple_model import (
    contradiction,
    delay_sensitivity,
    point_velocity,
    relinearisation,
    smoothing,
)
from hc_estimator.multiple_model import history as histories
from hc_estimator.multiple_model.fit_covariance import (
    invert,
    share_of_noise,
    take_off_velocity_noise,
    widen,
)
from hc_estimator.multiple_model.hypotheses import FITTED, LOG_STIFFNESS
from hc_estimator.multiple_model.levenberg_marquardt import improve
from hc_estimator.multiple_model.model_error import SMALLEST_SHARE
from hc_estimator.multiple_model.normal_equations import (
    add_prior,
    gather,
    weigh,
)
from hc_estimator.multiple_model.point_velocity import noise_of, velocity_at
from hc_estimator.multiple_model.records import POINTS
from hc_estimator.multiple_model.rows import cut, guess_of, is_held, seed

PASSES = 5  # of Levenberg-Marquardt with other weights, at most
SETTLED = 1.1  # misfit that gave the weights over what is left, up to which they hold
LARGEST_SHARE_OF_NOISE = 0.3  # in what the points say of B / K and p
FEWEST = 20  # remembered points that make a fit
SHARE = 1.0 / 16.0  # of the time in contact so far after which the fit is made anew
RAREST = 0.5  # time in contact after which it is made anew in any case [s]
# A fit that leaves more than this share of the RMS force says nothing (two tissues, relaxation),
# unless that is no more than the noise, given by a factor of its variance.
LARGEST_MISFIT = 0.2
SMALL_MISFIT = 4.0
# What a law that does not fit misses is a noise of the force as well, as large at any depth: by the
# weights of the sensors' noise alone the shallow and slow points would say what the deep ones do.
MISFITS = 2.0  # squares left, in those of the noise, from which on it is counted so
MISFIT_PASSES = 2


@compiled
def update(settings: Any, bank: Any) -> bool:
    """Take the newest point of the grid, and fit anew if it is time to.

    The fitted row takes the fit, or is switched off where there is none; its motion, and its first
    parameters, are those of the filter's row of constant tissue.

    Args:
        settings: settings record.
        bank: what was felt, the fit to it and the fitted row are changed.

    Returns:
        True if the points were fitted anew.
    """
    history, finder, constant, row = bank.history, bank.delay, bank.rows[0], bank.rows[FITTED]
    if not histories.learn(history, finder, bank.sensor_noise):
        return False
    count = history.count - histories.oldest(history)
    due = min(SHARE * count * history.every, RAREST / finder.grid_step)
    if count < FEWEST or history.unfitted < due:
        return False
    history.unfitted = 0
    if history.fitted == 0:
        for i in range(4):
            history.fit[i] = constant.state[LOG_STIFFNESS + i]
    depth_noise, force_noise = histories.noise_of_points(bank)[:2]
    independent = count * min(finder.grid_step * history.every / finder.grid_width, 1.0)
    point_velocity.take_noise(bank, independent)
    left = _fit(settings, history, depth_noise, force_noise, independent)
    if left < 0.0:
        row.active = 0
        _forget(history)
        histories.forget_older_half(history)
        constant.contradiction = 0.0
        return True
    if row.active == 0:
        row.active = 1
        # A copy of one that waits waits too.
        seed(constant, row, bank.tool.contact_clock, constant.counts_from)
        row.score = constant.score
        row.log_likelihood = constant.log_likelihood
    history.fitted = 1
    history.left = left if left > SMALLEST_SHARE * bank.sensor_noise[1] else 0.0
    give(history, constant, row)
    # A slow sensor's velocities miss more of a tremor than the row does.
    asked = smoothing.is_fine(finder)
    off = contradiction.of_damping(settings, history, constant) if asked else 0.0
    constant.contradiction = off
    if relinearisation.is_misled(settings, history, constant):
        give(history, constant, constant)
        constant.contradiction = 0.0
    return True


@compiled
def give(history: Any, constant: Any, row: Any) -> None:
    """Give a row the parameters of the last fit, and what that leaves as its model error.

    Args:
        history: fitted.
        constant: the filter's row of constant tissue, which depends on the delay alike.
        row: changed.
    """
    row.model_error = history.left
    delay_sensitivity.take(constant, row, LOG_STIFFNESS, LOG_STIFFNESS + 4)  # of the same data
    for i in range(4):
        k = LOG_STIFFNESS + i
        row.state[k] = history.fit[i]
        cut(row, k)
    for i in range(4):
        for j in range(4):
            row.covariance[LOG_STIFFNESS + i, LOG_STIFFNESS + j] = history.covariance[i, j]


@compiled
def _fit(
    settings: Any,
    history: Any,
    depth_noise: float,
    force_noise: float,
    independent: float,
) -> float:
    """Fit the law; its covariance is found with it.

    Args:
        settings: settings record.
        history: points; the fit is changed.
        depth_noise: variance of a point's depth by its share in the information [mm^2].
        force_noise: the same of its force [N^2].
        independent: number of points whose errors are independent of one another.

    Returns:
        Variance of the force that the law misses [N^2]; -1 if the fit says nothing.
    """
    count = history.count - histories.oldest(history)
    left, total = math.inf, 0.0
    for _ in range(PASSES):  # the weights are those of the law found before
        total = weigh(settings, history, depth_noise, force_noise)
        squares = gather(settings, history, history.fit)
        before = max(squares / count, 1.0)
        if not _hold(settings, history, 1.0 / before):
            return -1.0
        if history.held.max() != 0:
            squares = math.nan  # the fit has moved
        squares = improve(settings, history, 1.0 / min(before, 1e6), squares)
        if not math.isfinite(squares):
            return -1.0
        left = max(squares / count, 1.0)
        if before < SETTLED * left:  # else the samples counted for too little beside the prior
            break
    largest = LARGEST_MISFIT**2 * _mean_square_force(history)
    if not left < max(largest, SMALL_MISFIT):
        return -1.0
    missed = 0.0
    for _ in range(MISFIT_PASSES if left > MISFITS else 0):
        missed = max(missed + (left - 1.0) * total / count, 0.0)
        total = weigh(settings, history, depth_noise, force_noise + missed)
        squares = gather(settings, history, history.fit)
        squares = improve(settings, history, 1.0, squares)
        if not math.isfinite(squares):
            return -1.0
        left = squares / count
    left = max(left, 1.0)
    clear_vector(history.held)
    if not _is_gathered(history):
        gather(settings, history, history.fit)
    add_prior(settings, history, history.fit, 1.0 / left)
    if not invert(settings, history):
        return -1.0
    take_off_velocity_noise(settings, history, 1.0 / left, independent)
    if not widen(settings, history, 1.0 / left) or not _is_finite(history):
        return -1.0
    return float(missed + (left - 1.0) * total / count)


@compiled
def _is_finite(history: Any) -> bool:
    """False if the covariance is none."""
    for i in range(4):
        for j in range(4):
            if not math.isfinite(history.covariance[i, j]):
                return False
    return True


@compiled
def _forget(history: Any) -> None:
    """Keep nothing of a fit that failed: it need not have been numbers."""
    for vector in (history.gradient, history.above, history.below):
        clear_vector(vector)
    for vector in (history.fit, history.next, history.slope, history.pull):
        clear_vector(vector)
    for matrix in (history.information, history.damped, history.factor, history.seen):
        clear_matrix(matrix)
    clear_matrix(history.covariance)
    clear_matrix(history.false)
    history.fitted = 0


@compiled
def _hold(settings: Any, history: Any, weight: float) -> bool:
    """Hold p, and then B / K, at the first guess if it is mostly noise that would move it.

    At a single velocity the noise of that velocity is all that tells p from B and B from K, and a
    fit would follow it to the end of the valley along which K + B v^p is the same. There it says
    nothing any more, so that the first guess is asked as well.

    Args:
        settings: settings record.
        history: the points are gathered at the fit, and are so afterwards if nothing is held;
            what is held is moved to its first guess.
        weight: of the fit's squares.

    Returns:
        False if the points and the prior together do not determine the parameters.
    """
    clear_vector(history.held)
    damping, exponent = history.fit[1], history.fit[3]
    if _is_at_rest(history):
        history.held[1] = 1
        history.held[3] = 1
    seen, pull, false = history.seen.copy(), history.pull.copy(), history.false.copy()
    for place in range(2):
        if place == 1:
            if history.held[1] != 0 and history.held[3] != 0:
                break
            _take_first_guess(settings, history, 1)
            _take_first_guess(settings, history, 3)
            gather(settings, history, history.fit)
        for i in (3, 1, 3):  # p once more: with B / K held it is what noise would move
            if history.held[i] != 0:
                continue
            add_prior(settings, history, history.fit, weight)
            if not invert(settings, history):
                return False
            if share_of_noise(history, i, weight) > LARGEST_SHARE_OF_NOISE:
                history.held[i] = 1
    history.fit[1], history.fit[3] = damping, exponent
    for i in (1, 3):
        if history.held[i] != 0:
            _take_first_guess(settings, history, i)
    copy_matrix(seen, history.seen)
    copy_matrix(false, history.false)
    copy_vector(pull, history.pull)
    return True


@compiled
def _take_first_guess(settings: Any, history: Any, i: int) -> None:
    """Move ln B (1), with the ratio of B to K, or p (3) of the fit to its first guess."""
    if i == 1 and not is_held(settings, 1):
        ratio = settings.initial_damping / settings.initial_stiffness
        history.fit[1] = history.fit[0] + math.log(ratio)
    else:
        history.fit[i] = guess_of(settings, i)


@compiled
def _is_gathered(history: Any) -> bool:
    """True if `improve` gathered the points at the fit last."""
    gathered = True
    for i in range(4):
        gathered = gathered and history.next[i] == history.fit[i]
    return gathered


@compiled
def _is_at_rest(history: Any) -> bool:
    """True if too much of the velocities is noise for them to say anything, wherever B stands."""
    total, noise, first = 0.0, 0.0, histories.oldest(history)
    for k in range(first, history.count):
        total += velocity_at(history, history.points[k % POINTS]) ** 2
        noise += history.velocity_std[noise_of(history, history.points[k % POINTS])] ** 2
    return noise > LARGEST_SHARE_OF_NOISE * total


@compiled
def _mean_square_force(history: Any) -> float:
    """Weighted mean squared force of all samples."""
    total = 0.0
    for k in range(histories.oldest(history), history.count):
        total += history.points[k % POINTS].weight * history.points[k % POINTS].force ** 2
    return float(total / max(history.count - histories.oldest(history), 1))
