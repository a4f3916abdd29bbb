"""What was felt before: points of the contact with one tissue, thinned out.

A recursive filter has no means to see what its new parameters make of the samples that it has
used up; least squares over remembered ones has (`batch_fit`). What is remembered are the points of
the grid of `delay`: local parabolas through the raw readings of both channels, which no hypothesis
has bent. Whenever the memory is full, every second one is forgotten and the spacing doubles, up to
`LONGEST`; from then on the latest are kept. (Ours; it serves `batch_fit`, whose worth is measured.)
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hc_estimator.compilation import compiled
from hc_estimator.linear_algebra import clear_vector, copy_vector
from hc_estimator.multiple_model import grid as grids
from hc_estimator.multiple_model import smoothing
from hc_estimator.multiple_model.delay_records import GRID
from hc_estimator.multiple_model.local_polynomial import SEXTIC, SMOOTH, TOUCHING
from hc_estimator.multiple_model.records import POINTS
from hc_estimator.multiple_model.spline_records import MEMORIES

LONGEST = 0.02  # time between two remembered points [s]
LEAST_DEPTH = 0.02  # [mm]
SURELY = 3.0  # deviations of the velocity from which on the tool goes deeper
# Of a point: what its velocity for `zero_fit` is from. Unknown where the tissue may let go.
UNKNOWN, WIDE, NARROW, OF_SEXTIC = 0, 1, 2, 3
# In the noise of velocities: that of a parabola and a share of a cubic (`batch_fit`), and that of
# a quintic.
OF_FIT, OF_QUINTIC = 0, 4
FEWEST_KNOWN = 60  # points whose velocity is known, for a fit with splines or zeros
# Time constants of the memories of the force [s]. A tissue that relaxes in a sum of exponentials
# pushes with a law of the depth less a sum of such means of its past force; half a decade apart
# they are dense enough.
MEMORY_TIMES = np.array([0.05, 0.15, 0.5, 1.5, 5.0])


@compiled
def reset(history: Any) -> None:
    """Nothing was felt of this tissue yet."""
    history.version += 1
    history.count = 0
    history.first = 0
    history.contact = 0
    history.begun = 0
    history.every = 1
    history.waited = 0
    history.unfitted = 0
    history.fitted = 0
    history.trembles = 0
    history.realigned = 0.0
    clear_vector(history.held)


@compiled
def copy(other: Any, history: Any) -> None:
    """Copy from another history what fits with splines ask for."""
    for k in range(min(other.count, POINTS)):
        history.points[k] = other.points[k]
    copy_vector(other.velocity_std, history.velocity_std)
    copy_vector(other.velocity_noise, history.velocity_noise)
    history.half_width = other.half_width
    history.count = other.count
    history.begun = other.begun
    history.every = other.every
    history.version = other.version


@compiled
def move(history: Any, displacement: float, force: float, begun: float, now: float) -> None:
    """The zeros have moved by so much [mm], [N]; what was felt is the same.

    The force's zero evenly from one time to another [s]; at once where they are the same.
    """
    for k in range(max(history.count - POINTS, 0), history.count):
        point = history.points[k % POINTS]
        share = min(max((point.time - begun) / (now - begun), 0.0), 1.0) if now > begun else 1.0
        point.depth -= displacement
        point.force -= share * force
        for i in range(MEMORIES):
            point.memory[i] -= share * force
    history.memory -= force
    history.last_force -= force


@compiled
def realign(history: Any, change: float) -> None:
    """The force is later than was thought [s]: each belongs to a displacement before its point's.

    Points of two delays fit no law, nor any surface that moves, as long as both are remembered.
    """
    for k in range(max(history.count - POINTS, 0), history.count):
        point = history.points[k % POINTS]
        point.depth -= change * (point.motion_velocity - 0.5 * change * point.motion_acceleration)
        point.velocity -= change * point.motion_acceleration
        point.quintic -= change * point.motion_acceleration
        point.motion_velocity -= change * point.motion_acceleration
        point.time -= change
    history.realigned += change


@compiled
def learn(history: Any, finder: Any, noise: Any) -> bool:
    """Take the newest point of the grid; True if it was remembered.

    Args:
        history: changed.
        finder: record of `delay`.
        noise: variances of a reading, shape (2,).
    """
    history.half_width = 0.5 * finder.grid_width
    shift = round(finder.delay / finder.grid_step)
    rest = shift * finder.grid_step - finder.delay
    here = finder.grid_count - 1 - max(-shift, 0)  # of the force
    there = here - shift  # of the displacement
    _remember_force(history, finder, here)
    _look_around(history, finder, shift, rest, noise)
    if min(here, there) < max(finder.grid_count - GRID, 0):
        return False
    place = finder.grid[there % GRID]
    depth = place.displacement + rest * (place.velocity + 0.5 * rest * place.acceleration)
    force = finder.grid[here % GRID].force
    if depth < LEAST_DEPTH or force * force < TOUCHING**2 * noise[1]:
        return False
    # Where the tissue lets go or the tool turns, no parabola fits.
    if (
        place.displacement_left > SMOOTH * noise[0]
        or finder.grid[here % GRID].force_left > SMOOTH * noise[1]
    ):
        return False
    history.waited += 1
    history.unfitted += 1
    if history.waited < history.every:
        return False
    history.waited = 0
    point = history.points[history.count % POINTS]
    point.depth = depth
    point.velocity = place.velocity + rest * place.acceleration
    point.force = force
    point.cubic = place.cubic
    point.by_quintic = 0
    # Parabolas of readings that are far apart are wide enough for a cubic of their own.
    point.motion_velocity = point.velocity + place.cubic
    point.motion_acceleration = place.acceleration
    alone = finder.neighbours < smoothing.FEWEST_NEIGHBOURS
    point.source = _by_itself(place.degree) if alone else UNKNOWN
    # Not that of the grid's point: when the delay goes on to the next one, times would jump.
    point.time = grids.time_of(finder, there) + rest
    point.degree = place.degree
    for i in range(MEMORIES):
        point.memory[i] = history.memory[i]
    history.count += 1
    if history.count == POINTS and history.every * finder.grid_step < 0.75 * LONGEST:
        _thin_out(history)
    return True


@compiled
def _by_itself(degree: int) -> int:
    """What the velocity of a point is from without its neighbours."""
    return OF_SEXTIC if degree == SEXTIC else NARROW


@compiled
def _remember_force(history: Any, finder: Any, here: int) -> None:
    """Take the force of a point of the grid into the means of what was felt, weighed by age."""
    if finder.grid_count == 1:  # a new grid
        history.last_force = 0.0
        clear_vector(history.memory)
    if here < max(finder.grid_count - GRID, 0):
        return
    force = finder.grid[here % GRID].force
    for i in range(MEMORIES):
        share = 1.0 - math.exp(-finder.grid_step / MEMORY_TIMES[i])
        history.memory[i] += share * (0.5 * (history.last_force + force) - history.memory[i])
    history.last_force = force


@compiled
def _is_in_contact_around(finder: Any, here: int, noise: float) -> bool:
    """True if the force of a point and of its neighbours is more than noise."""
    for k in range(here - finder.neighbours, here + finder.neighbours + 1):
        known = max(finder.grid_count - GRID, 0) <= k < finder.grid_count
        if known and finder.grid[k % GRID].force ** 2 < TOUCHING**2 * noise:
            return False
    return True


@compiled
def _look_around(history: Any, finder: Any, shift: int, rest: float, noise: Any) -> None:
    """Take the wide cubic of the latest point whose neighbours and whose force's there are.

    Where the tissue is about to let go, a force is no power of the depth, and shows no zero. That
    is on the way back alone: on the way in a touch shows more of the zeros than all that follows
    (of taps with a contact position off, K was 17 % wrong without it, and 2.6 % with).

    Args:
        history: the point is changed, if it was remembered.
        finder: record of `delay`.
        shift: by how many points of the grid the force is late.
        rest: by how much later than the grid's the point's displacement belongs [s].
        noise: variances of a reading, shape (2,).
    """
    around = finder.neighbours
    away = around + max(shift, 0)
    there = finder.grid_count - 1 - away
    if around < smoothing.FEWEST_NEIGHBOURS or there - around < max(finder.grid_count - GRID, 0):
        return
    time = grids.time_of(finder, there) + rest
    for k in range(history.count - 1, max(oldest(history), history.count - 2 - away) - 1, -1):
        point = history.points[k % POINTS]
        if abs(point.time - time) < 0.5 * finder.grid_step:
            variance = noise[0] * smoothing.VALUE_VARIANCE / grids.readings_of(finder)
            point.by_quintic = 1 if smoothing.take_quintic(finder, there, variance) else 0
            point.quintic = finder.quintic + rest * point.motion_acceleration
            deeper = point.velocity > SURELY * history.velocity_std[OF_FIT]
            if not (deeper or _is_in_contact_around(finder, there + shift, noise[1])):
                return
            point.source = _by_itself(point.degree)
            if smoothing.take_wide(finder, there, variance):
                point.motion_velocity = finder.wide[0] + rest * finder.wide[1]
                point.motion_acceleration = finder.wide[1]
                point.source = WIDE
            return


@compiled
def _thin_out(history: Any) -> None:
    """Forget every second point, and remember half as many from now on."""
    for k in range(POINTS // 2):
        history.points[k] = history.points[2 * k + 1]
    history.count = POINTS // 2
    history.first //= 2
    history.contact //= 2
    history.begun //= 2
    history.every *= 2


@compiled
def oldest(history: Any) -> int:
    """Number of the first point that is still remembered."""
    return max(history.count - POINTS, history.first)  # type: ignore[no-any-return]


@compiled
def begin_at_place(history: Any) -> bool:
    """Begin with the points of the present contact; False if they are the first already."""
    history.version += 1
    is_first = history.begun != history.contact
    history.first = history.contact
    history.begun = history.contact
    return bool(is_first)


@compiled
def of_place(history: Any) -> int:
    """Number of the first point of the present place that is still remembered."""
    return max(history.count - POINTS, history.begun)  # type: ignore[no-any-return]


@compiled
def forget_older_half(history: Any) -> None:
    """Begin with the latest half of the points: no law fits all of them."""
    history.first = (oldest(history) + history.count) // 2


@compiled
def count_known(history: Any, first: int, last: int) -> int:
    """Number of the points from `first` on and before `last` that have a velocity."""
    count = 0
    for k in range(first, last):
        count += 1 if history.points[k % POINTS].source != UNKNOWN else 0
    return count


@compiled
def largest(history: Any, first: int) -> tuple[float, float]:
    """Largest depth [mm] and force [N] of the points from `first` on."""
    deepest, largest = 0.0, 0.0
    for k in range(first, history.count):
        point = history.points[k % POINTS]
        deepest, largest = max(deepest, point.depth), max(largest, point.force)
    return deepest, largest


@compiled
def is_motion_known(history: Any, first: int) -> bool:
    """True if enough points, and at least half of those from `first` on, have a velocity."""
    count = count_known(history, first, history.count)
    return bool(count >= FEWEST_KNOWN and 2 * count >= history.count - first)


@compiled
def noise_of_points(bank: Any) -> tuple[float, float, float]:
    """How noisy the points are, as far as the information goes.

    Returns:
        Variances of displacement [mm^2] and force [N^2] by a point's share in the information; and
        the variance of what is left of a point's readings, over that. Of the middle of a parabola
        it is 9/4 of a reading's over their number.
    """
    finder, noise = bank.delay, bank.sensor_noise
    spacing = finder.grid_step * bank.history.every
    share = bank.clock.period / spacing
    return share * noise[0], share * noise[1], 2.25 * spacing / finder.grid_width
