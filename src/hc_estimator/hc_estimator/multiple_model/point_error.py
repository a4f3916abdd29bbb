"""What else is in the force of a point than the noise of the sensors?

A point's force is the middle of a parabola through 30 ms of readings, at the rates of arms more.
Where the tool touches or leaves within those, the force has a corner that no parabola has: of a
ramp that begins within it, it misses 0.03 of what the ramp is at half its width, as RMS over where
it begins. And where p is below one, a velocity next to nothing is a drag: of a tool that may be at
rest all of the drag may be none, which is far more than the law's tangent says there. Both are as
good as noise of the point. (Without them a fit with the right zeros left 1.5 to 3 times the noise,
on taps and on ramps with rests, and the zeros were never found; `test_untared_taps.py`.)
"""

from __future__ import annotations

from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.multiple_model.normal_equations import law_at

MISSED = 0.03  # of a ramp's height
SURELY = 3.0  # deviations of the velocity from which on a tool moves


@compiled
def of_corner(
    settings: Any,
    law: tuple[float, float, float, float],
    depth: float,
    velocity: float,
    half_width: float,
    out: Any,
) -> float:
    """Mean square of what a parabola misses [N^2]; 0 where the contact does not begin in it.

    Args:
        settings: settings record.
        law: K, B, n and p.
        depth: in its middle [mm].
        velocity: [mm/s].
        half_width: of the parabola [s].
        out: takes derivatives of the law, shape (6,).
    """
    way = abs(velocity) * half_width
    if not abs(depth) < way:
        return 0.0
    missed = MISSED * law_at(settings, law[0], law[1], law[2], law[3], way, velocity, out)
    return float(missed * missed)


@compiled
def of_rest(
    settings: Any,
    law: tuple[float, float, float, float],
    depth: float,
    velocity: float,
    deviation: float,
    out: Any,
) -> float:
    """Square of the drag of a tool that may be at rest [N^2]; 0 where it surely moves.

    Args:
        settings: settings record.
        law: K, B, n and p.
        depth: [mm].
        velocity: [mm/s].
        deviation: of it [mm/s].
        out: takes derivatives of the law, shape (6,).
    """
    if not abs(velocity) < SURELY * deviation:
        return 0.0
    drag = law_at(settings, law[0], law[1], law[2], law[3], depth, velocity, out)
    drag -= law_at(settings, law[0], law[1], law[2], law[3], depth, 0.0, out)
    return float(drag * drag)
