"""K, B, n and p by the points that are kept, at one candidate delay: weighted least squares.

A point weighs by the noise that its residual has: that of the force, that of the depth times the
law's slope, and that of the velocity times B d^n p |v|^(p-1). At rest the last one is large where
p is below 1, for there |v|^p is mostly noise (errors in variables by effective variance; York, Can.
J. Phys. 44, 1966). What noise of the velocity takes from B is given back (corrected least
squares; Fuller, Measurement Error Models, 1987), for a B that is too small looks like a force that
is early. p is found with the others, and not taken from elsewhere, because a delay and p are next
to one ridge.

The law is K s with the shape s = d^n (1 + b v^p). K is linear, and eliminated (variable projection;
Golub and Pereyra 1973, Kaufman 1975): one K for all points, or where the tissue varies one for each
half second, with a surface of its own (to first order). What remains is nonlinear in b, n and p.

The squares have a derivative by the delay: the score. It is exact at a candidate, where between two
of them interpolation would average the noise of both and draw any least squares to the middle.
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.linear_algebra import (
    clear_matrix,
    clear_vector,
    copy_vector,
    leading_cholesky,
)
from hc_estimator.multiple_model import delay_points
from hc_estimator.multiple_model.delay_points import count_of
from hc_estimator.multiple_model.delay_records import CANDIDATES, DELAY_POINTS, TEMPERED
from hc_estimator.multiple_model.levenberg_marquardt import solve
from hc_estimator.multiple_model.rows import (
    LARGEST_VELOCITY_EXPONENT,
    SMALLEST_VELOCITY_EXPONENT,
    guess_of,
    prior_deviation,
)

SMALLEST_EXPONENT, LARGEST_EXPONENT = 0.5, 4.0  # n that tissue may have
LARGEST_STEPS = (0.4, 0.3)  # of n and p in one step
HALVINGS = 3  # of a step that makes it worse
FIRST_DAMPING = 0.02  # b of a fit that has none
SMALLEST_VARIANCE = 1e-30  # of a residual [N^2]
SMALLEST_PRIOR = 1e-4  # deviation of an exponent
SMALLEST_PIVOT = 1e-12  # share of the diagonal
LEAST_GAIN = 1e-4  # of the squares, below which a fit is done
LEAST_MOTION = 0.3  # share of the squares of the velocities that is no noise, at least
LEAST_ELASTIC = 0.3  # share of the force that K d^n is taken for, where damping takes it away
SURFACE = 0.3  # deviation of the surface of a half second from that of all [mm]
OWN = 2  # unknowns of a half second where the tissue varies
UNKNOWNS = 3  # b, n and p; the delay is the last of the columns


@compiled
def slowest(variance: float) -> float:
    """Logarithm of the speed [mm/s] below which a velocity is noise of that variance."""
    return 0.5 * math.log(variance) if variance > 0.0 else -math.inf


@compiled
def weigh(finder: Any, j: int) -> None:
    """Set the weights of all points by the law of a candidate.

    Args:
        finder: depth_noise[0] is the variance of a point's depth [mm^2], point_force[:, 2:] those
            of its velocity and force; point_force[:, 1] is set [1/N^2].
        j: candidate.
    """
    law = finder.law[j]
    for k in range(count_of(finder)):
        point, force = finder.point[k, j], finder.point_force[k]
        least = slowest(force[2])
        slope = law[2] * force[0] * point[3]
        rate = math.copysign(math.exp(law[3] * point[1]), point[2])
        elastic = force[0] / max(1.0 + law[1] * rate, LEAST_ELASTIC)
        swing = elastic * law[1] * law[3] * math.exp((law[3] - 1.0) * max(point[1], least))
        variance = force[3] + slope * slope * finder.depth_noise[0] + swing * swing * force[2]
        force[1] = 1.0 / max(variance, SMALLEST_VARIANCE)


@compiled
def temper(settings: Any, finder: Any, j: int) -> None:
    """Let each half second with its own K weigh by what the law of a candidate leaves of it.

    The noise of each is then unknown, and the logarithm of what is left its log likelihood: else
    the half seconds of which the law says least would decide.

    Args:
        settings: settings record.
        finder: point_force[:, 1] is changed.
        j: candidate.
    """
    add_up(settings, finder, j, finder.law[j])
    count = count_of(finder)
    for k in range(count):
        finder.window_points[finder.point_window[k] % TEMPERED] = 0
    for k in range(count):
        finder.window_points[finder.point_window[k] % TEMPERED] += 1
    for k in range(count):
        window = finder.point_window[k] % TEMPERED
        freedom = max(finder.window_points[window] - OWN, 1)
        finder.point_force[k, 1] /= max(finder.window_left[window] / freedom, 1.0)


@compiled
def _columns(finder: Any, k: int, j: int, law: Any) -> float:
    """Shape of a point, and in finder.column its derivatives by b, n, p and the delay."""
    point, column = finder.point[k, j], finder.column
    before = min(j + 1, CANDIDATES // 2 + finder.reach)  # a larger delay is an earlier motion
    after = max(j - 1, CANDIDATES // 2 - finder.reach)
    change = finder.point[k, after, 2] - finder.point[k, before, 2]
    acceleration = change / ((before - after) * finder.grid_step)
    power = math.exp(law[2] * point[0])
    rate = math.copysign(math.exp(law[3] * point[1]), point[2])
    shape = power * (1.0 + law[1] * rate)
    column[0] = power * rate
    column[1] = shape * point[0]
    column[2] = power * law[1] * rate * point[1]
    moves = law[2] * shape * point[2] * point[3]
    bends = power * law[1] * law[3] * rate / point[2] * acceleration
    column[3] = -(moves + bends)
    return shape  # type: ignore[no-any-return]


@compiled
def _clear(finder: Any) -> None:
    """Nothing is added up of the points with one K."""
    clear_vector(finder.sums_of_k)
    clear_matrix(finder.moments)


@compiled
def _eliminate(finder: Any, law: Any) -> None:
    """K of the points that were added up, in law[0]; what it leaves goes to the equations."""
    sums, moments, normal, slope = finder.sums_of_k, finder.moments, finder.normal, finder.slope
    if not sums[0] > 0.0:
        return
    stiffness = max(sums[1] / sums[0], 0.0)
    law[0] = stiffness
    square = stiffness * stiffness
    finder.squares += sums[2] - stiffness * (2.0 * sums[1] - stiffness * sums[0])
    push, deeper, away = 0.0, 1.0, 0.0
    if finder.varies != 0 and square > 0.0:  # the surface, as far as K does not explain it
        away = sums[6] / sums[0]
        deeper = sums[7] - away * sums[6] + 1.0 / (square * SURFACE**2)
        push = (sums[8] - away * sums[1]) / deeper
        finder.squares -= push * push * deeper
        law[0] = max(stiffness - push * away, 0.0)
    for i in range(4):
        own = moments[6, i] - away * moments[4, i] if push != 0.0 else 0.0
        slope[i] += stiffness * (moments[5, i] - stiffness * moments[4, i] - push * own)
        for m in range(i + 1):
            share = moments[4, i] * moments[4, m] / sums[0]
            if push != 0.0:
                share += own * (moments[6, m] - away * moments[4, m]) / deeper
            normal[i, m] += square * (moments[i, m] - share)
    window = finder.window_added % TEMPERED
    finder.window_left[window] = finder.squares - finder.window_before
    finder.window_before = finder.squares
    for i in range(3):
        finder.noise_taken[i] += square * sums[3 + i]


@compiled
def add_up(settings: Any, finder: Any, j: int, law: Any) -> float:
    """Normal equations of b, n, p and the delay at a law (lower triangle), K eliminated, weighted.

    Args:
        settings: settings record, for the priors of n and p.
        finder: normal and slope are set, squares (weighted squares left, those of the priors among
            them), and noise_taken[0], the noise of the velocity in what shows b.
        j: candidate.
        law: K, b, n, p; K is set.

    Returns:
        squares less what noise of the velocity adds to them.
    """
    normal, slope, column = finder.normal, finder.slope, finder.column
    clear_vector(slope)
    clear_matrix(normal)
    clear_vector(finder.noise_taken)
    finder.squares, finder.window_before = 0.0, 0.0
    _clear(finder)
    sums, moments = finder.sums_of_k, finder.moments
    count = count_of(finder)
    window = -1
    for back in range(count):
        k = (finder.kept - count + back) % DELAY_POINTS
        if finder.varies != 0 and finder.point_window[k] != window:
            _eliminate(finder, law)
            _clear(finder)
            window = finder.point_window[k]
            finder.window_added = window
        shape = _columns(finder, k, j, law)
        point, force = finder.point[k, j], finder.point_force[k]
        weight, deeper = force[1], law[2] * shape * point[3]
        sums[6] += weight * shape * deeper
        sums[7] += weight * deeper * deeper
        sums[8] += weight * deeper * force[0]
        sums[0] += weight * shape * shape
        sums[1] += weight * shape * force[0]
        sums[2] += weight * force[0] * force[0]
        for i in range(4):
            weighted = weight * column[i]
            moments[4, i] += weighted * shape
            moments[5, i] += weighted * force[0]
            if finder.varies != 0:
                moments[6, i] += weighted * deeper
            for m in range(i + 1):
                moments[i, m] += weighted * column[m]
        least = slowest(force[2])
        usual = max(point[1], least)
        swing = law[3] * column[0] / point[2]
        if point[1] < least:
            swing = law[3] * math.exp(law[2] * point[0] + (law[3] - 1.0) * least)
        swing *= swing * weight * force[2]
        sums[3] += swing
        sums[4] += swing * point[0]
        sums[5] += swing * (1.0 / law[3] + usual)
    _eliminate(finder, law)
    taken, b = finder.noise_taken, law[1]
    shown = max(normal[0, 0], 0.0)  # where next to nothing shows b, rounding is all there is
    share = min(1.0, (1.0 - LEAST_MOTION) * shown / taken[0]) if taken[0] > 0.0 else 0.0
    slope[0] += share * b * taken[0]
    slope[1] += share * b * b * taken[1]
    slope[2] += share * b * b * taken[2]
    taken[0] *= share
    for i in range(2):
        deviation = max(prior_deviation(settings, 2 + i), SMALLEST_PRIOR)
        off = (guess_of(settings, 2 + i) - law[2 + i]) / deviation
        normal[1 + i, 1 + i] += 1.0 / (deviation * deviation)
        slope[1 + i] += off / deviation
        finder.squares += off * off
    return finder.squares - b * b * taken[0]  # type: ignore[no-any-return]


@compiled
def _solve(normal: Any, slope: Any, held: bool) -> bool:
    """Solve for b, n and p in place by Cholesky's factor; b stays where it is if it is held."""
    if held:
        for m in range(UNKNOWNS):
            normal[m, 0] = 0.0
        normal[0, 0] = 1.0
        slope[0] = 0.0
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
    """Gauss-Newton on b >= 0, n and p of a candidate.

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
        largest = max(abs(slope[1]) / LARGEST_STEPS[0], abs(slope[2]) / LARGEST_STEPS[1])
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
    for i in range(4):
        for m in range(i):
            normal[m, i] = normal[i, m]
    held = finder.law[slot, 1] <= 0.0
    for k in (1, 2, 0):
        if k == 0:
            finder.bend[slot] = max(normal[3, 3], 0.0)
            finder.score[slot] = slope[3]
        pivot = normal[k, k]
        if not pivot > 0.0:
            continue
        for i in range(4):
            if i != k and not (k == 2 and i == 1) and not (k == 0 and i != 3):
                share = normal[i, k] / pivot
                slope[i] -= share * slope[k]
                for m in range(4):
                    normal[i, m] -= share * normal[k, m]
    finder.information[slot] = max(normal[3, 3], 0.0)
    if not held:
        finder.bend[slot] = finder.information[slot]
        finder.score[slot] = slope[3]
