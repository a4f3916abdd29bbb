"""By how much is the force late? Short windows, each with parameters of its own, say it together.

Sensors filter and networks delay, and a delay of the force looks like damping (a negative one like
damping that is not there). The delay cannot be a state: the likelihood has two optima, one false.
Instead the readings of every half second are fitted, for each candidate delay, by the law with the
p that the bank has found (1 until then), F = d^n (K + B v^p), B >= 0 (ours). Windows of their own
are what makes this immune to tissue that varies. The logarithm of what a fit leaves is
a log likelihood with an unknown noise per window; the windows' sum chooses, and their scatter says
whether the answer is clear. A Gauss-Newton fit with the delay as a fourth parameter gives the fine
value.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hc_estimator.compilation import compiled
from hc_estimator.multiple_model import grid as grids
from hc_estimator.multiple_model.records import (
    CANDIDATES,
    GRID,
    WINDOWS,
)

LEAST_SHARE = 0.3  # of a window that must be in contact
FEWEST_POINTS = 12  # of a window: three for each unknown
LEAST_DEPTH = 0.05  # [mm]
SLOWEST = 1e-3  # speed at which |v|^p is taken at least [mm/s]
LEAST_FORCE = 0.02  # of the window's largest
INDEPENDENT = 5.0  # points of a window that count as independent: 0.1 s apart
EXPONENTS = np.arange(0.8, 3.3, 0.4)
SMALLEST_EXPONENT, LARGEST_EXPONENT = 0.5, 4.0
REFINEMENTS = 4  # Gauss-Newton steps for n
FINE_STEPS = 8  # Gauss-Newton steps with the delay
LEAST_RESIDUAL = 1e-9  # of the mean squared force: below, the logarithm says nothing more
# When the answer is clear:
FEWEST_WINDOWS = 4
LEAD = 8.0  # log likelihood ratio to the delay in use
CONSISTENT = 5.0  # mean over standard error of the windows' ratios
APART = 0.012  # delays further apart are rivals [s]
RIVAL = 4.0  # log likelihood ratio to the best rival
SMALLEST = 0.001  # delay worth the name [s]
SIGNIFICANT = 4.0  # standard deviations
CORRECTION = 0.0002  # by which a delay in use is corrected, at least [s]
BEGIN_ANEW = 0.002  # change of the delay from which on the rows begin anew [s]
SMALLEST_DEVIATION = 0.0001  # no more is claimed [s]


@compiled
def reset(finder: Any) -> None:
    """Nothing is known of the delay."""
    finder.delay = 0.0
    finder.deviation = math.nan
    finder.windows = 0
    grids.restart(finder)


@compiled
def _gather(finder: Any, delay: float) -> int:
    """Points in contact for a candidate delay, in finder.points_of; their number.

    A point is ln d, w = sign(v) |v|^p, its rate along with the rate of ln d, and F.
    """
    p = finder.velocity_exponent
    shift = round(delay / finder.grid_step)
    rest = shift * finder.grid_step - delay
    count = 0
    for k in range(finder.points):
        if finder.in_contact[k] == 0:
            continue
        here = finder.first + k
        point = finder.grid[(here - shift) % GRID]
        depth = point[0] + rest * (point[1] + 0.5 * rest * point[2])
        row = finder.points_of[count]
        row[0] = math.log(max(depth, 0.2 * LEAST_DEPTH))
        velocity = point[1] + rest * point[2]
        speed = max(abs(velocity), SLOWEST)
        power = speed**p
        row[1] = math.copysign(power, velocity)
        row[2] = p * power / speed * point[2]
        row[4] = velocity / math.exp(row[0])
        row[3] = finder.grid[here % GRID, 3]
        count += 1
    return count


@compiled
def _find_contact(finder: Any) -> int:
    """Mark the points that are in contact for every candidate delay; their number."""
    largest = 0.0
    for k in range(finder.points):
        largest = max(largest, finder.grid[(finder.first + k) % GRID, 3])
    count = 0
    for k in range(finder.points):
        here = finder.first + k
        inside = finder.grid[here % GRID, 3] > LEAST_FORCE * largest
        for j in range(-finder.reach, finder.reach + 1):
            if finder.grid[(here - j) % GRID, 0] < LEAST_DEPTH:
                inside = False
        finder.in_contact[k] = 1 if inside else 0
        count += finder.in_contact[k]
    return count


@compiled
def _linear_fit(finder: Any, count: int, exponent: float) -> float:
    """Least squares for K and B >= 0 at an exponent; the sum of squares left."""
    g00, g01, g11, r0, r1, total = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(count):
        row = finder.points_of[k]
        a = math.exp(exponent * row[0])
        b = a * row[1]
        g00 += a * a
        g01 += a * b
        g11 += b * b
        r0 += a * row[3]
        r1 += b * row[3]
        total += row[3] * row[3]
    determinant = g00 * g11 - g01 * g01
    stiffness, damping = r0 / g00, 0.0
    if determinant > 1e-12 * g00 * g11:
        damping = (r1 * g00 - r0 * g01) / determinant
        if damping > 0.0:
            stiffness = (r0 * g11 - r1 * g01) / determinant
        else:
            damping = 0.0
    finder.fit[0] = stiffness
    finder.fit[1] = damping
    finder.fit[2] = exponent
    left = total - 2.0 * (stiffness * r0 + damping * r1)
    left += stiffness * (stiffness * g00 + 2.0 * damping * g01) + damping * damping * g11
    return max(left, LEAST_RESIDUAL * total)


@compiled
def _refine_exponent(finder: Any, count: int) -> float:
    """Improve n, and K and B with it, by secant steps on the sum of squares; what it leaves."""
    exponent, width = finder.fit[2], 0.1
    best = _linear_fit(finder, count, exponent)
    for _ in range(REFINEMENTS):
        above = _linear_fit(finder, count, exponent + width)
        below = _linear_fit(finder, count, exponent - width)
        bend = above - 2.0 * best + below
        step = 0.5 * (below - above) / bend if bend > 0.0 else math.copysign(2.0, below - above)
        step = min(max(step, -4.0), 4.0) * width
        trial = min(max(exponent + step, SMALLEST_EXPONENT), LARGEST_EXPONENT)
        left = _linear_fit(finder, count, trial)
        if left < best:
            exponent, best = trial, left
        width = max(0.3 * width, 0.002)
    return _linear_fit(finder, count, exponent)


@compiled
def _fine_delay(finder: Any, start: float) -> bool:
    """Gauss-Newton for K, B, n and the delay from the fit in finder.fit; False if it runs away.

    Leaves the delay and its variance in finder.fine.
    """
    delay = start
    fit, normal, slope = finder.fit, finder.normal, finder.slope
    for _ in range(FINE_STEPS):
        count = _gather(finder, delay)
        left = 0.0
        for i in range(4):
            slope[i] = 0.0
            for j in range(4):
                normal[i, j] = 0.0
        for k in range(count):
            row = finder.points_of[k]
            power = math.exp(fit[2] * row[0])
            force = power * (fit[0] + fit[1] * row[1])
            residual = row[3] - force
            left += residual * residual
            finder.column[0] = power
            finder.column[1] = power * row[1]
            finder.column[2] = force * row[0]
            finder.column[3] = -(fit[2] * force * row[4] + power * fit[1] * row[2])
            for i in range(4):
                slope[i] += finder.column[i] * residual
                for j in range(i + 1):
                    normal[i, j] += finder.column[i] * finder.column[j]
        fixed = 1 if fit[1] <= 0.0 and slope[1] <= 0.0 else -1  # B stays at zero
        if not _solve(normal, slope, fixed):
            return False
        delay += slope[3]
        fit[0] += slope[0]
        fit[1] = max(fit[1] + slope[1], 0.0)
        fit[2] = min(max(fit[2] + slope[2], SMALLEST_EXPONENT), LARGEST_EXPONENT)
        if not abs(delay - start) < 1.5 * finder.grid_step or abs(delay) > grids.LARGEST:
            return False
        if abs(slope[3]) < 1e-5:
            break
    finder.fine[0] = delay
    independent = min(INDEPENDENT, float(count))
    # `_solve` leaves the variance factor of the last unknown in normal[3, 3].
    finder.fine[1] = normal[3, 3] * left / count * (count / independent)
    return True


@compiled
def _solve(normal: Any, slope: Any, fixed: int) -> bool:
    """Solve the 4x4 normal equations in place (lower triangle); `fixed` stays 0 unless -1.

    Leaves the last element of the inverse in normal[3, 3].
    """
    if fixed >= 0:
        for j in range(4):
            normal[max(fixed, j), min(fixed, j)] = 1.0 if j == fixed else 0.0
        slope[fixed] = 0.0
    for j in range(4):
        pivot = normal[j, j]
        size = pivot
        for k in range(j):
            pivot -= normal[j, k] * normal[j, k]
        if not pivot > 1e-12 * size:
            return False
        root = math.sqrt(pivot)
        normal[j, j] = root
        for i in range(j + 1, 4):
            total = normal[i, j]
            for k in range(j):
                total -= normal[i, k] * normal[j, k]
            normal[i, j] = total / root
    for i in range(4):
        for j in range(i):
            slope[i] -= normal[i, j] * slope[j]
        slope[i] /= normal[i, i]
    for i in range(3, -1, -1):
        for j in range(i + 1, 4):
            slope[i] -= normal[j, i] * slope[j]
        slope[i] /= normal[i, i]
    normal[3, 3] = 1.0 / (normal[3, 3] * normal[3, 3])
    return True


@compiled
def learn_window(finder: Any, velocity_exponent: float) -> bool:
    """Take a full window into what is known; True if the delay in use is to change.

    The new delay is then finder.delay, and the window's K, B and n at it are finder.fit.

    Args:
        finder: changed.
        velocity_exponent: p, as far as it is known; 1 else.
    """
    finder.velocity_exponent = velocity_exponent
    if _find_contact(finder) < max(LEAST_SHARE * finder.points, FEWEST_POINTS):
        return False
    slot = finder.windows % WINDOWS
    reach = finder.reach
    profile = finder.profile[slot]
    centre = CANDIDATES // 2
    for j in range(CANDIDATES):
        profile[j] = math.inf
    count = _gather(finder, 0.0)
    best = math.inf
    for exponent in EXPONENTS:
        left = _linear_fit(finder, count, exponent)
        if left < best:
            best = left
            finder.guess[2] = exponent
    for side in (1, -1):
        finder.fit[2] = finder.guess[2]
        for j in range(reach + 1):
            count = _gather(finder, side * j * finder.grid_step)
            left = _refine_exponent(finder, count)
            profile[centre + side * j] = 0.5 * INDEPENDENT * math.log(left)
            if j == 0:
                finder.guess[2] = finder.fit[2]
    finder.windows += 1
    chosen = _choose(finder)
    start = (chosen - centre) * finder.grid_step
    count = _gather(finder, start)
    finder.fit[2] = finder.guess[2]
    _refine_exponent(finder, count)
    finder.fine_valid[slot] = 0
    if _fine_delay(finder, start):
        finder.fine_valid[slot] = 1
        finder.fine_delay[slot] = finder.fine[0]
        finder.fine_variance[slot] = finder.fine[1]
    return _decide(finder, chosen)


@compiled
def _choose(finder: Any) -> int:
    """Candidate with the largest likelihood over the remembered windows."""
    chosen, best = CANDIDATES // 2, math.inf
    for j in range(CANDIDATES):
        total = 0.0
        for w in range(min(finder.windows, WINDOWS)):
            total += finder.profile[w, j]
        finder.total[j] = total
        if total < best:
            best = total
            chosen = j
    return chosen


@compiled
def _decide(finder: Any, chosen: int) -> bool:
    """Value and deviation of the delay; True if the one in use is to change."""
    windows = min(finder.windows, WINDOWS)
    if windows < FEWEST_WINDOWS:
        return False
    step, centre = finder.grid_step, CANDIDATES // 2
    for j in range(CANDIDATES):
        apart = abs(j - chosen) * step > APART
        if apart and finder.total[j] - finder.total[chosen] < RIVAL:
            finder.deviation = math.nan if finder.delay == 0.0 else finder.deviation
            return False
    weight, mean, square, used = 0.0, 0.0, 0.0, 0
    for w in range(windows):
        near = abs(finder.fine_delay[w] - (chosen - centre) * step) < 1.5 * step
        if finder.fine_valid[w] != 0 and near:
            share = 1.0 / (finder.fine_variance[w] + SMALLEST_DEVIATION**2)
            weight += share
            mean += share * finder.fine_delay[w]
            used += 1
    if used < FEWEST_WINDOWS:
        return False
    mean /= weight
    for w in range(windows):
        near = abs(finder.fine_delay[w] - (chosen - centre) * step) < 1.5 * step
        if finder.fine_valid[w] != 0 and near:
            share = 1.0 / (finder.fine_variance[w] + SMALLEST_DEVIATION**2)
            square += share * (finder.fine_delay[w] - mean) ** 2
    scatter = square / max(used - 1, 1)  # 1 where the windows' own variances are right
    deviation = math.sqrt(max(scatter, 1.0) / weight + SMALLEST_DEVIATION**2)
    distance = abs(mean - finder.delay)
    if finder.delay == 0.0:
        finder.deviation = deviation
        changes = distance > max(SIGNIFICANT * deviation, SMALLEST)
        changes = changes and _is_clear(finder, chosen, windows)
    else:
        changes = distance > max(deviation, CORRECTION)
        if changes and distance > step:
            changes = _is_clear(finder, chosen, windows)
    if changes:
        finder.delay = mean
    if changes or finder.delay != 0.0:
        finder.deviation = math.hypot(deviation, mean - finder.delay)
    return bool(changes)


@compiled
def _is_clear(finder: Any, chosen: int, windows: int) -> bool:
    """True if the windows agree that the chosen candidate is better than the delay in use."""
    step, centre = finder.grid_step, CANDIDATES // 2
    used = centre + round(finder.delay / step)
    if used == chosen:  # between two candidates: by the fine values alone
        return True
    mean, square = 0.0, 0.0
    for w in range(windows):
        lead = finder.profile[w, used] - finder.profile[w, chosen]
        mean += lead / windows
        square += lead * lead / windows
    error = math.sqrt(max(square - mean * mean, 0.0) / max(windows - 1, 1))
    return bool(mean * windows > LEAD and mean > CONSISTENT * error)
