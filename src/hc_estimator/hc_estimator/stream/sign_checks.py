"""Which channel counts the other way, by how force and depth go together."""

from __future__ import annotations

import numpy as np

from hc_estimator.stream.free_motion import DOWN_SHARE, free_motion, going_down
from hc_estimator.stream.friction_checks import find_friction
from hc_estimator.stream.readings import (
    Check,
    FloatArray,
    Parts,
    Suspicion,
    noise,
    robust_range,
)

RELATED = 0.4
"""Correlation of force and depth from which on the tool is in contact for a good part."""
_CLEAR_OF_NOISE = 10.0
_LONGEST_SHARE = 8
_ELSEWHERE = 10.0
"""Strokes: further from zero a position counts from somewhere else than near the surface."""


def turned_channels(
    depth: FloatArray, newtons: FloatArray, related: float
) -> Parts[list[Suspicion]]:
    """Say which channel counts the other way, or that both do.

    Args:
        depth: penetration [mm], shape (n,).
        newtons: force at the same times [N], shape (n,).
        related: their correlation.
    """
    if abs(related) < RELATED or not _holds_at_rest(depth, newtons, related):
        return []
    low, high = robust_range(newtons)
    shallow, deep = robust_range(depth)
    if related < -RELATED and (yield from _pulls(depth, newtons)):
        sentence = (
            f"the force falls to {low:.3g} N as the displacement grows: it reads a push as a "
            "pull; turn its sign (force.sign)"
        )
        return [Suspicion(Check.SIGN, "force", sentence, -1.0)]
    if related < -RELATED:
        sentence = (
            f"the force grows to {high:.3g} N as the displacement falls to {shallow:.3g} mm: "
            "turn the sign of the displacement (position.sign)"
        )
        return [Suspicion(Check.SIGN, "displacement", sentence, -1.0)]
    below = -low > 2.0 * max(high, 0.0) and -shallow > 2.0 * max(deep, 0.0)
    unknown = 1.0 if below and -deep < _ELSEWHERE * (deep - shallow) else 0.0
    if related > RELATED and (yield from pressed_way(depth, newtons, unknown)) > 0.0:
        sentence = (
            f"force and displacement go down together, to {low:.3g} N and {shallow:.3g} mm: turn "
            "the signs of both (force.sign, position.sign)"
        )
        return [Suspicion(Check.SIGN, "both", sentence, -1.0)]
    return []


def _pulls(depth: FloatArray, newtons: FloatArray) -> Parts[bool]:
    """Whether, of two channels that go against each other, it is the force that is turned."""
    low, high = robust_range(newtons)
    unknown = float(abs(low) > abs(high)) - 0.5
    return (yield from pressed_way(-depth, newtons, unknown)) > 0.0


def pressed_way(depth: FloatArray, newtons: FloatArray, unknown: float) -> Parts[float]:
    """Say, in parts, whether two channels that go together are both turned round.

    A force that is flat at one end of the motion is free there, whatever its zero; friction of a
    cannula makes none flat, and is the same on each way where the tool is free.

    Args:
        depth: penetration or its negative [mm], shape (n,).
        newtons: force or its negative, turned so that it grows with the depth, shape (n,).
        unknown: what to return if no end is free, or both are.

    Returns:
        -1 if neither is turned, 1 if both are.
    """
    right = yield from free_motion(depth, newtons)
    yield
    # Damping makes a force flat at the end of a way in: without a way out that says nothing.
    has_way = np.mean(going_down(-depth)) > DOWN_SHARE
    turned = (yield from free_motion(-depth, -newtons)) if has_way else None
    yield
    free, free_turned = right is not None, turned is not None
    if not (free or free_turned):
        free = (yield from find_friction(depth, newtons)) is not None
        yield
        free_turned = (yield from find_friction(-depth, -newtons)) is not None
    if free == free_turned:
        return unknown
    return -1.0 if free else 1.0


def _holds_at_rest(depth: FloatArray, newtons: FloatArray, related: float) -> bool:
    """Whether force and depth go together the same way once the speed is allowed for.

    Of less than a stroke a damped tissue shows force and depth that go against each other.
    """
    lag, least = 1, _CLEAR_OF_NOISE * noise(depth)
    longest = len(depth) // _LONGEST_SHARE
    while lag < longest and np.median(np.abs(depth[2 * lag :] - depth[: -2 * lag])) < least:
        lag *= 2
    columns = np.stack((depth[lag:-lag], depth[2 * lag :] - depth[: -2 * lag]), axis=1)
    columns -= columns.mean(axis=0)
    slope = np.linalg.lstsq(columns, newtons[lag:-lag] - newtons.mean(), rcond=None)[0][0]
    return bool(slope * related > 0.0)
