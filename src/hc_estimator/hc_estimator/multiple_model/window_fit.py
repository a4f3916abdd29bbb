"""The contact law fitted to half a second, for a delay that is given or with the delay.

Corrected least squares (Fuller, Measurement Error Models, 1987) on the points of the grid; for
`delay`, which says what for.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hc_estimator.compilation import compiled
from hc_estimator.multiple_model import grid as grids
from hc_estimator.multiple_model.records import CANDIDATES, GRID

LEAST_DEPTH = 0.05  # [mm]
SLOWEST = 1e-3  # speed at which |v|^p is taken at least [mm/s]
LEAST_FORCE = 0.02  # of the window's largest
NEAR = 1.5  # steps of the grid between a fine value and its candidate
EXPONENTS = np.arange(0.8, 3.3, 0.4)  # n at which a fit begins
INDEPENDENT = 5.0  # points of a window that count as independent: 0.1 s apart
SMALLEST_EXPONENT, LARGEST_EXPONENT = 0.5, 4.0
REFINEMENTS = 4  # Gauss-Newton steps for n
FINE_STEPS = 8  # Gauss-Newton steps with the delay
LEAST_MOTION = 0.3  # share of the squares of the velocities that is no noise, at least
LEAST_RESIDUAL = 1e-9  # of the mean squared force: below, the logarithm says nothing more
SMALLEST_DEVIATION = 0.0001  # no more is claimed [s]


@compiled
def gather(finder: Any, delay: float) -> int:
    """Points in contact for a candidate delay, in finder.points_of; their number.

    A point is ln d, w = sign(v) |v|^p, its rate along with the rate of ln d, F, and the variance
    of the noise of w.
    """
    p, step = finder.velocity_exponent, finder.grid_step
    shift = max(math.floor(delay / step), -finder.reach)
    rest = delay / step - shift
    smooth = rest * rest * (3.0 - 2.0 * rest)
    count = 0
    for k in range(finder.points):
        if finder.in_contact[k] == 0:
            continue
        here = finder.first + k
        after = finder.smooth[(here - shift) % GRID]
        before = finder.smooth[(here - shift - 1) % GRID]
        # Cubics between two points: by the second derivative of one point alone the noise would
        # grow with the way from it, and least squares would keep to the points.
        bend = rest * (1.0 - rest) * step * (after[1] - before[1])
        depth = after[0] + rest * (before[0] - after[0]) - 0.5 * bend
        velocity = after[1] + smooth * (before[1] - after[1])
        velocity += rest * (1.0 - rest) * step * ((1.0 - rest) * -after[2] + rest * before[2])
        acceleration = after[2] + rest * (before[2] - after[2])
        row = finder.points_of[count]
        row[0] = math.log(max(depth, 0.2 * LEAST_DEPTH))
        speed = max(abs(velocity), SLOWEST)
        power = speed**p
        row[1] = math.copysign(power, velocity)
        row[2] = p * power / speed * acceleration
        row[4] = velocity / math.exp(row[0])
        row[3] = finder.smooth[here % GRID, 3]
        speed = max(speed, math.sqrt(finder.velocity_variance))
        row[5] = (p * speed ** (p - 1.0)) ** 2 * finder.velocity_variance
        count += 1
    return count


@compiled
def find_contact(finder: Any) -> int:
    """Mark the points that are in contact for every candidate delay; their number."""
    largest = 0.0
    for k in range(finder.points):
        largest = max(largest, finder.grid[(finder.first + k) % GRID, 3])
    count = 0
    margin = finder.reach + finder.neighbours
    for k in range(finder.points):
        here = finder.first + k
        inside = True
        for j in range(-finder.neighbours, finder.neighbours + 1):
            if not finder.grid[(here + j) % GRID, 3] > LEAST_FORCE * largest:
                inside = False
        for j in range(-margin, margin + 1):
            if finder.grid[(here - j) % GRID, 0] < LEAST_DEPTH:
                inside = False
        finder.in_contact[k] = 1 if inside else 0
        count += finder.in_contact[k]
    return count


@compiled
def stiffness_and_damping(
    g00: float, g01: float, g11: float, r0: float, r1: float
) -> tuple[float, float]:
    """K and B >= 0 by the normal equations of both; K by itself where they do not tell B."""
    determinant = g00 * g11 - g01 * g01
    if determinant > 1e-12 * g00 * g11:
        damping = (r1 * g00 - r0 * g01) / determinant
        if damping > 0.0:
            return (r0 * g11 - r1 * g01) / determinant, damping
    return r0 / g00, 0.0


@compiled
def secant_step(above: float, best: float, below: float, width: float) -> float:
    """Step to the least of the parabola through three squares a width apart, at most four of it."""
    bend = above - 2.0 * best + below
    step = 0.5 * (below - above) / bend if bend > 0.0 else math.copysign(2.0, below - above)
    return min(max(step, -4.0), 4.0) * width


@compiled
def within_limits(exponent: float) -> float:
    """An n that tissue may have."""
    return min(max(exponent, SMALLEST_EXPONENT), LARGEST_EXPONENT)


@compiled
def linear_fit(finder: Any, count: int, exponent: float) -> float:
    """Least squares for K and B >= 0 at an exponent; the sum of squares left.

    Less what the noise of the velocities adds to both, B^2 times its squares: it would make B too
    small, and what B leaves looks like a delay (corrected least squares; Fuller, Measurement Error
    Models, 1987).
    """
    g00, g01, g11, r0, r1, total, noise = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(count):
        row = finder.points_of[k]
        a = math.exp(exponent * row[0])
        b = a * row[1]
        g00 += a * a
        g01 += a * b
        g11 += b * b
        noise += a * a * row[5]
        r0 += a * row[3]
        r1 += b * row[3]
        total += row[3] * row[3]
    g11 = max(g11 - noise, LEAST_MOTION * g11)
    stiffness, damping = stiffness_and_damping(g00, g01, g11, r0, r1)
    finder.fit[0] = stiffness
    finder.fit[1] = damping
    finder.fit[2] = exponent
    left = total - 2.0 * (stiffness * r0 + damping * r1)
    left += stiffness * (stiffness * g00 + 2.0 * damping * g01) + damping * damping * g11
    return float(max(left + finder.noise_left, LEAST_RESIDUAL * total))


@compiled
def noise_left(finder: Any, count: int) -> float:
    """Squares that the noise of the velocities leaves with the fit in finder.fit."""
    total = 0.0
    for k in range(count):
        row = finder.points_of[k]
        total += math.exp(2.0 * finder.fit[2] * row[0]) * row[5]
    return float(finder.fit[1] ** 2 * total)


@compiled
def refine_exponent(finder: Any, count: int) -> float:
    """Improve n, and K and B with it, by secant steps on the sum of squares; what it leaves."""
    exponent, width = finder.fit[2], 0.1
    best = linear_fit(finder, count, exponent)
    for _ in range(REFINEMENTS):
        above = linear_fit(finder, count, exponent + width)
        below = linear_fit(finder, count, exponent - width)
        trial = within_limits(exponent + secant_step(above, best, below, width))
        left = linear_fit(finder, count, trial)
        if left < best:
            exponent, best = trial, left
        width = max(0.3 * width, 0.002)
    return linear_fit(finder, count, exponent)


@compiled
def take_profile(finder: Any, profile: Any) -> None:
    """Negative log likelihood of each candidate delay, with the p in use; infinite out of reach."""
    centre = CANDIDATES // 2
    for j in range(CANDIDATES):
        profile[j] = math.inf
    for side in (1, -1):
        finder.fit[2] = finder.guess[2]
        for j in range(finder.reach + 1):
            count = gather(finder, side * j * finder.grid_step)
            left = refine_exponent(finder, count)
            profile[centre + side * j] = 0.5 * INDEPENDENT * math.log(left)
            if j == 0:
                finder.guess[2] = finder.fit[2]


@compiled
def fine_delay(finder: Any, start: float, slot: int) -> bool:
    """Gauss-Newton for K, B, n and the delay from the fit in finder.fit; False if it runs away.

    Leaves the delay, and the window's information on delay and p, in the slot.
    """
    delay = start
    fit, normal, slope = finder.fit, finder.normal, finder.slope
    for _ in range(FINE_STEPS):
        count = gather(finder, delay)
        _add_up(finder, count)
        if not solve_four(normal, slope, _fixed(fit, slope)):
            return False
        delay += slope[3]
        fit[0] += slope[0]
        fit[1] = max(fit[1] + slope[1], 0.0)
        fit[2] = within_limits(fit[2] + slope[2])
        if not abs(delay - start) < NEAR * finder.grid_step or abs(delay) > grids.LARGEST:
            return False
        if abs(slope[3]) < 1e-5:
            break
    count = gather(finder, delay)
    left = _add_up(finder, count)
    fixed = _fixed(fit, slope)
    for k in range(3):  # K, B and n are the window's own
        if k == fixed:
            continue
        pivot = normal[k, k]
        if not pivot > 0.0:
            return False
        for i in range(k + 1, 5):
            share = normal[i, k] / pivot
            slope[i] -= share * slope[k]
            for j in range(k + 1, i + 1):
                normal[i, j] -= share * normal[j, k]
    if not (normal[3, 3] > 0.0 and left > 0.0):
        return False
    weight = min(INDEPENDENT, float(count)) / left
    weight = min(weight, 1.0 / (SMALLEST_DEVIATION**2 * normal[3, 3]))
    finder.fine_delay[slot] = delay
    p = finder.velocity_exponent
    both, of_p = weight * normal[4, 3], weight * max(normal[4, 4], 0.0)
    information, vector = finder.fine_information[slot], finder.fine_vector[slot]
    information[0] = weight * normal[3, 3]
    information[1] = both
    information[2] = of_p
    vector[0] = information[0] * delay + both * p + weight * slope[3]
    vector[1] = both * delay + of_p * p + weight * slope[4]
    return True


@compiled
def _fixed(fit: Any, slope: Any) -> int:
    """1 while B stays at zero, else -1."""
    return 1 if fit[1] <= 0.0 and slope[1] <= 0.0 else -1


@compiled
def _add_up(finder: Any, count: int) -> float:
    """Normal equations of K, B, n, delay and p at the fit (lower triangle); squares left."""
    fit, normal, slope, column = finder.fit, finder.normal, finder.slope, finder.column
    left, noise, bent_noise = 0.0, 0.0, 0.0
    for i in range(5):
        slope[i] = 0.0
        for j in range(5):
            normal[i, j] = 0.0
    for k in range(count):
        row = finder.points_of[k]
        power = math.exp(fit[2] * row[0])
        force = power * (fit[0] + fit[1] * row[1])
        residual = row[3] - force
        left += residual * residual
        column[0] = power
        column[1] = power * row[1]
        column[2] = force * row[0]
        column[3] = -(fit[2] * force * row[4] + power * fit[1] * row[2])
        column[4] = column[1] * fit[1] * math.log(abs(row[1])) / finder.velocity_exponent
        for i in range(5):
            slope[i] += column[i] * residual
            for j in range(i + 1):
                normal[i, j] += column[i] * column[j]
        noise += power * power * row[5]
        bent_noise += power * power * row[5] * row[0]
    share = min(1.0, (1.0 - LEAST_MOTION) * normal[1, 1] / noise) if noise > 0.0 else 0.0
    slope[1] += share * fit[1] * noise  # as in `linear_fit`
    slope[2] += share * fit[1] * fit[1] * bent_noise
    normal[1, 1] -= share * noise
    return left


@compiled
def solve_four(normal: Any, slope: Any, fixed: int) -> bool:
    """Solve the first four normal equations in place; unknown `fixed` stays 0 unless it is -1."""
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
    return True
