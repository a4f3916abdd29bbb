"""The pose of a tool out of /tf: of every frame between it and a base frame the newest transform.

The tool's pose is told with each message that moves one of these frames, at the stamp of what
moved; a message of other frames says nothing of the tool.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from hc_estimator.ros.channel import Channel, SubscriptionError
from hc_estimator.stream.contact_frame import Quaternion, Vector, unit_quaternion
from hc_estimator.stream.frames import FrameTree
from hc_msgs_py.units import nanoseconds_from_stamp

_STATIC_QOS = QoSProfile(
    depth=100,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
"""As tf2 listens to /tf_static: who comes late gets what was told once."""


class ToolFrames:
    """Subscribes to /tf and /tf_static, and tells the poses of a frame.

    Attributes:
        channel: the topic of the frames that move.
        missing: messages while nothing connects the two frames.
        unusable: transforms whose quaternion has no length.
    """

    def __init__(
        self,
        node: Node,
        topic: str,
        take: Callable[[int, str, Vector, Quaternion], None],
        *,
        skip: Callable[[int], None],
        fail: Callable[[Exception], None],
    ) -> None:
        """Start listening.

        Args:
            node: the node.
            topic: name of the topic of frames that move; the other one has `_static` behind it.
            take: takes a stamp [ns], the base frame, where the tool's frame is in it [m], and its
                attitude.
            skip: hears how many messages were left out.
            fail: hears of what was raised where no executor would.

        Raises:
            SubscriptionError: if a topic cannot be subscribed to.
        """
        self.missing = self.unusable = 0
        self._take = take
        self._base = self._tool = ""
        self._frames = FrameTree()
        self._moved: dict[str, int] = {}  # stamps [ns] of the frames that are not fixed
        self._waiting_ns: int | None = None  # of a pose that waits for the rest of its frames
        kind = _message_type()
        self.channel = Channel(
            node, kind, topic, self._take_moving, skip=skip, fail=fail, one_publisher=False
        )
        try:
            self._fixed = Channel(
                node,
                kind,
                f"{topic}_static",
                self._take_fixed,
                skip=lambda _number: None,
                fail=fail,
                qos=_STATIC_QOS,
                one_publisher=False,
            )
        except SubscriptionError:
            self.channel.close()
            raise

    def configure(self, values: Mapping[str, Any]) -> None:
        """Take other frames."""
        self._tool = values["input.position.child_frame"]
        self._base = values["input.position.base_frame"]

    def close(self) -> None:
        """Stop listening."""
        self.channel.close()
        self._fixed.close()

    def _take_moving(self, message: Any) -> None:
        """Tell the pose of the tool's frame, if the message says anything new of it.

        Where frames between base and tool come in messages of their own, the pose waits for those
        of the same stamp: until the first later one.
        """
        stamps = {
            _name(t.child_frame_id): nanoseconds_from_stamp(t.header.stamp)
            for t in message.transforms
        }
        waiting_ns = self._waiting_ns
        if waiting_ns is not None and self._newest(stamps) > waiting_ns:
            self._tell(waiting_ns)
        self._moved |= self._add(message)
        chain = self._chain()
        if chain is None:
            self.missing += 1
            return
        newest_ns = self._newest(stamps)
        if newest_ns < 0:
            return  # of other frames
        if all(self._moved.get(frame, newest_ns) == newest_ns for frame in chain):
            self._tell(newest_ns)
        else:
            self._waiting_ns = newest_ns

    def _take_fixed(self, message: Any) -> None:
        self._add(message)

    def _chain(self) -> frozenset[str] | None:
        """Return the frames between base and tool; None if they are not known yet."""
        base = self._base or self._frames.parent(self._tool)
        return None if base is None else self._frames.between(base, self._tool)

    def _newest(self, stamps: Mapping[str, int]) -> int:
        """Return the newest stamp [ns] of frames between base and tool; -1 without any."""
        return max((stamps[f] for f in self._chain() or () if f in stamps), default=-1)

    def _tell(self, stamp_ns: int) -> None:
        """Tell the pose of the tool's frame, as it is known now, at a stamp."""
        self._waiting_ns = None
        base = self._base or self._frames.parent(self._tool)
        pose = None if base is None else self._frames.pose(base, self._tool)
        if base is not None and pose is not None:
            self._take(stamp_ns, base, *pose)

    def _add(self, message: Any) -> dict[str, int]:
        """Take in the transforms of a message; return their stamps [ns] by frame."""
        stamps = {}
        for transform in message.transforms:
            place, turn = transform.transform.translation, transform.transform.rotation
            try:
                turned = unit_quaternion((turn.x, turn.y, turn.z, turn.w))
            except ValueError:
                self.unusable += 1
                continue
            child = _name(transform.child_frame_id)
            pose = ((place.x, place.y, place.z), turned)
            self._frames.add(_name(transform.header.frame_id), child, pose)
            stamps[child] = nanoseconds_from_stamp(transform.header.stamp)
        return stamps


def _message_type() -> Any:
    """Return the class of /tf's messages, which not every installation has.

    Raises:
        SubscriptionError: if this one has not.
    """
    try:
        from tf2_msgs.msg import TFMessage
    except ImportError as error:
        raise SubscriptionError(
            "input.position.type = 'tf' needs the package tf2_msgs, which is not installed"
        ) from error
    return TFMessage


def _name(frame: str) -> str:
    """Return a frame's name; older software writes a slash before it."""
    return frame.removeprefix("/")
