"""Wider parabolas for the windows of the delay: motion and force as smooth as the hand that moves.

Noise of the velocities bends the least squares of a window: it draws B down, and the delay towards
the points of the grid, where it is another (ours: without this, delays of random contacts were 3 to
10 ms off where the bound is 0.04 to 0.5 ms). A parabola through the neighbouring points of the grid
leaves a sixteenth of its variance. The same weights go over displacement and force, symmetric in
time, so that no delay comes of them, and a motion that they flatten is flattened in both.

Where zeros are looked for (`zero_fit`), velocity and acceleration are those of a cubic of that
width, wherever the motion is one: its slope is (omega half width)^4 / 504 too small, 0.3 % at
3.5 Hz, with a sixth of the variance of the narrow parabola's.

Where noise hides that the tool trembles, the least squares over what was felt (`batch_fit`) take
the slope of a quintic of that width: it has little more variance than the narrow parabola's, which
a hand's tremor of 8 Hz makes 6 % too small and one of 16 Hz 22 %, the quintic's 0.1 and 5 %.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hc_estimator.compilation import compiled
from hc_estimator.multiple_model.delay_records import GRID, NEIGHBOURS

HALF_WIDTH = 0.04  # of the neighbours [s]
# Autocorrelation of the parabolas that the grid's values come from: kernel (9 - 15 x^2) / 8 on
# [-1, 1], by Gauss-Legendre quadrature, exact for polynomials of degree 4.
NODES = np.array([-np.sqrt(0.6), 0.0, np.sqrt(0.6)])
WEIGHTS = np.array([5.0 / 9.0, 8.0 / 9.0, 5.0 / 9.0])
FEWEST_NEIGHBOURS = 3  # to either side that are worth it, and make a wide cubic
SMOOTH = 4.0  # mean square that it leaves over the noise up to which it fits
VALUE_VARIANCE = 2.25  # of a parabola's value, times its readings, over that of a reading
CUBIC, QUINTIC = 3, 5  # degrees
# Width of the parabolas, in that of the neighbours, up to which a quintic through these has about
# the noise of one; beyond (a sensor of less than 175 Hz) it has ten times that.
NARROW = 0.5
BY_CUBIC, BY_QUINTIC = 0, 1  # in `slopes`


def _polynomials(m: int) -> list[list[Fraction]]:
    """Orthogonal polynomials of degrees 0 to QUINTIC on -m to m (Forsythe, SIAM J. 5, 1957)."""
    nodes = [Fraction(j) for j in range(-m, m + 1)]
    found = [[Fraction(1) for _ in nodes]]
    for degree in range(QUINTIC):
        latest = found[-1]
        following = [x * y for x, y in zip(nodes, latest, strict=True)]
        if degree > 0:
            share = _product(latest, latest) / _product(found[-2], found[-2])
            following = [y - share * z for y, z in zip(following, found[-2], strict=True)]
        found.append(following)
    return found


def _product(one: list[Fraction], other: list[Fraction]) -> Fraction:
    """Inner product."""
    return sum((x * y for x, y in zip(one, other, strict=True)), Fraction(0))


def _quintics() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Weights of the slopes of a cubic and a quintic by neighbours; its orthonormal polynomials.

    In fractions: the linear algebra of two processors rounds differently, and so would all that is
    estimated with them.

    Returns:
        Shapes (2, NEIGHBOURS + 1, points) and (NEIGHBOURS + 1, QUINTIC + 1, points).
    """
    points = 2 * NEIGHBOURS + 1
    slopes = np.zeros((2, NEIGHBOURS + 1, points))
    bases = np.zeros((NEIGHBOURS + 1, QUINTIC + 1, points))
    for m in range(FEWEST_NEIGHBOURS, NEIGHBOURS + 1):
        polynomials = _polynomials(m)
        norms = [_product(values, values) for values in polynomials]
        # Slope in the middle of a polynomial that is odd, by a central difference of order six.
        middle = [
            45 * (v[m + 1] - v[m - 1]) - 9 * (v[m + 2] - v[m - 2]) + v[m + 3] - v[m - 3]
            for v in polynomials
        ]
        for i, degree in enumerate((CUBIC, QUINTIC)):
            for j in range(2 * m + 1):
                weights = (middle[k] * polynomials[k][j] / norms[k] for k in range(degree + 1))
                slopes[i, m, j] = float(sum(weights) / 60)
        for k, values in enumerate(polynomials):
            root = math.sqrt(norms[k])
            for j, value in enumerate(values):
                bases[m, k, j] = float(value) / root
    return slopes, bases


