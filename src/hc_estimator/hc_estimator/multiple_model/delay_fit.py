"""K, B, n and p by the points that are kept, at one candidate delay: weighted least squares.

Gauss-Newton steps on the equations of `delay_equations`, K eliminated; what is left at the end, and
the score of the delay, say which candidate it is (`delay`).
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.linear_algebra import copy_vector, leading_cholesky
from hc_estimator.multiple_model import delay_points
from hc_estimator.multiple_model.delay_equations import (
    LATE,
    SURFACE_FIRST,
    UNKNOWNS,
    add_up,
    weigh,
)
from hc_estimator.multiple_model.delay_points import count_of
from hc_estimator.multiple_model.delay_records import CANDIDATES
from hc_estimator.multiple_model.levenberg_marquardt import solve
from hc_estimator.multiple_model.rows import LARGEST_VELOCITY_EXPONENT, SMALLEST_VELOCITY_EXPONENT

SMALLEST_EXPONENT, LARGEST_EXPONENT = 0.5, 4.0  # n that tissue may have
# In one step: of n, p, position [mm] and speed [mm/s] of the surface.
LARGEST_STEPS = (0.4, 0.3, 0.5, 0.1)
HALVINGS = 3  # of a step that makes it worse
FIRST_DAMPING = 0.02  # b of a fit that has none
SMALLEST_PIVOT = 1e-12  # share of the diagonal
LEAST_GAIN = 1e-4  # of the squares, below which a fit is done
STEPS = 3  # of a fit that goes on
BETWEEN = 3  # delays between two candidates that are tried
SMALL_STEP = 0.003  # from one to the next, in candidates, that is the last


@compiled
def _solve(normal: Any, slope: Any, held: bool) -> bool:
    """Solve in place by Cholesky's factor; b stays where it is if it is held."""
    if held:
        for m in range(UNKNOWNS):
            normal[m, 0] = 0.0
        normal[0, 0] = 1.0
        slope[0] = 0.0
    for m in range(SURFACE_FIRST, UNKNOWNS):
        if normal[m, m] == 0.0:  # they are known, or each half second has a surface of its own
            normal[m, m] = 1.0
    if not leading_cholesky(normal, normal, UNKNOWNS):
        return False
    for m in range(UNKNOWNS):
        size = 0.0  # of the diagonal before
        for k in range(m + 1):
            size += normal[m, k] * normal[m, k]
        if not normal[m, m] * normal[m, m] > SMALLEST_PIVOT * size:
            return False
    solve(normal, slope, UNKNOWNS)
    return True


@compiled
def improve(settings: Any, finder: Any, j: int, slot: int, other: int, steps: int) -> None:
    """Gauss-Newton on b >= 0 and the other unknowns of a candidate.

    Args:
        settings: settings record.
        finder: law[slot] is where it begins and is improved; left, score, information and
            noise_share of the slot are set.
        j: candidate.
        slot: j, or CANDIDATES for a delay between it and the next.
        other: candidate with whose law it begins where that leaves less; slot for its own.
        steps: at most.
    """
    law, trial, slope = finder.law[slot], finder.trial, finder.slope
    if not law[1] > 0.0:
        law[1] = FIRST_DAMPING
    others = math.inf
    if other != slot:
        copy_vector(finder.law[other], trial)
        others = add_up(settings, finder, j, trial)
    left = add_up(settings, finder, j, law)
    if others < left:
        copy_vector(finder.law[other], law)
        left = add_up(settings, finder, j, law)
    for _ in range(steps):
        if not _solve(finder.normal, slope, law[1] <= 0.0 and slope[0] <= 0.0):
            add_up(settings, finder, j, law)
            break
        largest = 0.0
        for i in range(len(LARGEST_STEPS)):
            largest = max(largest, abs(slope[1 + i]) / LARGEST_STEPS[i])
        size, better = 1.0 / largest if largest > 1.0 else 1.0, math.inf
        copy_vector(slope, finder.direction)
        for _ in range(HALVINGS):
            for i in range(UNKNOWNS):
                trial[1 + i] = law[1 + i] + size * finder.direction[i]
            _limit(trial)
            better = add_up(settings, finder, j, trial)
            if better < left:
                break
            size *= 0.5
        if not better < left:
            add_up(settings, finder, j, law)
            break
        done = left - better < LEAST_GAIN * finder.squares
        left = better
        copy_vector(trial, law)
        if done:
            break
    finder.left[slot] = finder.squares
    _note_score(finder, slot)


