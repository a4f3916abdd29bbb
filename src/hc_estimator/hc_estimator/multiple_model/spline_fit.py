"""Least squares over what was felt where tissue or surface do not stay, or the zeros are off.

The unknowns are those of `spline`. The splines cost what a rate of ln K that wanders makes likely,
with the wandering of the rows that follow a trend, and a surface that breathes.

A recursive row with the same unknowns takes its first tangents far from where they end, keeps what
they taught for certain, and never comes back; a fit takes them anew. (Ours; `hc bench accuracy
together`.)
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.linear_algebra import clear_vector
from hc_estimator.multiple_model import point_error
from hc_estimator.multiple_model.kalman import exp_limited
from hc_estimator.multiple_model.levenberg_marquardt import solve
from hc_estimator.multiple_model.local_polynomial import value_noise
from hc_estimator.multiple_model.normal_equations import law_at
from hc_estimator.multiple_model.records import POINTS
from hc_estimator.multiple_model.rows import LARGEST_EXPONENT, SMALLEST_EXPONENT
from hc_estimator.multiple_model.spline import (
    DELAY,
    EXPONENT,
    FORCE_ZERO,
    LOG_RATIO,
    POSITION,
    SPEED,
    VELOCITY_EXPONENT,
    has,
    locate,
    log_stiffness,
    relaxed,
    second,
)
from hc_estimator.multiple_model.spline_motion import motion_before, noise_left, place_of
from hc_estimator.multiple_model.spline_records import (
    BENDS,
    MEMORIES,
    MOVES,
    RELAXES,
    SPLINE_FIRST,
    VARIES,
)

CONSISTENT = 1.5  # largest squares left, in those of the noise, where the law fits
BEND_STEP = 0.1  # share of a step over which the second derivative is taken
MOST_BENT = 0.75  # of a step's length, up to which its bend is followed


@compiled
def _law_of(fit: Any, values: Any) -> tuple[float, float, float, float]:
    """K, B, n and p where `locate` was called for."""
    stiffness = exp_limited(log_stiffness(fit, values))
    damping = stiffness * math.exp(values[LOG_RATIO])
    n = values[EXPONENT]
    if has(fit, BENDS):
        n = min(max(second(fit, values)[0], SMALLEST_EXPONENT), LARGEST_EXPONENT)
    return stiffness, damping, n, values[VELOCITY_EXPONENT]


@compiled
def _motion_at(
    fit: Any, values: Any, time: float, tool: tuple[float, float, float]
) -> tuple[float, float]:
    """Depth and velocity of the tool within the tissue."""
    depth = tool[0] - values[POSITION] - values[SPEED] * (time - fit.latest)
    velocity = tool[1] - values[SPEED]
    if has(fit, BENDS):
        return depth, velocity
    value, rate = second(fit, values)
    return depth - value, velocity - rate


@compiled
def _law_at(
    settings: Any, fit: Any, values: Any, time: float, tool: tuple[float, float, float]
) -> float:
    """Force at the tool's depth and velocity [N], less the zero's; derivatives in fit.gradient."""
    stiffness, damping, n, p = _law_of(fit, values)
    depth, velocity = _motion_at(fit, values, time, tool)
    return law_at(settings, stiffness, damping, n, p, depth, velocity, fit.gradient)


@compiled
def _missed(
    settings: Any, history: Any, fit: Any, place: Any, tool: tuple[float, float, float]
) -> float:
    """Variance of a point's force that is no noise of the sensors [N^2]; fit.gradient is lost."""
    gradient, law = fit.gradient, _law_of(fit, fit.values)
    depth, velocity = _motion_at(fit, fit.values, place.time, tool)
    deviation = history.velocity_std[place.source]
    rest = point_error.of_rest(settings, law, depth, velocity, deviation, gradient)
    half = history.half_width
    return rest + point_error.of_corner(settings, law, depth, velocity, half, gradient)


@compiled
def weigh(settings: Any, history: Any, fit: Any, noise: tuple[float, float, float]) -> None:
    """Give each point its weight by the law at fit.values: the motion is not exact either.

    What overlapping parabolas leave is larger than what a point adds to the information: how large
    the weighted squares are where only noise is left is noted in fit.expected.

    Args:
        settings: settings record.
        history: its points are changed.
        fit: record of the fit.
        noise: of the points; see `history.noise_of_points`.
    """
    gradient = fit.gradient
    expected, averaged, log_missed = 0.0, 0.0, 0.0
    for k in range(fit.first, fit.last):
        number = place_of(history, fit, k)
        if number < 0:
            continue
        point, place = history.points[k % POINTS], history.points[number % POINTS]
        locate(fit, place.time)
        tool = motion_before(history, fit, number, fit.values[DELAY])
        _law_at(settings, fit, fit.values, place.time, tool)
        variance = noise[1] + gradient[0] * gradient[0] * noise[0]
        drag, source = gradient[1] * gradient[1], place.source
        variance += drag * history.velocity_noise[source]
        of_motion = gradient[0] * gradient[0] * value_noise(place.degree) * noise[2] * noise[0]
        of_motion += drag * history.velocity_std[source] ** 2
        taken = 1.0 - noise_left(history, fit, number, fit.values[DELAY])
        missed = _missed(settings, history, fit, place, tool)
        point.weight = 1.0 / (variance + missed)
        log_missed += noise[2] * math.log1p(missed / variance)
        of_force = value_noise(point.degree) * noise[2] * noise[1]
        expected += point.weight * (of_force + missed + of_motion * (1.0 - taken))
        averaged += point.weight * of_motion * taken
    fit.log_missed = log_missed
    fit.expected = expected + log_missed
    fit.averaged = averaged


