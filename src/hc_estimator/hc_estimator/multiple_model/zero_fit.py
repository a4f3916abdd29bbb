"""Do the points tell of a contact position or a zero of the force that is off?

Where the tool starts in contact no first touch shows the zeros (`contact_onset`). But a power law
begins at zero force and zero depth: one that has to begin elsewhere leaves what no K, B, n and p
explain. So does a force that is late. Least squares with contact position, force zero and delay as
further unknowns finds within seconds which of them it is (ours; `hc bench accuracy delay`: 0.6 mm
of 3 mm makes K 50 % wrong).

One fit has all three unknown; what each choice of fewer would cost follows from its covariance.
The choice with the least cost and fewest unknowns wins, but all that explains the points nearly as
well stays unknown with it (Occam's window; Madigan and Raftery, JASA 89, 1994): where nothing shows
which of two zeros it is, both are taken from the fit that has both, with the deviations of that.

A law that does not fit real tissue would find zeros as well that make it fit better. So zeros move
only where the law then fits to within the noise of the sensors, and did not before: where no law
does, nothing is concluded.
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.linear_algebra import cholesky, copy_vector
from hc_estimator.multiple_model import history as histories
from hc_estimator.multiple_model.levenberg_marquardt import improve, solve
from hc_estimator.multiple_model.normal_equations import (
    add_prior,
    gather,
    is_used,
    weigh,
)
from hc_estimator.multiple_model.records import POINTS

POSITION, FORCE_ZERO, DELAY = 4, 5, 6  # of the unknowns
ZERO_UNKNOWNS = 7
# A choice of unknowns is the sum of these.
NONE, OF_POSITION, OF_FORCE, OF_DELAY = 0, 1, 2, 4
ZEROS = OF_POSITION + OF_FORCE
ALL = ZEROS + OF_DELAY
SIGNIFICANT = 8.0  # decrease of the weighted squares beyond that
PENALTY = 9.0  # of the same, that another unknown must be worth: three deviations
CONSISTENT = 1.5  # largest mean square left, in that of the noise
REFUTED = 6.0  # at which zeros that were found are taken back
LEAST_TIME = 2.0  # in contact [s]
LASTING = 2.0  # time in contact for which a candidate must stay the same [s]
BETTER_BY = 16.0  # decrease by which one candidate is better than the other
FINER = 0.5  # of the deviation with which a zero was found, at which it is found anew
LEAST_POSITION = 0.05  # [mm]
LEAST_ZERO = 0.005  # of the largest force
LARGEST_POSITION = 0.5  # of the largest depth
LARGEST_ZERO = 0.3  # of the largest force
LARGEST_DELAY = 0.005  # up to which the fit's tangents hold; a larger one is for `delay` [s]
PASSES = 3  # with other weights
SETTLED = 1e-2  # relative change of the squares between two passes at which they end


@compiled
def reset(zeros: Any) -> None:
    """Neither zero was found to be off."""
    zeros.unknown = NONE
    zeros.candidate = NONE
    zeros.since = 0.0
    zeros.deviation = 0.0


@compiled
def look(settings: Any, bank: Any, force_noise: float, expected: float) -> bool:
    """Look for zeros that are off; True if onset.shift says by how much.

    Args:
        settings: settings record.
        bank: its records `zeros` and `onset` are changed, and the weights of its points.
        force_noise: variance of a point's force by its share in the information [N^2].
        expected: weighted square of a point where noise of the force is all that is left.
    """
    history, zeros = bank.history, bank.zeros
    count = _count(history)
    if 2 * count < history.count - histories.oldest(history):
        return False
    # A press in one direction leaves too much to K, B and n alone.
    if bank.tool.contact_clock < LEAST_TIME or bank.tool.retreated == 0:
        return False
    if history.guessed != 0:  # a damping that is only a guess leaves what zeros would explain
        return False
    if zeros.unknown == NONE and not _promises(settings, history, zeros, force_noise):
        zeros.candidate = NONE
        return False
    possible = ALL if math.isnan(settings.channel_delay) else ZEROS
    squares = _fit(settings, history, zeros, possible, force_noise)
    if zeros.unknown != NONE and not squares < REFUTED * expected * count:
        _take_back(bank)
        return True
    if not squares < CONSISTENT * expected * count:  # nor if it is none
        return False
    weight = 1.0 / max(squares / count, 1.0)
    unknown = _choose(settings, zeros, possible, weight)
    if zeros.unknown != NONE:
        unknown |= zeros.unknown
    if unknown & ZEROS == NONE:
        zeros.candidate = NONE
        return False
    if unknown != possible:
        squares = _fit(settings, history, zeros, unknown, force_noise)
        if not squares < CONSISTENT * expected * count:
            return False
        weight = 1.0 / max(squares / count, 1.0)
    found = POSITION if unknown & OF_POSITION != 0 else FORCE_ZERO
    deviation = _deviation(settings, zeros, found, weight)
    if zeros.unknown != NONE and deviation > FINER * zeros.deviation:
        return False
    deepest, largest = _extremes(history)
    position, zero = zeros.fit[POSITION], zeros.fit[FORCE_ZERO]
    if abs(position) > LARGEST_POSITION * deepest or abs(zero) > LARGEST_ZERO * largest:
        return False
    if abs(zeros.fit[DELAY]) > LARGEST_DELAY:
        return False
    least = abs(position) < LEAST_POSITION and abs(zero) < LEAST_ZERO * largest
    if not math.isfinite(deviation) or (zeros.unknown == NONE and least):
        return False
    # Tissue that has just changed looks the same for as long as the change was not found.
    clock = bank.tool.contact_clock
    if zeros.unknown == NONE:
        if zeros.candidate == NONE:
            zeros.candidate = unknown & ZEROS
            zeros.since = clock
        if clock - zeros.since < LASTING:
            return False
    _note(settings, bank.onset, zeros, unknown, deviation, weight)
    return True


@compiled
def _count(history: Any) -> int:
    """Number of points that count here."""
    count = 0
    for k in range(histories.oldest(history), history.count):
        count += 1 if is_used(history.points[k % POINTS], ZERO_UNKNOWNS) else 0
    return count


@compiled
def _take_back(bank: Any) -> None:
    """The zeros that were found explain nothing any more: back to those given, for good."""
    onset = bank.onset
    for i in range(2):
        onset.shift[i] = -onset.zero[i]
    onset.position_deviation = 0.0
    onset.force_deviation = math.nan
    onset.decided = 1
    reset(bank.zeros)
    for i in range(4):
        bank.zeros.fit[i] = bank.history.fit[i]


@compiled
def _note(
    settings: Any, onset: Any, zeros: Any, unknown: int, deviation: float, weight: float
) -> None:
    """Note by how much the zeros are to move, and how well that is known."""
    zeros.unknown = zeros.unknown | (unknown & ZEROS)
    zeros.deviation = deviation
    onset.shift[0] = zeros.fit[POSITION]
    onset.shift[1] = zeros.fit[FORCE_ZERO]
    if unknown & OF_POSITION != 0:
        onset.position_deviation = deviation
    if unknown & OF_FORCE != 0:
        onset.force_deviation = _deviation(settings, zeros, FORCE_ZERO, weight)


@compiled
def _promises(settings: Any, history: Any, zeros: Any, force_noise: float) -> bool:
    """True if the tangent at the fit promises enough of the unknowns (score test; Rao 1948)."""
    _begin(history, zeros, ALL)
    weigh(settings, history, zeros, force_noise)
    gather(settings, history, zeros, zeros.fit)
    add_prior(settings, zeros, zeros.fit, 1.0)
    if not cholesky(zeros.information, zeros.factor):
        return False
    copy_vector(zeros.slope, zeros.next)
    solve(zeros.factor, zeros.next)
    promised = 0.0
    for i in range(zeros.next.shape[0]):
        promised += zeros.slope[i] * zeros.next[i]
    return bool(promised > SIGNIFICANT + PENALTY)


@compiled
def _choose(settings: Any, zeros: Any, possible: int, weight: float) -> int:
    """Which unknowns the points ask for; NONE if they can do without.

    Args:
        settings: settings record.
        zeros: gathered at the fit with all that is possible; covariance and cost are set.
        possible: the choice of all that may be unknown.
        weight: of the squares beside the prior.
    """
    if not _invert(settings, zeros, weight):
        return NONE
    best = math.inf
    for choice in range(ALL + 1):
        zeros.cost[choice] = math.inf
        if choice | possible == possible:
            without = _cost_without(zeros, possible - choice)
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
    return together


@compiled
def _number(choice: int) -> int:
    """Number of unknowns in a choice."""
    return (choice & 1) + (choice >> 1 & 1) + (choice >> 2 & 1)


@compiled
def _invert(settings: Any, zeros: Any, weight: float) -> bool:
    """Covariance of contact position, force zero and delay at the fit."""
    add_prior(settings, zeros, zeros.fit, weight)
    if not cholesky(zeros.information, zeros.factor):
        return False
    column = zeros.next
    for j in range(3):
        for i in range(column.shape[0]):
            column[i] = 1.0 if i == POSITION + j else 0.0
        solve(zeros.factor, column)
        for i in range(3):
            zeros.covariance[i, j] = column[POSITION + i]
    return True


@compiled
def _cost_without(zeros: Any, choice: int) -> float:
    """By how much the squares would grow with the unknowns of a choice at zero.

    b' C^-1 b for their values b and their covariance C, by elimination.
    """
    total = 0.0
    a = zeros.covariance
    fit = zeros.fit
    c00, c11, c22 = a[0, 0], a[1, 1], a[2, 2]
    c01, c02, c12 = a[0, 1], a[0, 2], a[1, 2]
    first, second, third = fit[POSITION], fit[FORCE_ZERO], fit[DELAY]
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
def _begin(history: Any, zeros: Any, unknown: int) -> None:
    """Begin with the fit of the law alone."""
    for i in range(4):
        zeros.fit[i] = history.fit[i]
        zeros.held[i] = history.held[i]
    for i in range(3):
        zeros.held[POSITION + i] = 0 if unknown >> i & 1 != 0 else 1
        zeros.fit[POSITION + i] = 0.0


@compiled
def _fit(
    settings: Any,
    history: Any,
    zeros: Any,
    unknown: int,
    force_noise: float,
) -> float:
    """Fit with the zeros that are unknown; weighted sum of squares, NaN if it broke down."""
    _begin(history, zeros, unknown)
    squares = math.inf
    for _ in range(PASSES):
        weigh(settings, history, zeros, force_noise)
        before = squares
        squares = improve(settings, history, zeros, 1.0, math.nan)
        finite = math.isfinite(zeros.fit[POSITION]) and math.isfinite(zeros.fit[FORCE_ZERO])
        if not math.isfinite(squares) or not finite or not math.isfinite(zeros.fit[DELAY]):
            return math.nan
        if abs(before - squares) < SETTLED * abs(squares):
            break
    return squares


@compiled
def _deviation(settings: Any, zeros: Any, unknown: int, weight: float) -> float:
    """Standard deviation of an unknown at the fit; infinite if the points do not determine it."""
    add_prior(settings, zeros, zeros.fit, weight)
    if not cholesky(zeros.information, zeros.factor):
        return math.inf
    column = zeros.next
    for i in range(column.shape[0]):
        column[i] = 1.0 if i == unknown else 0.0
    solve(zeros.factor, column)
    return math.sqrt(max(column[unknown], 0.0))


@compiled
def _extremes(history: Any) -> tuple[float, float]:
    """Largest depth [mm] and force [N] of the points."""
    deepest, largest = 0.0, 0.0
    for k in range(histories.oldest(history), history.count):
        point = history.points[k % POINTS]
        deepest, largest = max(deepest, point[0]), max(largest, point[2])
    return deepest, largest