@compiled
def find_zero(settings: Any, finder: Any) -> None:
    """Find where the score vanishes beside the chosen candidate, by Gauss-Newton steps.

    Args:
        settings: settings record.
        finder: place, and what the slot CANDIDATES holds, are set.
    """
    chosen, fine = finder.chosen, CANDIDATES
    finder.place = chosen + _step(finder, chosen)
    copy_vector(finder.law[chosen], finder.law[fine])
    for _ in range(BETWEEN):
        base = candidate_below(finder)
        delay_points.shift(finder, finder.place - base)
        improve(settings, finder, base, fine, fine, STEPS)
        step = _step(finder, fine)
        finder.place = min(max(finder.place + step, chosen - 1.0), chosen + 1.0)
        if abs(step) < SMALL_STEP:
            break


@compiled
def least_near(finder: Any, j: int) -> float:
    """Squares that are left within half a step of a candidate, by its score."""
    away = _step(finder, j) * finder.grid_step
    return float(finder.left[j] - away * (2.0 * finder.score[j] - away * finder.bend[j]))


@compiled
def _step(finder: Any, slot: int) -> float:
    """Step of Gauss and Newton towards the zero of the score [candidates], at most half of one."""
    bend = finder.bend[slot] * finder.grid_step
    return min(max(finder.score[slot] / bend, -0.5), 0.5) if bend > 0.0 else 0.0


@compiled
def ratio_by_its_own(settings: Any, finder: Any, j: int) -> float:
    """Squares that a candidate leaves over those of the delay found, or of noise alone.

    By the candidate's own weights: the more damping a law has, the more noise of the velocity
    matters. In slow presses a delay tells the direction of motion from the depth, which has
    next to no noise, and leaves less than noise does: the truth leaves as much as that.

    Args:
        settings: settings record.
        finder: with the fits; weights and forces are changed.
        j: candidate.
    """
    delay_points.shift(finder, 0.0)  # points that came since the fits have no force yet
    weigh(finder, j)
    before = _left_of(settings, finder, j, 0.0, j)
    base = candidate_below(finder)
    after = _left_of(settings, finder, base, finder.place - base, CANDIDATES)
    return before / max(after, count_of(finder))


@compiled
def candidate_below(finder: Any) -> int:
    """Give the candidate at or below the delay found."""
    centre, reach = CANDIDATES // 2, finder.reach
    return min(max(math.floor(finder.place), centre - reach), centre + reach)  # type: ignore[no-any-return]


@compiled
def _left_of(settings: Any, finder: Any, j: int, share: float, slot: int) -> float:
    """Squares that a law leaves at a candidate, or a share of a step above it."""
    delay_points.shift(finder, share)
    copy_vector(finder.law[slot], finder.trial)
    add_up(settings, finder, j, finder.trial)
    return finder.squares  # type: ignore[no-any-return]


@compiled
def _limit(law: Any) -> None:
    """Keep a law within what tissue may have."""
    law[1] = max(law[1], 0.0)
    law[2] = min(max(law[2], SMALLEST_EXPONENT), LARGEST_EXPONENT)
    law[3] = min(max(law[3], SMALLEST_VELOCITY_EXPONENT), LARGEST_VELOCITY_EXPONENT)


@compiled
def _note_score(finder: Any, slot: int) -> None:
    """Score and information of the delay, all else having been found (Schur complement).

    While b stays at zero the score is that with b held; the information is never that, for a b
    that is larger would go with another delay.
    """
    normal, slope = finder.normal, finder.slope
    finder.noise_share[slot] = finder.noise_taken[0] / max(normal[0, 0], 1e-300)
    for i in range(LATE + 1):
        for m in range(i):
            normal[m, i] = normal[i, m]
    held = finder.law[slot, 1] <= 0.0
    for k in range(UNKNOWNS - 1, -1, -1):
        if k == 0:
            finder.bend[slot] = max(normal[LATE, LATE], 0.0)
            finder.score[slot] = slope[LATE]
        pivot = normal[k, k]
        if not pivot > 0.0:
            continue
        for i in range(LATE + 1):
            if i < k or i == LATE:
                share = normal[i, k] / pivot
                slope[i] -= share * slope[k]
                for m in range(LATE + 1):
                    normal[i, m] -= share * normal[k, m]
    finder.information[slot] = max(normal[LATE, LATE], 0.0)
    if not held:
        finder.bend[slot] = finder.information[slot]
        finder.score[slot] = slope[LATE]