@compiled
def gather(settings: Any, history: Any, fit: Any, values: Any) -> float:
    """Normal equations of the points at `values`, in fit.seen and fit.pull; their squares."""
    seen, pull, slopes, places = fit.seen, fit.pull, fit.slopes, fit.places
    for i in range(fit.unknowns):
        pull[i] = 0.0
        for j in range(i + 1):
            seen[i, j] = 0.0
    total = float(fit.log_missed)
    count = 0
    for k in range(fit.first, fit.last):
        number = place_of(history, fit, k)
        if number < 0:
            continue
        point, place = history.points[k % POINTS], history.points[number % POINTS]
        used = locate(fit, place.time)
        residual = _tangent(settings, history, fit, values, point, number)
        count += 1
        total += point.weight * residual * residual
        for i in range(used):
            row = places[i]
            share = point.weight * slopes[i]
            pull[row] += share * residual
            for j in range(i + 1):
                seen[row, places[j]] += share * slopes[j]
    fit.count = count
    return total


@compiled
def _residual(
    settings: Any, history: Any, fit: Any, values: Any, point: Any, number: int
) -> tuple[float, float, float]:
    """Force of a point less the law's [N]; velocity and acceleration of the tool.

    Args:
        settings: settings record.
        history: points.
        fit: `locate` was called for the place; the law's derivatives are noted in its gradient.
        values: of the unknowns.
        point: whose force it is.
        number: of the point whose place it is.
    """
    time = history.points[number % POINTS].time
    tool = motion_before(history, fit, number, values[DELAY])
    force = _law_at(settings, fit, values, time, tool) - relaxed(fit, values, point)
    return point.force - values[FORCE_ZERO] - force, tool[1], tool[2]


@compiled
def _tangent(settings: Any, history: Any, fit: Any, values: Any, point: Any, number: int) -> float:
    """Force of a point less the law's, and the law's derivatives in fit.slopes; as `_residual`."""
    residual, velocity, acceleration = _residual(settings, history, fit, values, point, number)
    gradient, slopes, time = fit.gradient, fit.slopes, history.points[number % POINTS].time
    slopes[LOG_RATIO] = gradient[3]
    slopes[EXPONENT] = gradient[4]
    slopes[VELOCITY_EXPONENT] = gradient[5]
    slopes[POSITION] = -gradient[0]
    slopes[FORCE_ZERO] = 1.0
    slopes[DELAY] = -gradient[0] * velocity - gradient[1] * acceleration
    slopes[SPEED] = -gradient[0] * (time - fit.latest) - gradient[1]
    _note_splines(fit, point)
    return residual


@compiled
def follow_bend(settings: Any, history: Any, fit: Any, values: Any) -> None:
    """Correct the step from `values` to fit.next by how the force bends along it.

    K, n, damping and a surface that moves make up for one another along a valley that is curved,
    where a tangent's step is much too long or a thousand too short. (Geodesic acceleration:
    Transtrum and Sethna, Improvements to the Levenberg-Marquardt algorithm, arXiv:1201.5885, 2012,
    equation 14, with the second derivative by their equation 17.)
    """
    ahead, pull, following, slopes, places = fit.ahead, fit.pull, fit.next, fit.slopes, fit.places
    for i in range(fit.unknowns):
        ahead[i] = values[i] + BEND_STEP * (following[i] - values[i])
        pull[i] = 0.0
    for k in range(fit.first, fit.last):
        number = place_of(history, fit, k)
        if number < 0:
            continue
        point, place = history.points[k % POINTS], history.points[number % POINTS]
        used = locate(fit, place.time)
        further, _, _ = _residual(settings, history, fit, ahead, point, number)
        here = _tangent(settings, history, fit, values, point, number)
        along = 0.0
        for i in range(used):
            along += slopes[i] * (following[places[i]] - values[places[i]])
        bend = 2.0 / BEND_STEP * ((further - here) / BEND_STEP + along)
        for i in range(used):
            pull[places[i]] += point.weight * slopes[i] * bend
    for i in range(SPLINE_FIRST):
        if fit.fixed[i] != 0:
            pull[i] = 0.0
    solve(fit.factor, pull, fit.unknowns)
    bent, straight = 0.0, 0.0
    for i in range(fit.unknowns):
        way = following[i] - values[i]
        straight += fit.information[i, i] * way * way
        bent += fit.information[i, i] * 0.25 * pull[i] * pull[i]
    if not bent < MOST_BENT**2 * straight:  # two terms of the series are not enough
        clear_vector(pull)
        return
    for i in range(fit.unknowns):
        following[i] += 0.5 * pull[i]


@compiled
def _note_splines(fit: Any, point: Any) -> None:
    """Derivatives of the force by the coefficients, by fit.gradient."""
    slopes, gradient, first = fit.slopes, fit.gradient, SPLINE_FIRST + 1
    by_stiffness = gradient[2] + gradient[3]
    slopes[SPLINE_FIRST] = by_stiffness
    if has(fit, VARIES):
        first = SPLINE_FIRST + 4
        for i in range(4):
            slopes[SPLINE_FIRST + i] = fit.basis[0, i] * by_stiffness
    if has(fit, MOVES):
        for i in range(4):
            by_position = fit.basis[1, i] * gradient[0]
            slopes[first + i] = -by_position - fit.basis_rate[1, i] * gradient[1]
    if has(fit, BENDS):
        for i in range(4):
            slopes[first + i] = fit.basis[1, i] * gradient[4]
    if has(fit, RELAXES):
        for i in range(MEMORIES):
            slopes[first + i] = -point.memory[i]
