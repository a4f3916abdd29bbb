"""Least squares over what was felt where the tissue does not stay, with zeros as unknowns.

ln K is a cubic spline over time with a knot every half second, or one number beneath a surface that
sinks at a steady speed; ln (B / K), n, p, contact position, force zero and a small delay are the
same all along. The spline costs what a rate of ln K that wanders makes likely (penalised splines;
O'Sullivan, Statistical Science 1, 1986), with the wandering of the rows that follow a trend.

A recursive row with the same unknowns takes its first tangents far from where they end, keeps what
they taught for certain, and never comes back; a fit takes them anew. (Ours; `hc bench accuracy
together`, zeros off.)
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.linear_algebra import (
    cholesky,
    clear_matrix,
    clear_vector,
    copy_matrix,
    copy_vector,
)
from hc_estimator.multiple_model.history import UNKNOWN
from hc_estimator.multiple_model.hypotheses import OWN_WALKS, TREND_ROW
from hc_estimator.multiple_model.levenberg_marquardt import (
    FIRST_DAMPING,
    LARGEST_DAMPING,
    SMALLEST_GAIN,
    STEPS,
    step,
)
from hc_estimator.multiple_model.normal_equations import exp_limited, law_at
from hc_estimator.multiple_model.records import POINTS
from hc_estimator.multiple_model.rows import (
    LARGEST_EXPONENT,
    LARGEST_LOG_RATIO,
    LARGEST_VELOCITY_EXPONENT,
    SMALLEST_EXPONENT,
    SMALLEST_LOG_RATIO,
    SMALLEST_VELOCITY_EXPONENT,
    prior_deviation,
)
from hc_estimator.multiple_model.zero_records import SPLINE, SPLINE_FIRST

# Of the unknowns; the coefficients of the spline come after them.
LOG_RATIO, EXPONENT, VELOCITY_EXPONENT, POSITION, FORCE_ZERO, DELAY, SPEED = range(SPLINE_FIRST)
# What the tissue does: nothing, nothing on a surface that sinks, or the stiffness varies.
STAYS, SINKS, VARIES = range(3)
KNOT = 0.5  # time between two knots [s]
LONGEST_KNOT = 0.75  # the same where there was no contact in between [s]
DELAY_DEVIATION = 0.002  # of the delay about the one in use [s]
SPEED_DEVIATION = 0.1  # of a surface that sinks [mm/s]
LEVEL_DEVIATION = 10.0  # of a coefficient: any stiffness is as likely
PASSES = 3  # with other weights
# Variance of a second difference of the coefficients by that of the rate's wandering and the third
# power of the time between knots.
SECOND_DIFFERENCE = 2.0 / 3.0


@compiled
def lay_out(history: Any, zeros: Any, first: int, kind: int) -> bool:
    """Lay the knots over the points from `first` on; False if they are too far apart.

    Args:
        history: points.
        zeros: record of the fit; begin, knot, intervals and what is held are set.
        first: number of the first point.
        kind: STAYS, SINKS or VARIES.
    """
    start = history.points[first % POINTS, 8]
    zeros.latest = history.points[(history.count - 1) % POINTS, 8]
    zeros.begin = start
    span = zeros.latest - start
    zeros.kind = kind
    zeros.held[SPEED] = 0 if kind == SINKS else 1
    if kind != VARIES:
        zeros.intervals = 0
        return True
    zeros.intervals = min(max(math.ceil(span / KNOT), 1), SPLINE - 3)
    zeros.knot = span / zeros.intervals
    return bool(zeros.knot <= LONGEST_KNOT and zeros.knot > 0.0)


@compiled
def coefficients(zeros: Any) -> int:
    """Number of the spline's coefficients in use."""
    return zeros.intervals + 3 if zeros.intervals > 0 else 1


@compiled
def locate(zeros: Any, time: float) -> int:
    """Note the four splines that are not zero at a time in zeros.basis; give the first's number."""
    basis = zeros.basis
    if zeros.intervals == 0:
        basis[0] = 1.0
        for i in range(1, 4):
            basis[i] = 0.0
        return 0
    place = (time - zeros.begin) / zeros.knot
    interval = min(max(int(place), 0), zeros.intervals - 1)
    s = place - interval
    r = 1.0 - s
    basis[0] = r * r * r / 6.0
    basis[1] = (3.0 * s * s * s - 6.0 * s * s + 4.0) / 6.0
    basis[2] = (3.0 * r * r * r - 6.0 * r * r + 4.0) / 6.0
    basis[3] = s * s * s / 6.0
    return int(interval)


@compiled
def log_stiffness(zeros: Any, values: Any, first: int) -> float:
    """Give ln K where `locate` was called last."""
    total = 0.0
    for i in range(4 if zeros.intervals > 0 else 1):
        total += zeros.basis[i] * values[SPLINE_FIRST + first + i]
    return total