SLOPES, QUINTIC_BASES = _quintics()


@compiled
def neighbours(step: float) -> int:
    """Points to either side that are taken along, from the grid's step [s].

    However wide the parabolas are: their values flatten no motion, only neighbours do. Fewer than
    three make velocities noisier than those of the parabolas of a slow sensor are.
    """
    few = int(HALF_WIDTH / step + 0.5)
    return min(few, NEIGHBOURS) if few >= FEWEST_NEIGHBOURS else 0


@compiled
def smooth(finder: Any) -> None:
    """Displacement, velocity and force of a full window's points, smoothed.

    And the velocity by a cubic, which flattens a quick motion less and is noisier.

    In finder.smooth, ring slots as in finder.grid. From finder.first - reach to the window's end
    + reach; the margin of the grid holds the neighbours of these.
    """
    m, step, grid = finder.neighbours, finder.grid_step, finder.grid
    squares, fourths, sixths = _even_sums(m)
    count, odd = 2 * m + 1, squares * sixths - fourths * fourths
    determinant = count * fourths - squares * squares
    for k in range(-finder.reach - 1, finder.points + finder.reach + 1):
        here = finder.first + k
        point, out = grid[here % GRID], finder.smooth[here % GRID]
        if m == 0:
            out.velocity = point.velocity
            out.displacement = point.displacement_by_parabola
            out.force = point.force_by_parabola
            out.velocity_by_cubic = point.velocity
            continue
        y0, y1, y2, y3, f0, f2 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for j in range(-m, m + 1):
            near = grid[(here + j) % GRID]
            value = near.displacement_by_parabola - point.displacement_by_parabola
            force = near.force_by_parabola - point.force_by_parabola
            y0 += value
            y1 += j * value
            y2 += j * j * value
            y3 += j**3 * value
            f0 += force
            f2 += j * j * force
        more = (fourths * y0 - squares * y2) / determinant
        out.displacement = point.displacement_by_parabola + more
        out.velocity = y1 / (squares * step)
        out.velocity_by_cubic = out.velocity
        if m >= FEWEST_NEIGHBOURS:
            out.velocity_by_cubic = (sixths * y1 - fourths * y3) / (odd * step)
        more = (fourths * f0 - squares * f2) / determinant
        out.force = point.force_by_parabola + more


@compiled
def take_wide(finder: Any, here: int, noise: float) -> bool:
    """Velocity and acceleration of a point by a cubic through its neighbours, in finder.wide.

    Args:
        finder: with its grid and neighbours.
        here: number of the point; its neighbours are in the grid.
        noise: variance of a point's displacement [mm^2].

    Returns:
        False if the motion is no cubic there.
    """
    m, step, grid = finder.neighbours, finder.grid_step, finder.grid
    s2, s4, s6 = _even_sums(m)
    count = 2 * m + 1
    reference = grid[here % GRID].displacement
    y0, y1, y2, y3, squares = 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(-m, m + 1):
        value = grid[(here + j) % GRID].displacement - reference
        y0 += value
        y1 += j * value
        y2 += j * j * value
        y3 += j**3 * value
        squares += value * value
    odd, even = s2 * s6 - s4 * s4, count * s4 - s2 * s2
    slope = (s6 * y1 - s4 * y3) / odd
    cube = (s2 * y3 - s4 * y1) / odd
    bend = (count * y2 - s2 * y0) / even
    level = (s4 * y0 - s2 * y2) / even
    left = squares - slope * y1 - cube * y3 - bend * y2 - level * y0
    if left > SMOOTH * (count - 4) * noise:
        return False
    finder.wide[0] = slope / step
    finder.wide[1] = 2.0 * bend / (step * step)
    return True


