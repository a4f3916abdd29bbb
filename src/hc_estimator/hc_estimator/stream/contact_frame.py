"""Depth and force along the normal of a surface, from the pose and the wrench of a tool.

Vectors are tuples: a thousand samples a second are turned one by one, and numpy takes ten times as
long for three numbers. Quaternions are (x, y, z, w), as in geometry_msgs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]

UPRIGHT: Quaternion = (0.0, 0.0, 0.0, 1.0)
METRE_IN_MM = 1000.0


def rotated(q: Quaternion, v: Vector) -> Vector:
    """Return a vector of the turned frame in the frame that it is turned against."""
    x, y, z, w = q
    a, b, c = v
    # t = 2 q x v; v + w t + q x t
    tx, ty, tz = 2.0 * (y * c - z * b), 2.0 * (z * a - x * c), 2.0 * (x * b - y * a)
    return (
        a + w * tx + y * tz - z * ty,
        b + w * ty + z * tx - x * tz,
        c + w * tz + x * ty - y * tx,
    )


def inverse(q: Quaternion) -> Quaternion:
    """Return the turn back."""
    return -q[0], -q[1], -q[2], q[3]


def product(p: Quaternion, q: Quaternion) -> Quaternion:
    """Return the turn q followed by p."""
    a, b, c, d = p
    e, f, g, h = q
    return (
        d * e + a * h + b * g - c * f,
        d * f - a * g + b * h + c * e,
        d * g + a * f - b * e + c * h,
        d * h - a * e - b * f - c * g,
    )


def unit_quaternion(values: Sequence[float]) -> Quaternion:
    """Return a quaternion of length 1.

    Raises:
        ValueError: if it is not four finite numbers, not all of them zero.
    """
    length = math.hypot(*values) if len(values) == 4 else math.nan
    if not (math.isfinite(length) and length > 0.0):
        raise ValueError(f"{list(values)!r} is no quaternion (x, y, z, w)")
    x, y, z, w = (value / length for value in values)
    return x, y, z, w


def unit_vector(values: Sequence[float]) -> Vector:
    """Return a vector of length 1.

    Raises:
        ValueError: if it is not three finite numbers, not all of them zero.
    """
    length = math.hypot(*values) if len(values) == 3 else math.nan
    if not (math.isfinite(length) and length > 0.0):
        raise ValueError(f"{list(values)!r} is not three finite numbers, not all of them zero")
    x, y, z = (value / length for value in values)
    return x, y, z


class Payload(NamedTuple):
    """What hangs on the force sensor, and its offset.

    Attributes:
        mass: [kg].
        center: centre of mass in the sensor's frame [m].
        force_bias: reading without load [N].
    """

    mass: float = 0.0
    center: Vector = (0.0, 0.0, 0.0)
    force_bias: Vector = (0.0, 0.0, 0.0)


class ContactFrame(NamedTuple):
    """How depth and force come from pose and wrench.

    Attributes:
        point: a point of the surface in the base frame [m].
        normal: of the surface, out of the tissue, in the base frame; length 1.
        tip: of the tool, in the frame of the pose [m].
        mounting: attitude of the force sensor in the frame of the pose.
        in_base: whether the wrench comes in the base frame already.
        gravity: in the base frame [m/s^2].
        payload: what hangs on the sensor.
    """

    point: Vector = (0.0, 0.0, 0.0)
    normal: Vector = (0.0, 0.0, 1.0)
    tip: Vector = (0.0, 0.0, 0.0)
    mounting: Quaternion = UPRIGHT
    in_base: bool = False
    gravity: Vector = (0.0, 0.0, -9.81)
    payload: Payload = Payload()

    def tip_at(self, position: Vector, attitude: Quaternion) -> Vector:
        """Return the tip of the tool in the base frame [m].

        Args:
            position: of the frame of the pose [m].
            attitude: of that frame.
        """
        offset = rotated(attitude, self.tip)
        return position[0] + offset[0], position[1] + offset[1], position[2] + offset[2]

    def depth_mm(self, tip: Vector) -> float:
        """Return how deep the tip is below the surface [mm]."""
        point, normal = self.point, self.normal
        return -METRE_IN_MM * (
            (tip[0] - point[0]) * normal[0]
            + (tip[1] - point[1]) * normal[1]
            + (tip[2] - point[2]) * normal[2]
        )

    def contact_force(self, force: Vector, attitude: Quaternion) -> Vector:
        """Return the force without weight and offset, in the base frame [N].

        Args:
            force: as the sensor reads it [N].
            attitude: of the frame of the pose.
        """
        mass, _center, bias = self.payload
        gravity = self.gravity
        if self.in_base:
            turned = force[0] - bias[0], force[1] - bias[1], force[2] - bias[2]
        else:
            sensor = product(attitude, self.mounting)
            turned = rotated(sensor, (force[0] - bias[0], force[1] - bias[1], force[2] - bias[2]))
        return (
            turned[0] - mass * gravity[0],
            turned[1] - mass * gravity[1],
            turned[2] - mass * gravity[2],
        )

    def along_normal(self, force: Vector) -> float:
        """Return the component of a force in the base frame that the surface pushes back with."""
        normal = self.normal
        return force[0] * normal[0] + force[1] * normal[1] + force[2] * normal[2]
