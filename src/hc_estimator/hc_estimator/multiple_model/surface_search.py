"""Where is the surface, if nothing explains the force?

A surface that was never seen, millimetres from where the zero says it is, and that moves besides
(an organ that breathes under an arm whose zero is a guess), is out of the reach of a Kalman filter:
the linearisation of d^n does not hold so far, and an exponent of four passes for it for a while.
So once no row explains the force, positions and speeds of the surface are tried on the last second
of local parabolas (the grid of `delay`), K and B of each by linear least squares; the row of a
moving surface begins with the best of them, if that is far better than what is given out, and goes
on as a filter (ours; `hc bench accuracy possible`, arm).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hc_estimator.compilation import compiled
from hc_estimator.multiple_model import grid as grids
from hc_estimator.multiple_model.delay_records import GRID
from hc_estimator.multiple_model.history import SMOOTH, TOUCHING
from hc_estimator.multiple_model.hypotheses import (
    EXPONENT,
    FRESH,
    LOG_DAMPING,
    LOG_STIFFNESS,
    OWN,
    SURFACE,
    SURFACE_ROW,
)
from hc_estimator.multiple_model.kalman import squared_forces, squares_left
from hc_estimator.multiple_model.rows import (
    SMALLEST_LOG_RATIO,
    free_parameters,
    limit,
    seed,
)
from hc_estimator.specification import ParameterSpecification

SPECIFICATIONS = (
    ParameterSpecification(
        "search_surface",
        "bool",
        True,
        "Try positions and speeds of the surface once no hypothesis explains the force.",
    ),
)

AFTER = 0.3  # without a row that fits, before anything is tried [s]
AGAIN = 0.5  # time between two searches [s]
FEWEST = 24  # points
FEWEST_TOUCHING = 12  # points
LEAST_SWING = 0.5  # of the displacement in contact, or depth and surface are one [mm]
# Of the surface below the shallowest contact [mm], and its speed [mm/s].
REACHES = 8.0 * (np.arange(16) / 15.0) ** 2
RATES = np.array([-1.5, -0.75, 0.0, 0.75, 1.5])
STEEPNESS = 1.5  # exponent with which it is searched: a sphere (Hertz 1881)
# Of the forces, that every other row leaves unexplained, both as RMS: a tissue that relaxes leaves
# less, and would pass for a surface that has sunk.
LEAST_MISFIT = 0.25
FAR_BETTER = 0.25  # of the squares that the best row leaves, below which a surface is believed
DEVIATIONS = (0.7, 1.0, 0.4, 0.1)  # of ln K, ln B, n and p of what was found
POSITION_DEVIATION = 0.5  # [mm]
RATE_DEVIATION = 0.75  # [mm/s]
WAIT = 0.4  # in contact until it may be chosen [s]


@compiled
def reset(search: Any) -> None:
    """Nothing is searched for."""
    search.unexplained_time = 0.0
    search.waited = AGAIN


@compiled
def look(settings: Any, bank: Any) -> None:
    """Look for the surface if no row has explained the force for long enough.

    Args:
        settings: settings record.
        bank: its records `search` and `rows` are changed; called at each point of the grid.
    """
    search, chosen, elapsed = bank.search, bank.rows[bank.judge.chosen], bank.delay.grid_step
    surface = bank.rows[SURFACE_ROW]
    search.waited = min(search.waited + elapsed, AGAIN)
    explained = SURFACE[chosen.index] and chosen.model_error == 0.0
    explained = explained or _is_explained(bank.rows)
    wanted = settings.search_surface != 0 and surface.active != 0
    if explained or not wanted or bank.change.testing != 0:
        search.unexplained_time = 0.0
        return
    search.unexplained_time += elapsed
    waits = bank.tool.contact_clock < surface.counts_from
    if search.unexplained_time < AFTER or search.waited < AGAIN or waits:
        return
    search.waited = 0.0
    if not _gather(bank):
        return
    left = _least_squares(settings, search, bank.rows)
    if (
        left > LEAST_MISFIT**2 * squared_forces(search.points, 0, search.count)
        and _try_all(search) < FAR_BETTER * left
    ):
        _begin(settings, bank, surface, chosen)


@compiled
def _is_explained(rows: Any) -> bool:
    """True if a row with a surface that stays has no model error."""
    for m in range(FRESH):
        if rows[m].active != 0 and not SURFACE[m] and rows[m].model_error == 0.0:
            return True
    return False


@compiled
def _gather(bank: Any) -> bool:
    """Take the grid's points where parabolas fit; False if they are too few.

    Depth, velocity, force and time from now of the points of `search` are set.
    """
    finder, search, noise = bank.delay, bank.search, bank.sensor_noise
    shift = round(finder.delay / finder.grid_step)
    search.count = 0
    touching, shallowest, deepest = 0, math.inf, -math.inf
    search.touching_force = TOUCHING * math.sqrt(noise[1])
    for k in range(max(finder.grid_count - GRID, 0), finder.grid_count):
        there = k - shift
        if there < max(finder.grid_count - GRID, 0) or there >= finder.grid_count:
            continue
        place, here = finder.grid[there % GRID], finder.grid[k % GRID]
        if place[4] > SMOOTH * noise[0] or here[5] > SMOOTH * noise[1]:
            continue
        point = search.points[search.count]
        point[0] = place[0]
        point[1] = place[1]
        point[2] = here[3]
        point[3] = grids.time_of(finder, there) - bank.clock.state_time
        search.count += 1
        if point[2] > search.touching_force:
            touching += 1
            shallowest, deepest = min(shallowest, point[0]), max(deepest, point[0])
    enough = search.count >= FEWEST and touching >= FEWEST_TOUCHING
    return bool(enough and deepest - shallowest > LEAST_SWING)


@compiled
def _try_all(search: Any) -> float:
    """Least squares left by any position and speed of the surface; search.best says which."""
    least = math.inf
    for rate in RATES:
        shallowest = math.inf
        for i in range(search.count):
            point = search.points[i]
            if point[2] > search.touching_force:
                shallowest = min(shallowest, point[0] - rate * point[3])
        for reach in REACHES:
            squares, stiffness, damping = _try(search, shallowest - reach, rate)
            if squares < least:
                least, best = squares, search.best
                best[0], best[1] = shallowest - reach, rate
                best[2], best[3] = stiffness, damping
    return least


@compiled
def _try(search: Any, position: float, rate: float) -> tuple[float, float, float]:
    """Squares [N^2] left by the best K and B on a surface [mm], [mm/s]; and these."""
    xx, xy, yy, xf, yf, ff = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(search.count):
        point = search.points[i]
        force = point[2]
        ff += force * force
        depth = point[0] - position - rate * point[3]
        if depth <= 0.0:
            continue
        x = depth * math.sqrt(depth)  # by STEEPNESS
        y = x * (point[1] - rate)
        xx += x * x
        xy += x * y
        yy += y * y
        xf += x * force
        yf += y * force
    determinant = xx * yy - xy * xy
    damping = (xx * yf - xy * xf) / determinant if determinant > 1e-9 * xx * yy else 0.0
    damping = max(damping, 0.0)
    stiffness = (xf - damping * xy) / xx if xx > 0.0 else 0.0
    if stiffness <= 0.0:
        return math.inf, stiffness, damping
    left = ff - 2.0 * (stiffness * xf + damping * yf)
    left += stiffness * stiffness * xx + 2.0 * stiffness * damping * xy + damping * damping * yy
    return max(left, 0.0), stiffness, damping


@compiled
def _least_squares(settings: Any, search: Any, rows: Any) -> float:
    """Squares that the best row with a surface that stays leaves on the same points [N^2]."""
    least = math.inf
    for m in range(FRESH):
        row = rows[m]
        if row.active == 0 or SURFACE[m]:
            continue
        least = min(least, squares_left(settings, search.points, 0, search.count, row))
    return least


@compiled
def _begin(settings: Any, bank: Any, row: Any, chosen: Any) -> None:
    """Begin the row of a moving surface with what was found, and the chosen row's motion."""
    best, clock = bank.search.best, bank.tool.contact_clock
    seed(chosen, row, clock, clock + WAIT)
    row.model_error = 0.0
    least = math.exp(SMALLEST_LOG_RATIO) * best[2]
    row.state[LOG_STIFFNESS] = math.log(best[2])
    row.state[LOG_DAMPING] = math.log(max(best[3], 10.0 * least))
    row.state[EXPONENT] = STEEPNESS
    free_parameters(settings, row, DEVIATIONS)
    row.position_deviation = 0.0
    row.state[OWN] = best[0]
    row.state[OWN + 1] = best[1]
    row.covariance[OWN, OWN] = POSITION_DEVIATION**2
    row.covariance[OWN + 1, OWN + 1] = RATE_DEVIATION**2
    limit(settings, row)
