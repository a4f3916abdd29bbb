"""Do the points tell of a contact position or a zero of the force that is off?

Where the tool starts in contact no first touch shows the zeros (`contact_onset`). But a power law
begins at zero force and zero depth: one that has to begin elsewhere leaves what no K, B, n and p
explain. Least squares with the contact position, the zero of the force, or both, as unknowns find
it within seconds (ours; `hc bench accuracy delay`: 0.6 mm of 3 mm makes K 50 % wrong).

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
from hc_estimator.multiple_model.normal_equations import (
    add_prior,
    gather,
    improve,
    solve,
    weigh,
)
from hc_estimator.multiple_model.records import POINTS

POSITION, FORCE_ZERO = 4, 5  # of the unknowns
# Which of the two are unknown.
NEITHER, ONLY_POSITION, ONLY_FORCE, BOTH = 0, 1, 2, 3
SIGNIFICANT = 25.0  # decrease of the weighted squares: five deviations
CONSISTENT = 1.5  # largest mean square left, in that of the noise
REFUTED = 6.0  # at which zeros that were found are taken back
LEAST_TIME = 2.0  # in contact [s]
LASTING = 2.0  # time in contact for which a candidate must stay the same [s]
TOLD_APART = 25.0  # decrease by which one candidate is better than the other
FINER = 0.5  # of the deviation with which a zero was found, at which it is found anew
LEAST_POSITION = 0.05  # [mm]
LEAST_ZERO = 0.005  # of the largest force
LARGEST_POSITION = 0.5  # of the largest depth
LARGEST_ZERO = 0.3  # of the largest force
PASSES = 3  # with other weights
SETTLED = 1e-2  # relative change of the squares between two passes at which they end


@compiled
def reset(zeros: Any) -> None:
    """Neither zero was found to be off."""
    zeros.unknown = NEITHER
    zeros.candidate = NEITHER
    zeros.since = 0.0
    zeros.deviation = 0.0


@compiled
def look(
    settings: Any, bank: Any, force_noise: float, velocity_noise: float, expected: float
) -> bool:
    """Look for zeros that are off; True if onset.shift says by how much.

    Args:
        settings: settings record.
        bank: its records `zeros` and `onset` are changed, and the weights of its points.
        force_noise: variance of a point's force by its share in the information [N^2].
        velocity_noise: of its velocity, by the same share [mm^2/s^2].
        expected: weighted square of a point where noise of the force is all that is left.
    """
    history, zeros = bank.history, bank.zeros
    count = history.count - histories.oldest(history)
    # A press in one direction leaves too much to K, B and n alone.
    if bank.tool.contact_clock < LEAST_TIME or bank.tool.retreated == 0:
        return False
    if history.guessed != 0:  # a damping that is only a guess leaves what zeros would explain
        return False
    unknown = zeros.unknown
    if unknown == NEITHER:
        unknown = _candidate(settings, history, zeros, force_noise, velocity_noise)
        # Both at once explain much else, a delay above all.
        if unknown == NEITHER or (unknown == BOTH and math.isnan(settings.channel_delay)):
            zeros.candidate = NEITHER
            return False
    squares = _fit(settings, history, zeros, unknown, force_noise, velocity_noise)
    if zeros.unknown != NEITHER and not squares < REFUTED * expected * count:
        _take_back(bank)
        return True
    if not squares < CONSISTENT * expected * count:  # nor if it is none
        return False
    weight = 1.0 / max(squares / count, 1.0)
    found = FORCE_ZERO if unknown == ONLY_FORCE else POSITION
    deviation = _deviation(settings, zeros, found, weight)
    if zeros.unknown != NEITHER and deviation > FINER * zeros.deviation:
        return False
    deepest, largest = _extremes(history)
    position, zero = zeros.fit[POSITION], zeros.fit[FORCE_ZERO]
    if abs(position) > LARGEST_POSITION * deepest or abs(zero) > LARGEST_ZERO * largest:
        return False
    least = abs(position) < LEAST_POSITION and abs(zero) < LEAST_ZERO * largest
    if not math.isfinite(deviation) or (zeros.unknown == NEITHER and least):
        return False
    # Tissue that has just changed looks the same for as long as the change was not found.
    clock = bank.tool.contact_clock
    if zeros.unknown == NEITHER:
        if zeros.candidate != unknown:
            zeros.candidate = unknown
            zeros.since = clock
        if clock - zeros.since < LASTING:
            return False
    _note(settings, bank.onset, zeros, unknown, deviation, weight)
    return True


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
    zeros.unknown = unknown
    zeros.deviation = deviation
    onset.shift[0] = zeros.fit[POSITION]
    onset.shift[1] = zeros.fit[FORCE_ZERO]
    if unknown != ONLY_FORCE:
        onset.position_deviation = deviation
    if unknown != ONLY_POSITION:
        onset.force_deviation = _deviation(settings, zeros, FORCE_ZERO, weight)


@compiled
def _candidate(
    settings: Any, history: Any, zeros: Any, force_noise: float, velocity_noise: float
) -> int:
    """Which zeros are off, if any; both where the points do not tell which of them it is."""
    # What the tangent at the fit promises (score test; Rao 1948) costs one pass and ends most.
    _begin(history, zeros, BOTH)
    weigh(settings, history, zeros, force_noise, velocity_noise)
    gather(settings, history, zeros, zeros.fit)
    add_prior(settings, zeros, zeros.fit, 1.0)
    if not cholesky(zeros.information, zeros.factor):
        return NEITHER
    copy_vector(zeros.slope, zeros.next)
    solve(zeros.factor, zeros.next)
    promised = 0.0
    for i in range(zeros.next.shape[0]):
        promised += zeros.slope[i] * zeros.next[i]
    if not promised > SIGNIFICANT:
        return NEITHER
    plain = _fit(settings, history, zeros, NEITHER, force_noise, velocity_noise)
    position = _fit(settings, history, zeros, ONLY_POSITION, force_noise, velocity_noise)
    force = _fit(settings, history, zeros, ONLY_FORCE, force_noise, velocity_noise)
    best = min(position, force)
    count = history.count - histories.oldest(history)
    weight = 1.0 / max(best / count, 1.0)
    if not (plain - best) * weight > SIGNIFICANT:
        return NEITHER
    if not abs(position - force) * weight > TOLD_APART:
        return BOTH
    return ONLY_POSITION if position < force else ONLY_FORCE


@compiled
def _begin(history: Any, zeros: Any, unknown: int) -> None:
    """Begin with the fit of the law alone."""
    for i in range(4):
        zeros.fit[i] = history.fit[i]
        zeros.held[i] = history.held[i]
    zeros.held[POSITION] = 1 if unknown in (ONLY_FORCE, NEITHER) else 0
    zeros.held[FORCE_ZERO] = 1 if unknown in (ONLY_POSITION, NEITHER) else 0
    zeros.fit[POSITION] = 0.0
    zeros.fit[FORCE_ZERO] = 0.0


@compiled
def _fit(
    settings: Any,
    history: Any,
    zeros: Any,
    unknown: int,
    force_noise: float,
    velocity_noise: float,
) -> float:
    """Fit with the zeros that are unknown; weighted sum of squares, NaN if it broke down."""
    _begin(history, zeros, unknown)
    squares = math.inf
    for _ in range(PASSES):
        weigh(settings, history, zeros, force_noise, velocity_noise)
        before = squares
        squares = improve(settings, history, zeros, 1.0)
        finite = math.isfinite(zeros.fit[POSITION]) and math.isfinite(zeros.fit[FORCE_ZERO])
        if not math.isfinite(squares) or not finite:
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
