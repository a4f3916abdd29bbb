"""Which zeros do the points ask for? Costs of the choices, by the covariance of one fit with all.

What each choice of fewer unknowns would cost follows from that covariance. The choice with the
least cost and fewest unknowns wins, but all that explains the points nearly as well stays unknown
with it (Occam's window; Madigan and Raftery, JASA 89, 1994). (Ours; see `zero_fit`.)
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.multiple_model.spline import FORCE_ZERO
from hc_estimator.multiple_model.zero_records import (
    ALL,
    BOTH,
    NONE,
    OF_DELAY,
    OF_FORCE,
    OF_POSITION,
)

SIGNIFICANT = 8.0  # decrease of the weighted squares beyond that
PENALTY = 9.0  # of the same, that another unknown must be worth: three deviations
BETTER_BY = 16.0  # decrease by which one choice is better than another
FINER = 0.5  # of the deviation that zeros in use leave to ln K, at which they are found anew
WANDERS = 4.0  # square of a change by which zeros of the same choice have become others


@compiled
def choose(settings: Any, zeros: Any, zeros_possible: int, sinks: bool) -> int:
    """Which zeros the points ask for, counted from where they were given; NONE if they do without.

    Args:
        settings: settings record.
        zeros: fitted with all that may be unknown; the costs of the choices are set.
        zeros_possible: which may be off.
        sinks: True if the fit has a surface that sinks.
    """
    position, force = zeros.moved[0] + zeros.position, zeros.moved[1] + zeros.force
    possible = zeros_possible | (OF_DELAY if math.isnan(settings.channel_delay) else NONE)
    best = math.inf
    for choice in range(ALL + 1):
        zeros.cost[choice] = math.inf
        if choice | possible == possible:
            # Of a surface that sinks the position is always unknown.
            free = choice | OF_POSITION if sinks else choice
            without = _cost_without(zeros, position, force, possible - (free & possible))
            zeros.cost[choice] = without + PENALTY * number_of(choice)
        best = min(best, zeros.cost[choice])
    if not zeros.cost[NONE] > best + SIGNIFICANT:
        return NONE
    together, fewest = NONE, 3
    for choice in range(1, ALL + 1):
        if zeros.cost[choice] == best:
            fewest = number_of(choice)
    for choice in range(1, ALL + 1):
        if number_of(choice) <= fewest and not zeros.cost[choice] > best + BETTER_BY:
            together |= choice
    together &= BOTH
    if sinks and together != NONE:
        return BOTH if together & OF_FORCE != 0 else NONE
    return together


@compiled
def speaks_against(zeros: Any, possible: int) -> bool:
    """True if the points would rather have the zeros as they were given than those in use.

    That they show less of what showed the zeros in use before is no reason to give those up.
    """
    position, force = zeros.moved[0] + zeros.position, zeros.moved[1] + zeros.force
    as_given = _cost_without(zeros, position, force, possible)
    in_use = _cost_without(zeros, zeros.position, zeros.force, possible)
    return bool(in_use > as_given + SIGNIFICANT)


@compiled
def cost_of_air(fit: Any) -> float:
    """Squares that a fit leaves of what the force reads in the air."""
    off = (fit.values[FORCE_ZERO] - fit.air_zero) / fit.air_zero_deviation
    return float(off * off)


@compiled
def number_of(choice: int) -> int:
    """Number of unknowns in a choice."""
    return (choice & 1) + (choice >> 1 & 1) + (choice >> 2 & 1)


@compiled
def _cost_without(zeros: Any, position: float, force: float, choice: int) -> float:
    """By how much the squares would grow with the unknowns of a choice at zero.

    b' C^-1 b for their values b and their covariance C, by elimination.
    """
    total = 0.0
    a = zeros.covariance
    c00, c11, c22 = a[0, 0], a[1, 1], a[2, 2]
    c01, c02, c12 = a[0, 1], a[0, 2], a[1, 2]
    first, second, third = position, force, zeros.delay
    if choice & OF_POSITION != 0:
        total += first * first / c00
        second -= c01 / c00 * first
        third -= c02 / c00 * first
        c11 -= c01 * c01 / c00
        c12 -= c01 * c02 / c00
        c22 -= c02 * c02 / c00
    if choice & OF_FORCE != 0:
        total += second * second / c11
        third -= c12 / c11 * second
        c22 -= c12 * c12 / c11
    if choice & OF_DELAY != 0:
        total += third * third / c22
    return total if math.isfinite(total) else math.inf


@compiled
def wanders(zeros: Any, unknown: int, sinks: bool) -> bool:
    """True if more points say something else, as of a law that does not hold all along the way."""
    if unknown == NONE:
        return False
    if sinks:  # its position goes on
        unknown = OF_FORCE
    position, force = zeros.position - zeros.begun[0], zeros.force - zeros.begun[1]
    square = square_of(zeros.begun_covariance, unknown, position, force)
    return bool(square > WANDERS * number_of(unknown))


@compiled
def is_worth_it(zeros: Any, unknown: int, sinks: bool) -> bool:
    """True if zeros are to move to those of the fit."""
    if unknown != zeros.unknown:
        return True
    if unknown == NONE:
        return False
    square = square_of(zeros.covariance, unknown, zeros.position, zeros.force)
    if square > SIGNIFICANT + PENALTY * number_of(unknown):
        return True
    if sinks:
        return False
    return bool(math.sqrt(zeros.doubt_of_fit[0, 0]) < FINER * zeros.deviation)


@compiled
def square_of(covariance: Any, unknown: int, position: float, force: float) -> float:
    """Square of differences of the unknown zeros, in a covariance of contact position and force."""
    a, b, c = covariance[0, 0], covariance[0, 1], covariance[1, 1]
    if unknown == OF_POSITION:
        return float(position * position / a)
    if unknown == OF_FORCE:
        return float(force * force / c)
    square = c * position * position - 2.0 * b * position * force + a * force * force
    return float(square / (a * c - b * b))
