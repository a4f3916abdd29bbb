"""Are force and displacement exchanged? A column that was named wrongly looks like a stiff contact.

In the air the position moves and the force does not; from the surface on the force grows, ever
faster. Exchanged, the displacement stands still while the force moves, and then grows ever faster
with it. A tool that is parked while its force changes (a tissue that breathes beneath it, a hand, a
drift) stands still too, but once it presses its depth grows ever slower with the force. Without a
way through the air the law is too even to tell one from the other: then nothing is said.

Of recordings alone: the topics of a robot have types, by which nobody exchanges them.
"""

from __future__ import annotations

import math
from itertools import product

import numpy as np

from hc_estimator.stream.free_motion import free_motion, going_down
from hc_estimator.stream.readings import (
    LEAST_SAMPLES,
    Check,
    FloatArray,
    Suspicion,
    moves,
    robust_range,
    whole,
)

_LEVEL_SHARE = 0.2
"""Of its range: a force in the air is so near to zero, a tool that is parked need not be."""
_MIDDLE = 0.49
"""Share of the whole rise that is reached half way, in a law that grows ever faster."""
_WIDTH = 0.05
_NEXT_TO_TOP = 0.95


def exchanged(displacement_mm: FloatArray, force_n: FloatArray) -> Suspicion | None:
    """Say so if the two look exchanged.

    Args:
        displacement_mm: what is called the penetration [mm], shape (samples,); none is NaN.
        force_n: what is called the contact force [N] at the same times, shape (samples,).
    """
    if len(force_n) < LEAST_SAMPLES or not (moves(displacement_mm) and moves(force_n)):
        return None
    signs = tuple(product((1.0, -1.0), repeat=2))
    if any(whole(free_motion(s * displacement_mm, t * force_n)) is not None for s, t in signs):
        return None  # it goes through the air as it should
    for s, t in signs:
        still = _stands_still(s * displacement_mm, t * force_n)
        if still is not None:
            level, surface = s * still[0], t * still[1]
            start = t * robust_range(t * force_n)[0]
            sentence = (
                f"the displacement stands at {level:.3g} mm while the force goes from {start:.3g} "
                f"to {surface:.3g} N, and from there on it grows ever faster: as if force and "
                "displacement were exchanged; name the columns the other way round (--columns "
                "displacement=...,force=... and --units)"
            )
            return Suspicion(Check.EXCHANGED, "both", sentence)
    return None


def _stands_still(depth: FloatArray, newtons: FloatArray) -> tuple[float, float] | None:
    """Return where the depth stands [mm] and up to which force [N], if it is a force in fact."""
    down = going_down(newtons)
    if np.count_nonzero(down) < LEAST_SAMPLES:
        return None
    low, high = robust_range(depth)
    depth, newtons = depth[down], newtons[down]
    found = whole(free_motion(newtons, depth))
    if found is None:
        return None
    level, surface = found
    if abs(level) > _LEVEL_SHARE * (high - low):
        return None
    rise = robust_range(newtons)[1] - surface

    def reached(share: float) -> float:
        near = np.abs(newtons - surface - share * rise) < _WIDTH * rise
        return float(np.median(depth[near])) - level if near.any() else math.nan

    return found if reached(0.5) < _MIDDLE * reached(_NEXT_TO_TOP) else None