@compiled
def _law_at(settings: Any, zeros: Any, values: Any, point: Any, first: int) -> float:
    """Force of a point [N], less the zero's; its derivatives are in zeros.gradient."""
    stiffness = exp_limited(log_stiffness(zeros, values, first))
    damping = stiffness * math.exp(values[LOG_RATIO])
    velocity, acceleration = point[5], point[6]
    ago = point[8] - zeros.latest
    depth = point[0] - values[POSITION] - values[SPEED] * ago - values[DELAY] * velocity
    velocity -= values[SPEED] + values[DELAY] * acceleration
    n, p = values[EXPONENT], values[VELOCITY_EXPONENT]
    return law_at(settings, stiffness, damping, n, p, depth, velocity, zeros.gradient)


@compiled
def weigh(
    settings: Any,
    history: Any,
    zeros: Any,
    first: int,
    noise: tuple[float, float],
    scatter: float,
) -> None:
    """Give each point its weight by the law at zeros.values: the motion is not exact either.

    What overlapping parabolas leave is larger than what a point adds to the information: how large
    the weighted squares are where only noise is left is noted in zeros.expected.

    Args:
        settings: settings record.
        history: its points are changed.
        zeros: record of the fit.
        first: number of the first point.
        noise: variances of a point's displacement [mm^2] and force [N^2], each by the point's share
            in the information.
        scatter: variance of what is left of a point's readings over `noise`.
    """
    gradient = zeros.gradient
    expected = 0.0
    for k in range(first, history.count):
        point = history.points[k % POINTS]
        if point[7] == UNKNOWN:
            continue
        _law_at(settings, zeros, zeros.values, point, locate(zeros, point[8]))
        variance = noise[1] + gradient[0] * gradient[0] * noise[0]
        drag, cubic = gradient[1] * gradient[1], int(point[7])
        point[3] = 1.0 / (variance + drag * history.velocity_noise[cubic])
        expected += point[3] * (scatter * variance + drag * history.velocity_std[cubic] ** 2)
    zeros.expected = expected


@compiled
def gather(settings: Any, history: Any, zeros: Any, values: Any, first: int) -> float:
    """Normal equations of the points at `values`, in zeros.seen and zeros.pull; their squares."""
    seen, pull, gradient, slopes = zeros.seen, zeros.pull, zeros.gradient, zeros.slopes
    clear_matrix(seen)
    clear_vector(pull)
    total = 0.0
    count = 0
    places = SPLINE_FIRST + (4 if zeros.intervals > 0 else 1)
    for k in range(first, history.count):
        point = history.points[k % POINTS]
        if point[7] == UNKNOWN:
            continue
        start = locate(zeros, point[8])
        force = _law_at(settings, zeros, values, point, start)
        residual = point[2] - values[FORCE_ZERO] - force
        count += 1
        total += point[3] * residual * residual
        slopes[LOG_RATIO] = gradient[3]
        slopes[EXPONENT] = gradient[4]
        slopes[VELOCITY_EXPONENT] = gradient[5]
        slopes[POSITION] = -gradient[0]
        slopes[FORCE_ZERO] = 1.0
        slopes[DELAY] = -gradient[0] * point[5] - gradient[1] * point[6]
        slopes[SPEED] = -gradient[0] * (point[8] - zeros.latest) - gradient[1]
        for i in range(SPLINE_FIRST, places):
            slopes[i] = zeros.basis[i - SPLINE_FIRST] * (gradient[2] + gradient[3])
        for i in range(places):
            row = i if i < SPLINE_FIRST else i + start
            share = point[3] * slopes[i]
            pull[row] += share * residual
            for j in range(i + 1):
                seen[row, j if j < SPLINE_FIRST else j + start] += share * slopes[j]
    zeros.count = count
    return total


@compiled
def _deviation(settings: Any, zeros: Any, i: int) -> float:
    """Prior deviation of an unknown; 0 for one that is held, infinite for one without."""
    if zeros.held[i] != 0:
        return 0.0
    if i <= VELOCITY_EXPONENT:
        return prior_deviation(settings, i + 1)
    if i == DELAY:
        return DELAY_DEVIATION
    if i == SPEED:
        return SPEED_DEVIATION
    return math.inf if i < SPLINE_FIRST else LEVEL_DEVIATION


@compiled
def _guess(settings: Any, zeros: Any, i: int) -> float:
    """First guess of an unknown."""
    if i == LOG_RATIO:
        return math.log(settings.initial_damping / settings.initial_stiffness)
    if i == EXPONENT:
        return settings.initial_displacement_exponent  # type: ignore[no-any-return]
    if i == VELOCITY_EXPONENT:
        return settings.initial_velocity_exponent  # type: ignore[no-any-return]
    return 0.0 if i < SPLINE_FIRST else float(zeros.level)


@compiled
def _roughness(zeros: Any) -> float:
    """Variance of a second difference of the coefficients."""
    return float(SECOND_DIFFERENCE * OWN_WALKS[TREND_ROW, 0] * zeros.knot**3)


