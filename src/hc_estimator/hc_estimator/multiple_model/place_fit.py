"""Least squares over the points of one contact: K, B, n, p, where it begins, a delay, and a rate.

With a prior that is normal in all of them, so that the evidence of a fit follows from two
determinants (MacKay, Neural Computation 4, 1992) and two priors can be compared by it
(`another_place`). The points are narrow parabolas, from the first force on, for a tap has no
others.
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.linear_algebra import (
    clear_matrix,
    clear_vector,
    copy_vector,
    is_definite,
    leading_cholesky,
)
from hc_estimator.multiple_model import point_error
from hc_estimator.multiple_model.kalman import exp_limited
from hc_estimator.multiple_model.levenberg_marquardt import (
    FIRST_DAMPING,
    LARGEST_DAMPING,
    SMALLEST_GAIN,
    limit,
    solve,
    step,
)
from hc_estimator.multiple_model.local_polynomial import value_noise
from hc_estimator.multiple_model.normal_equations import law_at
from hc_estimator.multiple_model.point_velocity import noise_of, velocity_at
from hc_estimator.multiple_model.records import POINTS
from hc_estimator.multiple_model.rows import is_held
from hc_estimator.multiple_model.spline_motion import place_of

# Of the unknowns ln K and ln B at the first point, n, p, contact position, delay, and the rate of
# ln K and ln B beneath a tool that moves along tissue that varies [1/s].
POSITION, DELAY, RATE = 4, 5, 6
UNKNOWNS = 7
MOST_STEPS = 20
BEFORE = 0.1  # of the points' way, before which the force is assumed to have begun


@compiled
def is_fixed(settings: Any, place: Any, i: int) -> bool:
    """True if an unknown is none."""
    if i == DELAY:
        return bool(place.late == 0)
    if i == RATE:
        return bool(place.square_rate == 0.0)
    if i == POSITION:
        return bool(settings.find_zeros == 0)
    return bool(is_held(settings, i))


@compiled
def _moved_at(place: Any, history: Any, k: int) -> int:
    """Number of the point whose motion belongs to a point's force; -1 if there is none.

    Not shifted, each has its own, also where no wide cubic is known: the parabola's will do.
    """
    return k if place.shift == 0 else place_of(history, place, k)


@compiled
def _factor_at(values: Any, i: int, gone: float) -> float:
    """K (0) or B (1) some time [s] after the first point."""
    return exp_limited(values[i] + gone * values[RATE])


@compiled
def _law(settings: Any, place: Any, values: Any, history: Any, point: Any) -> float:
    """Force of a point [N]; place.slopes are its derivatives by the unknowns."""
    slopes, gradient = place.slopes, place.gradient
    gone = point.time - place.begin
    stiffness, damping = _factor_at(values, 0, gone), _factor_at(values, 1, gone)
    velocity, acceleration = velocity_at(history, point), point.motion_acceleration
    velocity -= values[DELAY] * acceleration
    depth = (
        point.depth
        - values[POSITION]
        - values[DELAY] * (velocity + 0.5 * values[DELAY] * acceleration)
    )
    n, p = values[2], values[3]
    force = law_at(settings, stiffness, damping, n, p, depth, velocity, gradient)
    for i in range(4):
        slopes[i] = gradient[2 + i]
    slopes[POSITION] = -gradient[0]
    slopes[DELAY] = -gradient[0] * velocity - gradient[1] * acceleration
    slopes[RATE] = gone * (slopes[0] + slopes[1])
    return force


@compiled
def weigh(
    settings: Any,
    place: Any,
    history: Any,
    noise: tuple[float, float, float],
) -> None:
    """Give each point its weight by the law at place.values; as in `spline_fit.weigh`."""
    gradient, values = place.gradient, place.values
    place.expected = 0.0
    for k in range(place.first, place.last):
        point, moved = history.points[k % POINTS], _moved_at(place, history, k)
        if moved < 0:
            point.weight = 0.0
            continue
        motion = history.points[moved % POINTS]
        _law(settings, place, values, history, motion)
        variance = noise[1] + gradient[0] * gradient[0] * noise[0]
        drag = gradient[1] * gradient[1]
        own = value_noise(point.degree) * noise[1]
        own += value_noise(motion.degree) * gradient[0] * gradient[0] * noise[0]
        own = noise[2] * own + drag * history.velocity_std[noise_of(history, motion)] ** 2
        variance += drag * history.velocity_noise[noise_of(history, motion)]
        gone = motion.time - place.begin
        law = (_factor_at(values, 0, gone), _factor_at(values, 1, gone), values[2], values[3])
        velocity = velocity_at(history, motion) - values[DELAY] * motion.motion_acceleration
        depth = motion.depth - values[POSITION] - values[DELAY] * velocity
        deviation = history.velocity_std[noise_of(history, motion)]
        missed = point_error.of_rest(settings, law, depth, velocity, deviation, gradient)
        weight = 1.0 / (variance + missed)
        point.weight = weight
        place.expected += weight * (own + missed)


@compiled
def _gather(settings: Any, place: Any, history: Any, values: Any) -> float:
    """Normal equations of the points at `values`, in `seen` and `pull`; their squares."""
    seen, pull, slopes = place.seen, place.pull, place.slopes
    clear_vector(pull)
    clear_matrix(seen)
    total = 0.0
    for k in range(place.first, place.last):
        point, moved = history.points[k % POINTS], _moved_at(place, history, k)
        if moved < 0:
            continue
        motion = history.points[moved % POINTS]
        residual = point.force - _law(settings, place, values, history, motion)
        total += point.weight * residual * residual
        for i in range(UNKNOWNS):
            share = point.weight * slopes[i]
            pull[i] += share * residual
            for j in range(i + 1):
                seen[i, j] += share * slopes[j]
    return total


@compiled
def prior_cost(place: Any, values: Any) -> float:
    """Squared distance from the prior."""
    total, prior, guess = 0.0, place.prior, place.guess
    for i in range(UNKNOWNS):
        for j in range(UNKNOWNS):
            total += prior[i, j] * (values[i] - guess[i]) * (values[j] - guess[j])
    return total


@compiled
def _add_prior(settings: Any, place: Any, values: Any, weight: float) -> None:
    """Normal equations of the cost, from what was gathered at `values`, by a weight of it."""
    information, slope = place.information, place.slope
    for i in range(UNKNOWNS):
        slope[i] = weight * place.pull[i]
        for j in range(UNKNOWNS):
            information[i, j] = weight * place.seen[max(i, j), min(i, j)] + place.prior[i, j]
            slope[i] -= place.prior[i, j] * (values[j] - place.guess[j])
    for i in range(UNKNOWNS):
        if is_fixed(settings, place, i):
            slope[i] = 0.0
            for j in range(UNKNOWNS):
                information[i, j] = 0.0
                information[j, i] = 0.0
            information[i, i] = 1.0


@compiled
def _improve(settings: Any, place: Any, history: Any, weight: float) -> float:
    """Levenberg-Marquardt from place.values on; the points' squares, or NaN."""
    values, following = place.values, place.next
    squares = _gather(settings, place, history, values)
    cost = weight * squares + prior_cost(place, values)
    _add_prior(settings, place, values, weight)
    damping = FIRST_DAMPING
    for _ in range(MOST_STEPS):
        if not step(place, values, damping, UNKNOWNS):
            return math.nan
        limit(following)
        squares_after = _gather(settings, place, history, following)
        after = weight * squares_after + prior_cost(place, following)
        if after < cost:
            gain = cost - after
            cost, squares = after, squares_after
            copy_vector(following, values)
            _add_prior(settings, place, values, weight)
            if gain < SMALLEST_GAIN * cost:
                break
            damping *= 0.1
        else:
            damping *= 10.0
            if damping > LARGEST_DAMPING:
                break
    return float(squares)


