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
from hc_estimator.multiple_model.delay_records import CANDIDATES, DELAY_POINTS, GRID, IDLE

LEAST_DEPTH = 0.05  # [mm]
SLOWEST = 1e-3  # speed that is kept at least [mm/s]
LEAST_FORCE = 0.02  # of the window's largest
QUICK = 2.0  # squares between what is smoothed more and less, over those of their noise
SURELY = 4.0  # variances of a force, beyond which a square is of more than the noise
LEAST_BACK = 0.2  # of the way deeper that must have been gone back, or the other way round
APART = 0.05  # time between two points that are kept [s]
# What smoothing may flatten: the velocity against a cubic, and each against the grid.
CUBIC, DISPLACEMENT, VELOCITY, FORCE = 0, 1, 2, 3


@compiled
def find_contact(finder: Any) -> int:
    """Mark the points that are in contact for every candidate delay; their number."""
    largest = 0.0
    for k in range(finder.points):
        largest = max(largest, finder.grid[(finder.first + k) % GRID].force)
    count = 0
    # The candidate beyond 60 ms only bounds what is between.
    margin = min(finder.reach, CANDIDATES // 2 - 1) + finder.neighbours
    for k in range(finder.points):
        here = finder.first + k
        inside = True
        for j in range(-finder.neighbours, finder.neighbours + 1):
            if not finder.grid[(here + j) % GRID].force > LEAST_FORCE * largest:
                inside = False
        for j in range(-margin, margin + 1):
            if finder.grid[(here - j) % GRID].displacement < LEAST_DEPTH:
                inside = False
        finder.in_contact[k] = 1 if inside else 0
        count += finder.in_contact[k]
    return count


@compiled
def forget(finder: Any) -> None:
    """No point is kept, none of those that are in the grid by now will be, and no fit to them."""
    finder.kept = 0
    finder.kept_from = finder.grid_count
    fit_anew(finder)


@compiled
def fit_anew(finder: Any) -> None:
    """What was fitted no longer holds; the points that are kept do."""
    finder.clear = 0
    _forget_fit(finder)


@compiled
def _forget_fit(finder: Any) -> None:
    """The next window begins another fit, from the first laws on."""
    finder.fitted = 0
    finder.fits = 0
    finder.stage = IDLE
    finder.side = 0


@compiled
def move(finder: Any, displacement: float, force: float) -> None:
    """Let all points have zeros that are larger by so much [mm], [N]."""
    for k in range(DELAY_POINTS):
        kept_point = finder.kept_points[k]
        for j in range(CANDIDATES):
            candidate = kept_point.candidates[j]
            candidate.displacement -= displacement
        for i in range(4):
            kept_point.forces[i] -= force
    if finder.stage != IDLE:  # the fit that goes on is of points that are others now
        _forget_fit(finder)


@compiled
def take(finder: Any) -> None:
    """Keep some points of a smoothed window whose contact is marked.

    Smoothing may flatten the force beyond its noise. Where it does not flatten the motion, it is
    the law that bends (damping, where the tool turns): the force of the grid is kept. Where it
    does, it flattens both alike, but not quite, and such points count less.
    """
    finder.kept_from = min(finder.kept_from, finder.grid_count)  # the grid has begun anew
    if finder.first < finder.kept_from:
        return  # what was before is in this window
    centre, grid, smooths = CANDIDATES // 2, finder.grid, finder.smooth
    origin = finder.grid_next - finder.grid_step * finder.grid_count  # time of point 0
    velocities, forces = finder.velocity_noise, finder.force_noise
    every = max(round(APART / finder.grid_step), 1)
    # Taps come back to the same phases: with another first point in each window these differ.
    contact = finder.windows % every
    quick, noise = 0, velocities[0] + velocities[1]
    if finder.neighbours >= smoothing.FEWEST_NEIGHBOURS:
        quick = 1 if _is_flattened(finder, CUBIC, quick, noise) else 0
    bends = _is_flattened(finder, DISPLACEMENT, quick, finder.depth_noise.sum())
    bends = bends or _is_flattened(finder, VELOCITY, quick, velocities[quick] + velocities[2])
    sharp = not bends and _is_flattened(finder, FORCE, quick, forces[0] + forces[1])
    for k in range(finder.points):
        if finder.in_contact[k] == 0:
            continue
        contact += 1
        if contact % every != 0:
            continue
        here = finder.first + k
        kept_point = finder.kept_points[finder.kept % DELAY_POINTS]
        for j in range(centre - finder.reach, centre + finder.reach + 1):
            smooth, candidate = smooths[(here - j + centre) % GRID], kept_point.candidates[j]
            velocity = _velocity(smooth, quick)
            speed = max(abs(velocity), SLOWEST)
            candidate.displacement = smooth.displacement
            candidate.log_speed = math.log(speed)
            candidate.velocity = math.copysign(speed, velocity)
        for i in range(4):
            near = (here + i - 1) % GRID
            kept_point.forces[i] = grid[near].force_by_parabola if sharp else smooths[near].force
        flattened = (smooths[here % GRID].force - grid[here % GRID].force_by_parabola) ** 2
        flattened = max(flattened - SURELY * forces[1], 0.0)
        kept_point.velocity_noise = velocities[quick]
        kept_point.force_noise = forces[1] if sharp else forces[0] + flattened
        kept_point.time = origin + finder.grid_step * here
        kept_point.window = finder.windows
        finder.kept += 1


@compiled
def _velocity(smooth: Any, quick: int) -> float:
    """Velocity of a smoothed point [mm/s]; by a cubic where the motion is quick."""
    return smooth.velocity_by_cubic if quick != 0 else smooth.velocity  # type: ignore[no-any-return]


@compiled
def _is_flattened(finder: Any, what: int, quick: int, noise: float) -> bool:
    """True if smoothing has flattened what a window holds by more than the noise.

    Args:
        finder: with the points that are in contact.
        what: one of CUBIC, DISPLACEMENT, VELOCITY, FORCE.
        quick: 1 where velocities are those by a cubic.
        noise: variance of what is smoothed, and of what is smoothed less.
    """
    total, count = 0.0, 0
    for k in range(finder.points):
        if finder.in_contact[k] != 0:
            slot = (finder.first + k) % GRID
            more, less = finder.smooth[slot], finder.grid[slot]
            if what == CUBIC:
                change = more.velocity - more.velocity_by_cubic
            elif what == DISPLACEMENT:
                change = more.displacement - less.displacement_by_parabola
            elif what == VELOCITY:
                change = _velocity(more, quick) - less.velocity
            else:
                change = more.force - less.force_by_parabola
            total += change**2
            count += 1
    return bool(total > QUICK * noise * count)


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
        kept_point = finder.kept_points[k]
        forces = kept_point.forces
        kept_point.force = (
            before * forces[0] + here * forces[1] + after * forces[2] + last * forces[3]
        )


@compiled
def count_ways(finder: Any) -> int:
    """How many ways, deeper or back, the points go, each by a fifth of their depths or more."""
    count, centre = count_of(finder), CANDIDATES // 2
    least, most = math.inf, -math.inf
    for k in range(count):
        depth = finder.kept_points[k].candidates[centre].displacement
        least, most = min(least, depth), max(most, depth)
    far = LEAST_BACK * (most - least)
    ways, way, gone = 0, 0.0, 0.0  # what was gone the way that is not the present one [mm]
    for age in range(count):
        k = (finder.kept - count + age) % DELAY_POINTS
        step = APART * finder.kept_points[k].candidates[centre].velocity
        gone = max(gone - way * step, 0.0) if ways > 0 else gone + step
        if abs(gone) > far:
            way = -way if ways > 0 else math.copysign(1.0, gone)
            ways += 1
            gone = 0.0
    return ways


@compiled
def go_both_ways(finder: Any) -> bool:
    """True if the points go deeper and back within half seconds, neither five times as far."""
    count = count_of(finder)
    deeper, back, least, most = 0.0, 0.0, 0.0, 0.0
    window = -1
    for age in range(count):
        k = (finder.kept - count + age) % DELAY_POINTS
        kept_point = finder.kept_points[k]
        if kept_point.window != window:
            least, most = least + min(deeper, back), most + max(deeper, back)
            deeper, back = 0.0, 0.0
            window = kept_point.window
        velocity = kept_point.candidates[CANDIDATES // 2].velocity
        deeper += max(velocity, 0.0)
        back += max(-velocity, 0.0)
    least, most = least + min(deeper, back), most + max(deeper, back)
    return bool(least > LEAST_BACK * most)
