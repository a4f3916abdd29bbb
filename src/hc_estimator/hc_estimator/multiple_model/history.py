"""What was felt before: points of the contact with one tissue, thinned out.

A recursive filter has no means to see what its new parameters make of the samples that it has
used up; least squares over remembered ones has (`batch_fit`). What is remembered are the points of
the grid of `delay`: local parabolas through the raw readings of both channels, which no hypothesis
has bent. Whenever the memory is full, every second one is forgotten and the spacing doubles, up to
`LONGEST`; from then on the latest are kept.
"""

from __future__ import annotations

from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.linear_algebra import copy_vector
from hc_estimator.multiple_model import grid as grids
from hc_estimator.multiple_model import smoothing
from hc_estimator.multiple_model.records import GRID, POINTS

LONGEST = 0.02  # time between two remembered points [s]
LEAST_DEPTH = 0.02  # [mm]
TOUCHING = 5.0  # deviations of the force below which it may be none
SMOOTH = 4.0  # mean square left by a parabola over the noise up to which it fits


@compiled
def reset(history: Any) -> None:
    """Nothing was felt of this tissue yet."""
    history.count = 0
    history.first = 0
    history.every = 1
    history.waited = 0
    history.unfitted = 0
    history.fitted = 0
    for i in range(4):
        history.held[i] = 0


@compiled
def learn(history: Any, finder: Any, noise: Any) -> bool:
    """Take the newest point of the grid; True if it was remembered.

    Args:
        history: changed.
        finder: record of `delay`.
        noise: variances of a reading, shape (2,).
    """
    shift = round(finder.delay / finder.grid_step)
    rest = shift * finder.grid_step - finder.delay
    around = finder.neighbours if finder.neighbours >= smoothing.FEWEST_NEIGHBOURS else 0
    here = finder.grid_count - 1 - max(around - shift, 0)  # of the force
    there = here - shift  # of the displacement
    first = max(finder.grid_count - GRID, 0)
    if min(here, there) < first:
        return False
    place = finder.grid[there % GRID]
    depth = place[0] + rest * (place[1] + 0.5 * rest * place[2])
    force = finder.grid[here % GRID, 3]
    if depth < LEAST_DEPTH or force * force < TOUCHING**2 * noise[1]:
        return False
    # Where the tissue lets go or the tool turns, no parabola fits.
    if place[4] > SMOOTH * noise[0] or finder.grid[here % GRID, 5] > SMOOTH * noise[1]:
        return False
    history.waited += 1
    history.unfitted += 1
    if history.waited < history.every:
        return False
    history.waited = 0
    point = history.points[history.count % POINTS]
    point[0] = depth
    point[1] = place[1] + rest * place[2]
    point[2] = force
    point[4] = place[6]
    velocity, acceleration, is_cubic = place[1], place[2], around == 0
    if around > 0 and there - around >= first:
        variance = noise[0] * smoothing.VALUE_VARIANCE / grids.readings_of(finder)
        is_cubic = smoothing.take_wide(finder, there, variance)
        velocity, acceleration = finder.wide[0], finder.wide[1]
    point[5] = velocity + rest * acceleration
    point[6] = acceleration
    point[7] = 1.0 if is_cubic else 0.0
    history.count += 1
    if history.count == POINTS and history.every * finder.grid_step < 0.75 * LONGEST:
        _thin_out(history)
    return True


@compiled
def _thin_out(history: Any) -> None:
    """Forget every second point, and remember half as many from now on."""
    for k in range(POINTS // 2):
        copy_vector(history.points[2 * k + 1], history.points[k])
    history.count = POINTS // 2
    history.first //= 2
    history.every *= 2


@compiled
def oldest(history: Any) -> int:
    """Number of the first point that is still remembered."""
    return max(history.count - POINTS, history.first)  # type: ignore[no-any-return]


@compiled
def forget_older_half(history: Any) -> None:
    """Begin with the latest half of the points: no law fits all of them."""
    history.first = (oldest(history) + history.count) // 2
