"""The pose of a surface that moves, as a topic, and the readings that wait for it."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any

from geometry_msgs.msg import PoseStamped
from rclpy.node import Node

from hc_estimator.ros.channel import Channel
from hc_estimator.stream.contact_frame import rotated, unit_quaternion
from hc_estimator.stream.surface_track import HeldReading, SurfacePose, SurfaceWait
from hc_msgs_py.units import nanoseconds_from_stamp


class MovingSurface:
    """Subscribes to a surface's pose and hands readings on with the pose at their stamps.

    Attributes:
        channel: the topic.
        unusable: poses whose quaternion has no length.
    """

    def __init__(
        self,
        node: Node,
        topic: str,
        take: Callable[[HeldReading, SurfacePose], None],
        fail: Callable[[Exception], None],
    ) -> None:
        """Start listening.

        Args:
            node: the node.
            topic: name of the surface's topic.
            take: takes a reading and where the surface was then.
            fail: hears of what was raised where no executor would.

        Raises:
            SubscriptionError: if the topic cannot be subscribed to.
        """
        self.unusable = 0
        self._take = take
        self._wait = SurfaceWait()
        self._silence_s = 0.0
        self.channel = Channel(
            node, PoseStamped, topic, self._take_pose, skip=lambda _number: None, fail=fail
        )

    def configure(self, values: Mapping[str, Any]) -> None:
        """Take other bounds of waiting."""
        self._wait.maximum_wait_ns = round(values["input.pairing.maximum_wait"] * 1e9)
        self._silence_s = values["input.silence_timeout"]

    def hold(self, reading: HeldReading) -> None:
        """Take in a reading, and hand on what need not wait any more."""
        self._wait.hold(reading)
        self._hand_on()

    def clear(self) -> int:
        """Drop the readings that wait; returns how many that were."""
        return self._wait.clear()

    @property
    def oldest_arrival_ns(self) -> int | None:
        """When the oldest reading came that waits; None without one."""
        return self._wait.oldest_arrival_ns

    @property
    def counters(self) -> Mapping[str, int]:
        """Readings that had no pose of the surface."""
        return {
            "surface_missing": self._wait.before_first,
            "surface_late": self._wait.without_pose,
        }

    @property
    def problems(self) -> list[str]:
        """Say that the poses have stopped coming."""
        silent_s = self._silent_s()
        if not self.channel.received or silent_s <= self._silence_s:
            return []
        return [
            f"no pose on {self.channel.topic} for {silent_s:.1f} s: the surface is taken to stay "
            "where it was"
        ]

    def _silent_s(self) -> float:
        """For how long no pose has come; since ever, without one."""
        return (time.time_ns() - self.channel.received_ns) * 1e-9

    def _take_pose(self, message: Any) -> None:
        q, point = message.pose.orientation, message.pose.position
        try:
            normal = rotated(unit_quaternion((q.x, q.y, q.z, q.w)), (0.0, 0.0, 1.0))
        except ValueError:
            self.unusable += 1
            return
        stamp_ns = nanoseconds_from_stamp(message.header.stamp)
        self._wait.add_pose(SurfacePose(stamp_ns, (point.x, point.y, point.z), normal))
        self._hand_on()

    def _hand_on(self) -> None:
        next_ns = self.channel.next_ns()
        silent = next_ns is None and self._silent_s() > self._silence_s
        for reading, pose in self._wait.release(silent=silent, next_pose_ns=next_ns):
            self._take(reading, pose)
