"""The pose of a tool out of /tf, in the node: stream/frame_poses.py with its two subscriptions."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from rclpy.node import Node

from hc_estimator.ros.channel import Channel, SubscriptionError
from hc_estimator.stream.contact_frame import Quaternion, Vector
from hc_estimator.stream.frame_poses import FramePoses
from hc_msgs_py.qos import FIXED_FRAMES_QOS


class ToolFrames:
    """Subscribes to /tf and /tf_static, and tells the poses of a frame.

    Attributes:
        channel: the topic of the frames that move.
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
        self._poses = FramePoses(take)
        kind = _message_type()
        self.channel = Channel(
            node,
            kind,
            topic,
            self._poses.take_moving,
            skip=skip,
            fail=fail,
            one_publisher=False,
        )
        try:
            self._fixed = Channel(
                node,
                kind,
                f"{topic}_static",
                self._poses.take_fixed,
                skip=lambda _number: None,
                fail=fail,
                qos=FIXED_FRAMES_QOS,
                one_publisher=False,
            )
        except SubscriptionError:
            self.channel.close()
            raise

    @property
    def missing(self) -> int:
        """Messages while nothing connects the two frames."""
        return self._poses.missing

    @property
    def unusable(self) -> int:
        """Transforms whose quaternion has no length."""
        return self._poses.unusable

    def configure(self, values: Mapping[str, Any]) -> None:
        """Take other frames."""
        self._poses.follow(
            values["input.position.child_frame"], values["input.position.base_frame"]
        )

    def close(self) -> None:
        """Stop listening."""
        self.channel.close()
        self._fixed.close()


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
