"""Where a fit in which the surface moves begins: near the valley that it has to follow.

With the law turned round, F = K (d - s)^n is F^(1/n) = K^(1/n) (d - s): of two points that are next
to one another the surface is the same, and their difference gives K; then every point gives the
surface. From the parameters of a row far off, Levenberg-Marquardt ends anywhere: on an organ
that breathes, two presses are enough for this start, and no ten for that (ours; `hc bench accuracy
together`). Of all other kinds the row in charge gives the start.
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.linear_algebra import clear_vector
from hc_estimator.multiple_model.hypotheses import LOG_STIFFNESS, OWN, SURFACE
from hc_estimator.multiple_model.records import POINTS
from hc_estimator.multiple_model.spline import (
    EXPONENT,
    FORCE_ZERO,
    LOG_RATIO,
    POSITION,
    SPEED,
    VELOCITY_EXPONENT,
    has,
    stiffness_count,
)
from hc_estimator.multiple_model.spline_records import BENDS, MOVES, SINKS, SPLINE_FIRST

NEIGHBOURS = 0.1  # time between two points within which the surface stays [s]


@compiled
def begin(settings: Any, history: Any, fit: Any, row: Any) -> None:
    """Set fit.values of a fit that is laid out.

    Args:
        settings: settings record.
        history: points.
        fit: changed.
        row: in charge.
    """
    _begin_with_row(fit, row)
    if has(fit, MOVES + SINKS):
        _begin_with_surface(settings, history, fit)


@compiled
def _begin_with_row(fit: Any, row: Any) -> None:
    """Begin with the parameters of a row, no force zero, and the surface where the row has it."""
    values, state = fit.values, row.state
    clear_vector(values)
    fit.level = state[LOG_STIFFNESS]
    values[LOG_RATIO] = state[LOG_STIFFNESS + 1] - state[LOG_STIFFNESS]
    values[EXPONENT] = state[LOG_STIFFNESS + 2]
    values[VELOCITY_EXPONENT] = state[LOG_STIFFNESS + 3]
    between = SPLINE_FIRST + stiffness_count(fit)
    for i in range(SPLINE_FIRST, between):
        values[i] = fit.level
    if has(fit, BENDS):
        for i in range(between, fit.unknowns):
            values[i] = values[EXPONENT]
    if not SURFACE[row.index]:
        return
    if fit.held[POSITION] == 0:
        values[POSITION] = state[OWN]
    elif has(fit, MOVES):
        for i in range(between, fit.unknowns):
            values[i] = state[OWN]


@compiled
def _begin_with_surface(settings: Any, history: Any, fit: Any) -> None:
    """Begin with the first guess of n, and K and surface by the law turned round, if they show."""
    values, n = fit.values, settings.initial_displacement_exponent
    slope = _slope(history, fit, n)
    if not slope > 0.0:
        return
    values[EXPONENT] = n
    values[VELOCITY_EXPONENT] = settings.initial_velocity_exponent
    values[LOG_RATIO] = math.log(settings.initial_damping / settings.initial_stiffness)
    fit.level = n * math.log(slope)
    between = SPLINE_FIRST + stiffness_count(fit)
    for i in range(SPLINE_FIRST, between):
        values[i] = fit.level
    if has(fit, SINKS):
        _lay_line(history, fit, n, slope)
        return
    k = fit.first
    for i in range(between, fit.unknowns):
        # A cubic spline is near its coefficient in the middle of that one's four intervals.
        time = fit.begin + (i - between - 1) * fit.knot[1]
        while k < fit.last - 1 and history.points[(k + 1) % POINTS].time < time:
            k += 1
        values[i] = _surface_at(history, fit, n, slope, k, time)


@compiled
def _root(fit: Any, point: Any, n: float) -> float:
    """F^(1/n) of a point."""
    return max(point.force - fit.values[FORCE_ZERO], 0.0) ** (1.0 / n)  # type: ignore[no-any-return]


@compiled
def _slope(history: Any, fit: Any, n: float) -> float:
    """K^(1/n) by the differences of points that are next to one another; 0 where there are none."""
    product, square = 0.0, 0.0
    for k in range(fit.first, fit.last - 1):
        here, there = history.points[k % POINTS], history.points[(k + 1) % POINTS]
        if there.time - here.time < NEIGHBOURS:
            way = there.depth - here.depth
            product += way * (_root(fit, there, n) - _root(fit, here, n))
            square += way * way
    return product / square if square > 0.0 else 0.0


@compiled
def _surface_at(history: Any, fit: Any, n: float, slope: float, k: int, time: float) -> float:
    """Surface [mm] at a time [s] between the points k and k + 1, or at the nearest."""
    here, there = history.points[k % POINTS], history.points[min(k + 1, fit.last - 1) % POINTS]
    span = there.time - here.time
    share = min(max((time - here.time) / span, 0.0), 1.0) if span > 0.0 else 0.0
    before = here.depth - _root(fit, here, n) / slope
    after = there.depth - _root(fit, there, n) / slope
    return before + share * (after - before)  # type: ignore[no-any-return]


@compiled
def _lay_line(history: Any, fit: Any, n: float, slope: float) -> None:
    """Position and speed of a surface that sinks, by least squares."""
    count, time_sum, place_sum, square, product = 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(fit.first, fit.last):
        point = history.points[k % POINTS]
        time, place = point.time - fit.latest, point.depth - _root(fit, point, n) / slope
        count += 1.0
        time_sum += time
        place_sum += place
        square += time * time
        product += time * place
    determinant = count * square - time_sum * time_sum
    if fit.held[POSITION] == 0 and determinant > 0.0:
        fit.values[SPEED] = (count * product - time_sum * place_sum) / determinant
        fit.values[POSITION] = (place_sum - fit.values[SPEED] * time_sum) / count