@compiled
def is_fine(finder: Any) -> bool:
    """True if the parabolas are narrow beside a quintic: it follows a tremor, at little noise."""
    span = 2 * finder.neighbours * finder.grid_step
    return bool(finder.neighbours >= FEWEST_NEIGHBOURS and finder.grid_width < NARROW * span)


@compiled
def take_quintic(finder: Any, here: int, noise: float) -> bool:
    """Velocity of a point by a quintic through its neighbours, in finder.quintic.

    Args:
        finder: with its grid and neighbours.
        here: number of the point; its neighbours are in the grid.
        noise: variance of a point's displacement [mm^2].

    Returns:
        False if the motion is no quintic there, or the parabolas are not narrow beside it.
    """
    m, grid = finder.neighbours, finder.grid
    if not is_fine(finder):
        return False
    reference = grid[here % GRID].displacement
    slope, left = 0.0, 0.0
    for j in range(2 * m + 1):
        value = grid[(here + j - m) % GRID].displacement - reference
        slope += SLOPES[BY_QUINTIC, m, j] * value
        left += value * value
    for k in range(QUINTIC + 1):
        total = 0.0
        for j in range(2 * m + 1):
            value = grid[(here + j - m) % GRID].displacement - reference
            total += QUINTIC_BASES[m, k, j] * value
        left -= total * total
    finder.quintic = slope / finder.grid_step
    return bool(left <= SMOOTH * (2 * m - QUINTIC) * noise)


@compiled
def slope_variance(finder: Any, noise: float, i: int) -> float:
    """Variance of such a velocity [mm^2/s^2].

    Args:
        finder: with neighbours, grid_step and grid_width.
        noise: variance of a point's displacement [mm^2].
        i: `BY_CUBIC` or `BY_QUINTIC`.
    """
    m, step = finder.neighbours, finder.grid_step
    total = 0.0
    for j in range(2 * m + 1):
        for k in range(2 * m + 1):
            both = SLOPES[i, m, j] * SLOPES[i, m, k]
            total += both * _overlap(2.0 * abs(j - k) * step / finder.grid_width)
    return float(noise * total / (step * step))


@compiled
def _even_sums(m: int) -> tuple[float, float, float]:
    """Sums of j^2, j^4 and j^6 from -m to m."""
    s2, s4, s6 = 0.0, 0.0, 0.0
    for j in range(1, m + 1):
        s2 += 2.0 * j**2
        s4 += 2.0 * j**4
        s6 += 2.0 * j**6
    return s2, s4, s6


@compiled
def velocity_variance(finder: Any, noise: float, readings: float) -> float:
    """Variance of a smoothed velocity [mm^2/s^2].

    Args:
        finder: with neighbours, grid_step and grid_width.
        noise: variance of a displacement [mm^2].
        readings: in one parabola of the grid.
    """
    m, step = finder.neighbours, finder.grid_step
    half = 0.5 * finder.grid_width
    squares, total = 0.0, 0.0
    for i in range(-m, m + 1):
        squares += i * i
        for j in range(-m, m + 1):
            total += i * j * _overlap(abs(i - j) * step / half)
    return float(noise * VALUE_VARIANCE / readings * total / (squares * squares * step * step))


@compiled
def _overlap(shift: float) -> float:
    """Correlation of two parabolas' values whose centres are so many half widths apart."""
    if shift >= 2.0:
        return 0.0
    middle, half = 0.5 * shift, 0.5 * (2.0 - shift)
    total = 0.0
    for k in range(3):
        x = middle + half * NODES[k]
        y = x - shift
        total += WEIGHTS[k] * (9.0 - 15.0 * x * x) * (9.0 - 15.0 * y * y)
    return float(half * total / 64.0 / 1.125)
