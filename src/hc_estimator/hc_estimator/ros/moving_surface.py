"""The pose of a surface that moves, as a topic."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

from geometry_msgs.msg import PoseStamped
from rclpy.node import Node

from hc_estimator.ros.channel import Channel
from hc_estimator.stream.contact_frame import rotated, unit_quaternion
from hc_estimator.stream.poses import SurfacePose
from hc_msgs_py.units import nanoseconds_from_stamp


class MovingSurface:
    """Subscribes to a surface's pose.

    Attributes:
        channel: the topic.
        silence_s: without a pose for so long the surface counts as silent.
        unusable: poses that are not finite, or whose quaternion has no length.
    """

    def __init__(
        self,
        node: Node,
        topic: str,
        take: Callable[[int, SurfacePose], None],
        fail: Callable[[Exception], None],
    ) -> None:
        """Start listening.

        Args:
            node: the node.
            topic: name of the surface's topic.
            take: takes a stamp [ns], and where the surface was then.
            fail: hears of what was raised where no executor would.

        Raises:
            SubscriptionError: if the topic cannot be subscribed to.
        """
        self.unusable = 0
        self.silence_s = 0.0
        self._take = take
        self.channel = Channel(
            node, PoseStamped, topic, self._take_pose, skip=lambda _number: None, fail=fail
        )

    @property
    def problems(self) -> list[str]:
        """Say that the poses have stopped coming."""
        silent_s = (time.time_ns() - self.channel.received_ns) * 1e-9
        if not self.channel.received or silent_s <= self.silence_s:
            return []
        return [
            f"no pose on {self.channel.topic} for {silent_s:.1f} s: the surface is taken to stay "
            "where it was"
        ]

    def _take_pose(self, message: Any) -> None:
        q, point = message.pose.orientation, message.pose.position
        place = (point.x, point.y, point.z)
        try:
            normal = rotated(unit_quaternion((q.x, q.y, q.z, q.w)), (0.0, 0.0, 1.0))
        except ValueError:
            self.unusable += 1
            return
        if not all(map(math.isfinite, place)):
            self.unusable += 1
            return
        self._take(nanoseconds_from_stamp(message.header.stamp), SurfacePose(place, normal))