@compiled
def _begin_of_force(place: Any, history: Any) -> float:
    """Where the force begins, next to where the points do [mm]."""
    lowest, highest = math.inf, -math.inf
    for k in range(place.first, place.last):
        depth = history.points[k % POINTS].depth
        lowest, highest = min(lowest, depth), max(highest, depth)
    return lowest - BEFORE * (highest - lowest)


@compiled
def begin(settings: Any, place: Any, history: Any) -> None:
    """Begin where the prior does, but at the height and with the stiffness that the force shows."""
    values = place.values
    place.begin = history.points[place.first % POINTS].time
    copy_vector(place.guess, values)
    if not is_fixed(settings, place, POSITION):
        values[POSITION] = min(0.0, _begin_of_force(place, history))
    by_law, squares = 0.0, 0.0
    for k in range(place.first, place.last):
        point = history.points[k % POINTS]
        force = _law(settings, place, values, history, point)
        by_law += force * point.force
        squares += force * force
    if by_law > 0.0 and not is_held(settings, 1):
        factor = math.log(by_law / squares)
        values[0] += factor
        values[1] += factor


@compiled
def fit(
    settings: Any,
    place: Any,
    history: Any,
    noise: tuple[float, float, float],
    weight: float,
    passes: int,
) -> float:
    """Fit from place.values on, with the prior place.prior about place.guess.

    Args:
        settings: settings record.
        place: `values` and `factor` are those of the fit at the end.
        history: points.
        noise: as `history.noise_of_points` has it.
        weight: of the points' squares beside the prior.
        passes: with other weights; 0 for those of the last fit.

    Returns:
        Weighted sum of squares; NaN if it broke down.
    """
    squares = math.nan
    place.begin = history.points[place.first % POINTS].time
    if is_fixed(settings, place, RATE):  # it may be left of a fit to tissue that varied
        place.values[RATE] = 0.0
    for _ in range(max(passes, 1)):
        if passes > 0:
            weigh(settings, place, history, noise)
        squares = _improve(settings, place, history, weight)
        if not math.isfinite(squares):
            return math.nan
    _gather(settings, place, history, place.values)
    _add_prior(settings, place, place.values, weight)
    if not leading_cholesky(place.information, place.factor, UNKNOWNS):
        return math.nan
    return squares if is_definite(place.factor, UNKNOWNS) else math.nan


