"""Do the points tell of a contact position or a zero of the force that is off?

Where the tool starts in contact no first touch shows the zeros (`contact_onset`). But a power law
begins at zero force and zero depth: one that has to begin elsewhere leaves what no K, B, n and p
explain. So does a force that is late. Least squares with contact position, force zero and delay as
further unknowns finds within seconds which of them it is, on tissue that stays, beneath a surface
that sinks, and where the stiffness varies (`spline_fit`; ours; `hc bench accuracy delay`: 0.6 mm of
3 mm makes K 50 % wrong; `together`: zeros off).

One fit has all three unknown; what each choice of fewer would cost follows from its covariance.
The choice with the least cost and fewest unknowns wins, but all that explains the points nearly as
well stays unknown with it (Occam's window; Madigan and Raftery, JASA 89, 1994): where nothing shows
which of two zeros it is, both are taken from the fit that has both. The choice is among zeros as
they were given, so that more points can take back what fewer seemed to show. What is left open of
the zeros in use goes with the estimate, by how much the K, B, n and p of the fit depend on them
(Schmidt 1966; `zero_doubt` gives it out).

A law that does not fit real tissue would find zeros as well that make it fit better. So zeros move
only where the law then fits to within the noise of the sensors: where no law does, nothing is
concluded.
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.linear_algebra import clear_matrix, copy_matrix, copy_vector
from hc_estimator.multiple_model import history as histories
from hc_estimator.multiple_model import spline, zero_sensitivity
from hc_estimator.multiple_model.hypotheses import LOG_STIFFNESS
from hc_estimator.multiple_model.records import POINTS
from hc_estimator.multiple_model.spline import SINKS, STAYS, VARIES
from hc_estimator.multiple_model.spline_fit import solve_least_squares
from hc_estimator.multiple_model.zero_records import (
    ALL,
    BOTH,
    NONE,
    OF_DELAY,
    OF_FORCE,
    OF_POSITION,
)
from hc_estimator.specification import ParameterSpecification

SPECIFICATIONS = (
    ParameterSpecification(
        "find_zeros",
        "bool",
        True,
        "Look for a contact position and a force zero that are off, where the motion shows them.",
    ),
)

SIGNIFICANT = 8.0  # decrease of the weighted squares beyond that
PENALTY = 9.0  # of the same, that another unknown must be worth: three deviations
BETTER_BY = 16.0  # decrease by which one choice is better than another
CONSISTENT = 1.5  # largest squares left, in those of the noise
REFUTED = 6.0  # the same, at which zeros that were found are taken back
EVERY = 1.0  # time in contact between two fits [s]
LEAST_TIME = 2.0  # that they must span [s]
LEAST_TIME_VARYING = 6.0  # the same where the tissue or the surface does not stay [s]
LASTING = 2.0  # time in contact for which a choice must stay the same [s]
WANDERS = 4.0  # square of a change by which zeros of the same choice have become others
FINER = 0.5  # of the deviation that zeros in use leave to ln K, at which they are found anew
LEAST_POSITION = 0.05  # [mm]
LEAST_ZERO = 0.005  # of the largest force
LARGEST_POSITION = 0.5  # of the largest depth
LARGEST_ZERO = 0.3  # of the largest force
LARGEST_DELAY = 0.005  # up to which the fit's tangents hold; a larger one is for `delay` [s]


@compiled
def reset(zeros: Any) -> None:
    """Neither zero was found to be off."""
    zeros.unknown = NONE
    zeros.candidate = NONE
    zeros.waiting = 0
    zeros.since = 0.0
    zeros.refuted_since = math.inf
    zeros.looked_at = -math.inf
    zeros.deviation = 0.0
    clear_matrix(zeros.doubt)


@compiled
def look(settings: Any, bank: Any, noise: tuple[float, float], scatter: float) -> bool:
    """Look for zeros that are off; True if onset.shift says by how much they are to move.

    Args:
        settings: settings record.
        bank: its records `zeros`, `fit` and `onset` are changed, and the weights of its points.
        noise: variances of a point's displacement [mm^2] and force [N^2] by its share in the
            information.
        scatter: variance of what is left of a point's readings over `noise`.
    """
    history, zeros, clock = bank.history, bank.zeros, bank.tool.contact_clock
    # A press in one direction leaves too much to K, B and n alone.
    if settings.find_zeros == 0 or bank.tool.retreated == 0:
        return False
    if clock - zeros.looked_at < EVERY:
        return False
    # A damping that is only a guess leaves what zeros would explain.
    if history.fitted != 0 and history.guessed != 0:
        return False
    first = max(history.count - POINTS, 0)
    if not histories.is_motion_known(history, first):
        return False
    zeros.looked_at = clock
    row = bank.rows[bank.judge.chosen]
    fit = bank.fit
    if not _fit_any(settings, history, zeros, fit, row, first, noise, scatter):
        zeros.waiting = 0
        return _review(bank, clock)
    zeros.refuted_since = math.inf
    zero_sensitivity.note_covariance(zeros, fit)
    in_use, sinks = bank.onset.zero, fit.kind == SINKS
    unknown = _choose(settings, zeros, in_use, sinks)
    zero_sensitivity.note_doubt(zeros, BOTH, zeros.doubt_of_fit)
    if unknown != BOTH and (unknown != NONE or zeros.unknown != NONE):
        copy_vector(zeros.fit, zeros.change)
        copy_matrix(zeros.doubt_of_fit, zeros.doubt_of_both)
        _hold_others(fit, unknown, in_use)
        if not _explains(settings, history, zeros, fit, noise, scatter):
            zeros.waiting = 0
            return False
        zero_sensitivity.note_covariance(zeros, fit)
        zero_sensitivity.note_doubt(zeros, unknown, zeros.doubt_of_fit)
        zero_sensitivity.average(zeros, unknown)
    if sinks and zeros.unknown != NONE:
        zeros.position = 0.0  # where the surface is by now is for the rows that follow it
    if not _is_worth_it(zeros, unknown, sinks) or not _is_possible(history, zeros, first):
        zeros.waiting = 0
    elif zeros.waiting == 0 or zeros.candidate != unknown or _wanders(zeros, unknown, sinks):
        zeros.waiting = 1
        zeros.candidate = unknown
        zeros.since = clock
        zeros.begun[0] = zeros.position
        zeros.begun[1] = zeros.force
        copy_matrix(zeros.covariance, zeros.begun_covariance)
    # Tissue that has just changed looks the same for as long as the change was not found.
    if zeros.waiting != 0 and clock - zeros.since >= LASTING:
        _use(bank.onset, zeros, unknown, sinks)
        return True
    if zeros.unknown != NONE and zeros.unknown == unknown:
        zero_sensitivity.keep_doubt(zeros)
    return False


@compiled
def _fit_any(
    settings: Any,
    history: Any,
    zeros: Any,
    fit: Any,
    row: Any,
    first: int,
    noise: tuple[float, float],
    scatter: float,
) -> bool:
    """Fit tissue that stays, on a surface that sinks, or that varies; False if none explains all.

    The smallest squares left over those of the noise are in zeros.misfit.
    """
    last = history.points[(history.count - 1) % POINTS, 8]
    span = last - history.points[first % POINTS, 8]
    zeros.misfit = math.inf
    for kind in (STAYS, SINKS, VARIES):
        if span < (LEAST_TIME if kind == STAYS else LEAST_TIME_VARYING):
            continue
        spline.free_all(fit)
        if not math.isnan(settings.channel_delay):
            fit.held[spline.DELAY] = 1
        if not spline.lay_out(history, fit, first, history.count, kind):
            continue
        spline.begin(fit, row)
        if _explains(settings, history, zeros, fit, noise, scatter):
            return True
    return False


@compiled
def _explains(
    settings: Any,
    history: Any,
    zeros: Any,
    fit: Any,
    noise: tuple[float, float],
    scatter: float,
) -> bool:
    """Fit from fit.values on; False if more than noise is left."""
    squares = solve_least_squares(settings, history, fit, noise, scatter)
    if not (math.isfinite(squares) and fit.expected > 0.0):
        return False
    zeros.misfit = min(zeros.misfit, squares / fit.expected)
    return bool(squares < CONSISTENT * fit.expected)


@compiled
def _hold_others(fit: Any, unknown: int, in_use: Any) -> None:
    """Hold the zeros that are not unknown as they were given."""
    for i in range(2):
        if unknown >> i & 1 == 0:
            fit.held[spline.POSITION + i] = 1
            fit.values[spline.POSITION + i] = -in_use[i]


@compiled
def _choose(settings: Any, zeros: Any, in_use: Any, sinks: bool) -> int:
    """Which zeros the points ask for, counted from where they were given; NONE if they do without.

    Args:
        settings: settings record.
        zeros: fitted with all that may be unknown; the costs of the choices are set.
        in_use: zeros in use beyond those given, shape (2,).
        sinks: True if the fit has a surface that sinks.
    """
    position, force = in_use[0] + zeros.position, in_use[1] + zeros.force
    possible = ALL if math.isnan(settings.channel_delay) else BOTH
    best = math.inf
    for choice in range(ALL + 1):
        zeros.cost[choice] = math.inf
        if choice | possible == possible:
            # Of a surface that sinks the position is always unknown.
            free = choice | OF_POSITION if sinks else choice
            without = _cost_without(zeros, position, force, possible - (free & possible))
            zeros.cost[choice] = without + PENALTY * _number(choice)
        best = min(best, zeros.cost[choice])
    if not zeros.cost[NONE] > best + SIGNIFICANT:
        return NONE
    together, fewest = NONE, 3
    for choice in range(1, ALL + 1):
        if zeros.cost[choice] == best:
            fewest = _number(choice)
    for choice in range(1, ALL + 1):
        if _number(choice) <= fewest and not zeros.cost[choice] > best + BETTER_BY:
            together |= choice
    together &= BOTH
    if sinks and together != NONE:
        return BOTH if together & OF_FORCE != 0 else NONE
    return together


@compiled
def _number(choice: int) -> int:
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
def _is_worth_it(zeros: Any, unknown: int, sinks: bool) -> bool:
    """True if zeros are to move to those of the fit."""
    if unknown != zeros.unknown:
        return True
    if unknown == NONE:
        return False
    square = _square(zeros.covariance, unknown, zeros.position, zeros.force)
    if square > SIGNIFICANT + PENALTY * _number(unknown):
        return True
    if sinks:
        return False
    return bool(math.sqrt(zeros.doubt_of_fit[0, 0]) < FINER * zeros.deviation)


@compiled
def _wanders(zeros: Any, unknown: int, sinks: bool) -> bool:
    """True if more points say something else, as of a law that does not hold all along the way."""
    if unknown == NONE:
        return False
    if sinks:  # its position goes on
        unknown = OF_FORCE
    position, force = zeros.position - zeros.begun[0], zeros.force - zeros.begun[1]
    square = _square(zeros.begun_covariance, unknown, position, force)
    return bool(square > WANDERS * _number(unknown))


@compiled
def _square(covariance: Any, unknown: int, position: float, force: float) -> float:
    """Square of differences of the unknown zeros, in a covariance of contact position and force."""
    a, b, c = covariance[0, 0], covariance[0, 1], covariance[1, 1]
    if unknown == OF_POSITION:
        return float(position * position / a)
    if unknown == OF_FORCE:
        return float(force * force / c)
    square = c * position * position - 2.0 * b * position * force + a * force * force
    return float(square / (a * c - b * b))


@compiled
def _is_possible(history: Any, zeros: Any, first: int) -> bool:
    """False for zeros that are too far off, or too little, to be moved."""
    deepest, largest = 0.0, 0.0
    for k in range(first, history.count):
        point = history.points[k % POINTS]
        deepest, largest = max(deepest, point[0]), max(largest, point[2])
    if abs(zeros.delay) > LARGEST_DELAY:
        return False
    if (
        abs(zeros.position) > LARGEST_POSITION * deepest
        or abs(zeros.force) > LARGEST_ZERO * largest
    ):
        return False
    if zeros.unknown != NONE:
        return True
    return bool(abs(zeros.position) > LEAST_POSITION or abs(zeros.force) > LEAST_ZERO * largest)


@compiled
def _use(onset: Any, zeros: Any, unknown: int, sinks: bool) -> None:
    """Note by how much the zeros are to move, and what is then left open."""
    zeros.unknown = unknown
    zeros.waiting = 0
    onset.shift[0] = zeros.position
    onset.shift[1] = zeros.force
    onset.position_deviation = 0.0
    if unknown & OF_POSITION != 0 and not sinks:
        onset.position_deviation = math.sqrt(max(zeros.covariance[0, 0], 0.0))
    onset.force_deviation = math.nan
    if unknown & OF_FORCE != 0:
        onset.force_deviation = math.sqrt(max(zeros.covariance[1, 1], 0.0))
    copy_matrix(zeros.doubt_of_fit, zeros.doubt)
    zeros.deviation = math.sqrt(zeros.doubt[0, 0])


@compiled
def _review(bank: Any, clock: float) -> bool:
    """Zeros that explain nothing for long any more go back to those given, for good."""
    zeros, onset = bank.zeros, bank.onset
    if zeros.unknown == NONE or not zeros.misfit > REFUTED:
        zeros.refuted_since = math.inf
        return False
    zeros.refuted_since = min(zeros.refuted_since, clock)
    if clock - zeros.refuted_since < LASTING:
        return False
    row = bank.rows[bank.judge.chosen]
    for i in range(2):
        onset.shift[i] = -onset.zero[i]
    for i in range(4):
        zeros.fit[i] = row.state[LOG_STIFFNESS + i]
    onset.position_deviation = 0.0
    onset.force_deviation = math.nan
    onset.decided = 1
    reset(zeros)
    return True
