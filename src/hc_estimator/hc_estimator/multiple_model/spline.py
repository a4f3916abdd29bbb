"""Tissue and surface over time in a least-squares fit: what is unknown, and which splines.

ln K is a cubic spline over time with a knot every quarter of a second, or one number. Beside it n
may be a spline with half as many knots, or the surface, which otherwise stays or sinks at a steady
speed. Or the tissue relaxes: the force that it has felt, low-passed over times from 0.05 to 5 s,
takes shares of the force away (quasi-linear viscoelasticity: Fung, Biomechanics, 1993, 7.6, solved
for the elastic response). ln (B / K), p, contact position, force zero and a small delay are the
same all along.
(Penalised splines: O'Sullivan, Statistical Science 1, 1986; their use here is ours, `hc bench
accuracy together`.)
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.multiple_model.records import POINTS
from hc_estimator.multiple_model.spline_records import (
    BENDS,
    MEMORIES,
    MOVES,
    RELAXES,
    SECOND_SPLINE,
    SINKS,
    SPLINE,
    SPLINE_FIRST,
    STEADY,
    VARIES,
)

# Of the unknowns; the coefficients of ln K come after them, and then those of surface or exponent.
LOG_RATIO, EXPONENT, VELOCITY_EXPONENT, POSITION, FORCE_ZERO, DELAY, SPEED = range(SPLINE_FIRST)
DELAY_DEVIATION = 0.002  # of the delay about the one in use [s]
SURFACE_DEVIATION = 1.0  # of the mean of a surface that moves about the zero [mm]
KNOT = 0.25  # time between two knots of the stiffness [s]
SECOND_KNOT = 0.5  # of surface or exponent [s]
LONGEST_TIME = SECOND_KNOT * (SECOND_SPLINE - 3)  # over which knots are no further apart [s]
STRETCHED = 1.5  # factor on both up to which the points may lie apart


@compiled
def has(fit: Any, what: int) -> bool:
    """True if something does not stay in this fit."""
    return bool(fit.kind & what != 0)


@compiled
def first_in_reach(history: Any, first: int, last: int) -> int:
    """Number of the first point from `first` on over which knots are close enough.

    Over a longer time they would be too far apart for a surface that breathes.
    """
    begun = history.points[(last - 1) % POINTS].time - LONGEST_TIME
    while first < last - 1 and history.points[first % POINTS].time < begun:
        first += 1
    return first


@compiled
def lay_out(history: Any, fit: Any, first: int, last: int, kind: int) -> bool:
    """Lay the knots over the points from `first` to before `last`; False if too far apart.

    Args:
        history: points.
        fit: record of the fit; knots, size and what the kind holds are set.
        first: number of the first point.
        last: number of the point after the last.
        kind: what does not stay.
    """
    start = history.points[first % POINTS].time
    fit.latest = history.points[(last - 1) % POINTS].time
    fit.first = first
    fit.last = last
    fit.begin = start
    span = fit.latest - start
    fit.kind = kind
    fit.held[SPEED] = 0 if has(fit, SINKS) else 1
    if has(fit, MOVES):
        fit.held[POSITION] = 1  # the spline has it
    if has(fit, BENDS):
        fit.held[EXPONENT] = 1
    fit.intervals[0] = 0
    fit.intervals[1] = 0
    knots = (math.inf if has(fit, STEADY) else KNOT, SECOND_KNOT)
    if has(fit, VARIES):
        fit.intervals[0] = _intervals(span, knots[0], SPLINE)
    if has(fit, MOVES + BENDS):
        fit.intervals[1] = _intervals(span, knots[1], SECOND_SPLINE)
    fit.unknowns = SPLINE_FIRST + stiffness_count(fit) + second_count(fit)
    for i in range(2):
        fit.knot[i] = span / max(fit.intervals[i], 1)
        longest = STRETCHED * knots[i]
        if fit.intervals[i] > 0 and not (fit.knot[i] > 0.0 and fit.knot[i] <= longest):
            return False
    return True


@compiled
def lay_out_at_zeros(
    settings: Any, history: Any, fit: Any, first: int, last: int, kind: int
) -> bool:
    """Lay out with the zeros as they are and the rest unknown; as `lay_out`."""
    free_all(settings, fit)
    fit.held[FORCE_ZERO] = 1
    fit.position_deviation = SURFACE_DEVIATION
    if kind & SINKS == 0:
        fit.held[POSITION] = 1
    return lay_out(history, fit, first, last, kind)


@compiled
def _intervals(span: float, knot: float, most: int) -> int:
    """Number of intervals between knots over a time [s]."""
    return min(max(math.ceil(span / knot), 1), most - 3)


@compiled
def free_all(settings: Any, fit: Any) -> None:
    """Everything is unknown but a delay that is given, and any contact position is as likely."""
    for i in range(SPLINE_FIRST):
        fit.held[i] = 0
    fit.held[DELAY] = 0 if math.isnan(settings.channel_delay) else 1
    fit.position_deviation = math.inf
    fit.air_zero = 0.0
    fit.air_zero_deviation = math.inf
    fit.delay_deviation = DELAY_DEVIATION
    fit.shift = 0
    fit.spacing = 0.0


@compiled
def stiffness_count(fit: Any) -> int:
    """Number of coefficients of ln K."""
    return fit.intervals[0] + 3 if has(fit, VARIES) else 1


@compiled
def second_count(fit: Any) -> int:
    """Number of coefficients of surface or exponent, or shares of the memories."""
    if has(fit, RELAXES):
        return MEMORIES
    return fit.intervals[1] + 3 if has(fit, MOVES + BENDS) else 0


@compiled
def locate(fit: Any, time: float) -> int:
    """Note the splines that are not zero at a time, and their places among the unknowns.

    Returns:
        Number of unknowns on which a force depends there.
    """
    places = fit.places
    for i in range(SPLINE_FIRST + 1):
        places[i] = i
    used = SPLINE_FIRST + 1
    if has(fit, VARIES):
        interval = _locate_in(fit, 0, time)
        for i in range(4):
            places[SPLINE_FIRST + i] = SPLINE_FIRST + interval + i
        used = SPLINE_FIRST + 4
    if has(fit, MOVES + BENDS):
        interval = _locate_in(fit, 1, time)
        for i in range(4):
            places[used + i] = SPLINE_FIRST + stiffness_count(fit) + interval + i
        used += 4
    if has(fit, RELAXES):
        for i in range(MEMORIES):
            places[used + i] = SPLINE_FIRST + stiffness_count(fit) + i
        used += MEMORIES
    return used


@compiled
def _locate_in(fit: Any, which: int, time: float) -> int:
    """Note the values and derivatives of one spline's four bases at a time; the first's number."""
    basis, rate, knot = fit.basis[which], fit.basis_rate[which], fit.knot[which]
    place = (time - fit.begin) / knot
    interval = min(max(int(place), 0), fit.intervals[which] - 1)
    s = place - interval
    r = 1.0 - s
    basis[0] = r * r * r / 6.0
    basis[1] = (3.0 * s * s * s - 6.0 * s * s + 4.0) / 6.0
    basis[2] = (3.0 * r * r * r - 6.0 * r * r + 4.0) / 6.0
    basis[3] = s * s * s / 6.0
    rate[0] = -r * r / (2.0 * knot)
    rate[1] = (3.0 * s * s - 4.0 * s) / (2.0 * knot)
    rate[2] = -(3.0 * r * r - 4.0 * r) / (2.0 * knot)
    rate[3] = s * s / (2.0 * knot)
    return int(interval)


@compiled
def log_stiffness(fit: Any, values: Any) -> float:
    """Give ln K where `locate` was called last."""
    if not has(fit, VARIES):
        return values[SPLINE_FIRST]  # type: ignore[no-any-return]
    total = 0.0
    for i in range(4):
        total += fit.basis[0, i] * values[fit.places[SPLINE_FIRST + i]]
    return total


@compiled
def second(fit: Any, values: Any) -> tuple[float, float]:
    """Value and rate of the surface or exponent where `locate` was called last; else zeros."""
    value, rate = 0.0, 0.0
    if has(fit, MOVES + BENDS):
        first = SPLINE_FIRST + (4 if has(fit, VARIES) else 1)
        for i in range(4):
            value += fit.basis[1, i] * values[fit.places[first + i]]
            rate += fit.basis_rate[1, i] * values[fit.places[first + i]]
    return value, rate


@compiled
def relaxed(fit: Any, values: Any, point: Any) -> float:
    """What a tissue that relaxes has let go of the force of a point [N]; else zero."""
    total = 0.0
    if has(fit, RELAXES):
        first = SPLINE_FIRST + stiffness_count(fit)
        for i in range(MEMORIES):
            total += values[first + i] * point.memory[i]
    return total


@compiled
def share_released(history: Any, fit: Any) -> float:
    """What the tissue has let go of, over the force that is left, by a fit in which it relaxes."""
    released, left = 0.0, 0.0
    for k in range(fit.first, fit.last):
        point = history.points[k % POINTS]
        released += relaxed(fit, fit.values, point)
        left += point.force
    return released / left if left > 0.0 else 0.0
