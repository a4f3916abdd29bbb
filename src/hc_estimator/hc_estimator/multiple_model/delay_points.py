"""Points in contact as they would be with each candidate delay: what the delay is fitted to.

Points 50 ms apart are kept. Displacement and velocity at a candidate are those of a
smoothed point some steps earlier or later: candidates stand on the grid. For a delay between two of
them the force is interpolated, which is smooth over many steps.
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.multiple_model import smoothing
from hc_estimator.multiple_model.records import CANDIDATES, DELAY_POINTS, GRID

LEAST_DEPTH = 0.05  # [mm]
SLOWEST = 1e-3  # speed that is kept at least [mm/s]
LEAST_FORCE = 0.02  # of the window's largest
QUICK = 2.0  # squares between the velocities of parabola and cubic, over those of their noise
APART = 0.05  # time between two points that are kept [s]


@compiled
def find_contact(finder: Any) -> int:
    """Mark the points that are in contact for every candidate delay; their number."""
    largest = 0.0
    for k in range(finder.points):
        largest = max(largest, finder.grid[(finder.first + k) % GRID, 3])
    count = 0
    # The candidate beyond 60 ms only bounds what is between.
    margin = min(finder.reach, CANDIDATES // 2 - 1) + finder.neighbours
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
def forget(finder: Any) -> None:
    """No point is kept, and none of those that are in the grid by now will be."""
    finder.kept = 0
    finder.kept_from = finder.grid_count


@compiled
def take(finder: Any, narrow: float, wide: float) -> None:
    """Keep some points of a smoothed window whose contact is marked.

    Args:
        finder: changed.
        narrow: variance of a velocity by a line or parabola [mm^2/s^2].
        wide: the same, by a cubic.
    """
    finder.kept_from = min(finder.kept_from, finder.grid_count)  # the grid has begun anew
    if finder.first < finder.kept_from:
        return  # what was before is in this window
    centre, contact = CANDIDATES // 2, 0
    every = max(round(APART / finder.grid_step), 1)
    column = 4 if _is_quick(finder, narrow, wide) else 1
    for k in range(finder.points):
        if finder.in_contact[k] == 0:
            continue
        contact += 1
        if contact % every != (every + 1) // 2 % every:
            continue
        here = finder.first + k
        slot = finder.kept % DELAY_POINTS
        for j in range(centre - finder.reach, centre + finder.reach + 1):
            smooth = finder.smooth[(here - j + centre) % GRID]
            point = finder.point[slot, j]
            depth, velocity = max(smooth[0], 0.2 * LEAST_DEPTH), smooth[column]
            speed = max(abs(velocity), SLOWEST)
            point[0] = math.log(depth)
            point[1] = math.log(speed)
            point[2] = math.copysign(speed, velocity)
            point[3] = 1.0 / depth
        for i in range(4):
            finder.point_forces[slot, i] = finder.smooth[(here + i - 1) % GRID, 3]
        finder.point_force[slot, 2] = narrow if column == 1 else wide
        finder.point_window[slot] = finder.windows
        finder.kept += 1


@compiled
def _is_quick(finder: Any, narrow: float, wide: float) -> bool:
    """True if the motion of the window is so quick that a parabola flattens it beyond the noise."""
    if finder.neighbours < smoothing.FEWEST_NEIGHBOURS:
        return False
    total, count = 0.0, 0
    for k in range(finder.points):
        if finder.in_contact[k] != 0:
            smooth = finder.smooth[(finder.first + k) % GRID]
            total += (smooth[4] - smooth[1]) ** 2
            count += 1
    return bool(total > QUICK * (narrow + wide) * count)


@compiled
def count_of(finder: Any) -> int:
    """Number of points that are kept."""
    return min(finder.kept, DELAY_POINTS)  # type: ignore[no-any-return]


@compiled
def shift(finder: Any, share: float) -> None:
    """Let the forces be those of a candidate, or of a delay a share of a step above it (cubic)."""
    x = share
    before, here = -x * (x - 1.0) * (x - 2.0) / 6.0, (x + 1.0) * (x - 1.0) * (x - 2.0) / 2.0
    after, last = -(x + 1.0) * x * (x - 2.0) / 2.0, (x + 1.0) * x * (x - 1.0) / 6.0
    for k in range(count_of(finder)):
        forces = finder.point_forces[k]
        total = before * forces[0] + here * forces[1] + after * forces[2] + last * forces[3]
        finder.point_force[k, 0] = total