@compiled
def _prior_cost(settings: Any, zeros: Any, values: Any) -> float:
    """Squared distance from the prior."""
    total, count = 0.0, coefficients(zeros)
    for i in range(SPLINE_FIRST + count):
        deviation = _deviation(settings, zeros, i)
        if deviation > 0.0 and deviation < math.inf:
            total += ((values[i] - _guess(settings, zeros, i)) / deviation) ** 2
    for i in range(SPLINE_FIRST, SPLINE_FIRST + count - 2):
        total += (values[i] - 2.0 * values[i + 1] + values[i + 2]) ** 2 / _roughness(zeros)
    return total


@compiled
def add_prior(settings: Any, zeros: Any, values: Any) -> None:
    """Normal equations of the cost, from what was gathered at `values`."""
    information, slope = zeros.information, zeros.slope
    count = SPLINE_FIRST + coefficients(zeros)
    copy_matrix(zeros.seen, information)
    copy_vector(zeros.pull, slope)
    for i in range(SPLINE_FIRST, count - 2):
        bend = (values[i] - 2.0 * values[i + 1] + values[i + 2]) / _roughness(zeros)
        for a in range(3):
            by_a = -2.0 if a == 1 else 1.0
            slope[i + a] -= by_a * bend
            for b in range(a + 1):
                by_b = -2.0 if b == 1 else 1.0
                information[i + a, i + b] += by_a * by_b / _roughness(zeros)
    for i in range(information.shape[0]):
        deviation = _deviation(settings, zeros, i) if i < count else 0.0
        if deviation == 0.0:
            slope[i] = 0.0
            for j in range(information.shape[0]):
                information[i, j] = 0.0
                information[j, i] = 0.0
            information[i, i] = 1.0
        elif deviation < math.inf:
            slope[i] -= (values[i] - _guess(settings, zeros, i)) / (deviation * deviation)
            information[i, i] += 1.0 / (deviation * deviation)


@compiled
def _limit(values: Any) -> None:
    """Keep ln (B / K), n and p where the law means something."""
    values[LOG_RATIO] = min(max(values[LOG_RATIO], SMALLEST_LOG_RATIO), LARGEST_LOG_RATIO)
    values[EXPONENT] = min(max(values[EXPONENT], SMALLEST_EXPONENT), LARGEST_EXPONENT)
    least, most = SMALLEST_VELOCITY_EXPONENT, LARGEST_VELOCITY_EXPONENT
    values[VELOCITY_EXPONENT] = min(max(values[VELOCITY_EXPONENT], least), most)


@compiled
def _improve(settings: Any, history: Any, zeros: Any, first: int) -> float:
    """Levenberg-Marquardt (SIAM J. 11, 1963) from zeros.values on; its squares, or NaN."""
    values, following = zeros.values, zeros.next
    squares = gather(settings, history, zeros, values, first)
    cost = squares + _prior_cost(settings, zeros, values)
    add_prior(settings, zeros, values)
    damping = FIRST_DAMPING
    for _ in range(STEPS):
        if not step(zeros, values, damping):
            return math.nan
        _limit(following)
        squares_after = gather(settings, history, zeros, following, first)
        after = squares_after + _prior_cost(settings, zeros, following)
        if after < cost:
            gain = cost - after
            cost, squares = after, squares_after
            copy_vector(following, values)
            if gain < SMALLEST_GAIN * cost:
                break
            add_prior(settings, zeros, values)
            damping *= 0.1
        else:
            damping *= 10.0
            if damping > LARGEST_DAMPING:
                break
    return float(squares)


@compiled
def fit(
    settings: Any,
    history: Any,
    zeros: Any,
    first: int,
    noise: tuple[float, float],
    scatter: float,
) -> float:
    """Fit from zeros.values on.

    Args:
        settings: settings record.
        history: points; their weights are changed.
        zeros: laid out; `values`, `information`, `count` and `expected` are those at the end.
        first: number of the first point.
        noise: as in `weigh`.
        scatter: as in `weigh`.

    Returns:
        Weighted sum of squares; NaN if it broke down.
    """
    before = math.inf
    for _ in range(PASSES):
        weigh(settings, history, zeros, first, noise, scatter)
        squares = _improve(settings, history, zeros, first)
        if not math.isfinite(squares):
            return math.nan
        if abs(before - squares) < 0.01 * squares:
            break
        before = squares
    squares = gather(settings, history, zeros, zeros.values, first)
    add_prior(settings, zeros, zeros.values)
    return squares if cholesky(zeros.information, zeros.factor) else math.nan


@compiled
def begin(zeros: Any, row: Any, first_parameter: int) -> None:
    """Begin with the parameters of a row, and no zeros."""
    values, state = zeros.values, row.state
    clear_vector(values)
    zeros.level = state[first_parameter]
    values[LOG_RATIO] = state[first_parameter + 1] - state[first_parameter]
    values[EXPONENT] = state[first_parameter + 2]
    values[VELOCITY_EXPONENT] = state[first_parameter + 3]
    for i in range(SPLINE_FIRST, values.shape[0]):
        values[i] = zeros.level
    _limit(values)
