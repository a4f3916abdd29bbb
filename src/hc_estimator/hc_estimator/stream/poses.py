"""Poses of a tool and of a surface, and where they were between two of their stamps."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple, TypeVar

from hc_estimator.stream.contact_frame import Quaternion, Vector
from hc_estimator.stream.merger import Around

LARGEST_TURN = 0.5 * math.pi
"""Between two poses; one that turned by more was not watched on its way: the nearer one counts."""
STRAIGHT = 1e-4
"""Below so many radians the shares of a turn are those of a straight line, to 1e-9."""

Pose = TypeVar("Pose")


class ToolPose(NamedTuple):
    """Where a tool is.

    Attributes:
        place: of its frame in the base frame [m].
        attitude: of its frame, of length 1.
    """

    place: Vector
    attitude: Quaternion


class SurfacePose(NamedTuple):
    """Where a surface is: a point [m], and the normal out of the tissue, of length 1."""

    point: Vector
    normal: Vector


def pose_at(
    stamp_ns: int, around: Around, between: Callable[[Pose, Pose, float], Pose]
) -> Pose | None:
    """Return the pose at a stamp; the nearest, if they all lie on one side; None of none.

    Args:
        stamp_ns: the stamp.
        around: the poses around it.
        between: returns the pose at a share of the way from one to another.
    """
    before, after = around
    if before is None or after is None:
        nearest = before or after
        return None if nearest is None else nearest.value
    span_ns = after.stamp_ns - before.stamp_ns
    if span_ns <= 0:
        pose: Pose = before.value
        return pose
    return between(before.value, after.value, (stamp_ns - before.stamp_ns) / span_ns)


def attitude_between(before: Quaternion, after: Quaternion, share: float) -> Quaternion:
    """Return the attitude at a share of the shorter turn from one to another (slerp)."""
    a, b, c, d = before
    e, f, g, h = after
    cosine = a * e + b * f + c * g + d * h
    if cosine < 0.0:  # q and -q are one attitude
        cosine, e, f, g, h = -cosine, -e, -f, -g, -h
    half = math.acos(min(cosine, 1.0))
    if 2.0 * half > LARGEST_TURN:
        return before if share < 0.5 else after
    if half < STRAIGHT:
        p, q = 1.0 - share, share
    else:
        sine = math.sin(half)
        p, q = math.sin((1.0 - share) * half) / sine, math.sin(share * half) / sine
    return p * a + q * e, p * b + q * f, p * c + q * g, p * d + q * h


def tool_between(before: ToolPose, after: ToolPose, share: float) -> ToolPose:
    """Return where a tool was at a share of the way."""
    place = _point_between(before.place, after.place, share)
    return ToolPose(place, attitude_between(before.attitude, after.attitude, share))


def surface_between(before: SurfacePose, after: SurfacePose, share: float) -> SurfacePose:
    """Return where a surface was at a share of the way.

    Its turns about the normal do not count: whoever tells a plane does not know them.
    """
    x, y, z = _point_between(before.normal, after.normal, share)
    length = math.hypot(x, y, z)
    if length < 0.1:  # the one is nearly the opposite of the other: no turn lies between
        return before if share < 0.5 else after
    point = _point_between(before.point, after.point, share)
    return SurfacePose(point, (x / length, y / length, z / length))


def _point_between(before: Vector, after: Vector, share: float) -> Vector:
    return (
        before[0] + share * (after[0] - before[0]),
        before[1] + share * (after[1] - before[1]),
        before[2] + share * (after[2] - before[2]),
    )