@compiled
def log_evidence(
    settings: Any,
    place: Any,
    history: Any,
    squares: float,
    weight: float,
    share: float,
) -> float:
    """Laplace's logarithm of the evidence of a fit, up to what all priors share.

    Each fit is judged by the weights of its own law. Where the tissue damps, noise of the velocity
    is noise of the force; by the weights of a law that does not damp, points speak against any that
    does.

    Args:
        settings: settings record.
        place: the fit, with its prior and `factor`.
        history: its points, with their weights.
        squares: that `fit` gave.
        weight: of them.
        share: of a point in the information, over that in the squares; as in `fit`.
    """
    total = squares
    for k in range(place.first, place.last):
        total -= share * math.log(history.points[k % POINTS].weight)
    total = weight * total + prior_cost(place, place.values)
    work = place.seen
    for i in range(UNKNOWNS):
        total += 2.0 * math.log(place.factor[i, i])
        for j in range(UNKNOWNS):
            fixed = is_fixed(settings, place, i) or is_fixed(settings, place, j)
            work[i, j] = (1.0 if i == j else 0.0) if fixed else place.prior[i, j]
    if not leading_cholesky(work, work, UNKNOWNS):
        return -math.inf
    for i in range(UNKNOWNS):
        total -= 2.0 * math.log(max(work[i, i], 1e-300))
    return -0.5 * total


@compiled
def note_covariance(settings: Any, place: Any) -> None:
    """Covariance of the unknowns by the fit."""
    column = place.next
    for i in range(UNKNOWNS):
        clear_vector(column)
        if not is_fixed(settings, place, i):
            column[i] = 1.0
        solve(place.factor, column, UNKNOWNS)
        for j in range(i + 1):
            element = 0.0 if is_fixed(settings, place, j) else column[j]
            place.covariance[i, j] = element
            place.covariance[j, i] = element


@compiled
def carry(place: Any, history: Any, values: Any, covariance: Any) -> None:
    """Bring ln K and ln B of a fit, and their covariance, to its last point."""
    if place.square_rate == 0.0:
        return
    gone = history.points[(place.last - 1) % POINTS].time - place.begin
    for i in range(2):
        values[i] += gone * values[RATE]
        for j in range(UNKNOWNS):
            covariance[i, j] += gone * covariance[RATE, j]
        for j in range(UNKNOWNS):
            covariance[j, i] += gone * covariance[j, RATE]


@compiled
def invert(matrix: Any, place: Any) -> None:
    """Let the prior be the inverse of a covariance, which is positive; `factor` is overwritten."""
    prior, column = place.prior, place.next
    leading_cholesky(matrix, place.factor, UNKNOWNS)
    for i in range(UNKNOWNS):
        clear_vector(column)
        column[i] = 1.0
        solve(place.factor, column, UNKNOWNS)
        for j in range(UNKNOWNS):
            prior[j, i] = column[j]
