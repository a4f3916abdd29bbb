"""Frames of /tf that may be the tool's, from the command line: which move, and where they hang.

Of an arm whose every link is a frame only a few are proposed: the frame in which a wrench is told,
for that is the tool's sensor, and those on which no other one hangs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from hc_bringup.graph import Graph
from hc_estimator.stream.frame_poses import FramePoses, plain_name, tool_frames
from hc_logger.type_names import FRAMES_TYPE
from hc_msgs_py.interface_class import interface_class
from hc_msgs_py.qos import FIXED_FRAMES_QOS, SAMPLE_QOS

FRAMES = FRAMES_TYPE


class FrameListener:
    """Subscribes to a topic of frames, and to its other half: those that are told once."""

    def __init__(
        self,
        graph: Graph,
        topic: str,
        poses: FramePoses,
        hear: Callable[[Any], None] = lambda _message: None,
    ) -> None:
        """Begin.

        Args:
            graph: where the topic is.
            topic: its full name.
            poses: takes the messages.
            hear: hears each message of frames that move before that.
        """
        self._graph = graph

        def take(message: Any) -> None:
            hear(message)
            poses.take_moving(message)

        node, kind = graph.node, interface_class(FRAMES)
        self._subscriptions = [
            node.create_subscription(kind, topic, take, SAMPLE_QOS),
            node.create_subscription(kind, f"{topic}_static", poses.take_fixed, FIXED_FRAMES_QOS),
        ]

    def close(self) -> None:
        """Listen no more."""
        for subscription in self._subscriptions:
            self._graph.node.destroy_subscription(subscription)


class FrameSearch:
    """Finds the frames of one topic that move.

    Attributes:
        topic: its full name.
        heard: messages of frames that move came.
    """

    def __init__(self, graph: Graph, topic: str, keep: Callable[[str, Any], None]) -> None:
        """Begin.

        Args:
            graph: where the topic is.
            topic: its full name.
            keep: hears of each transform that moves: its frame, and the stamp.
        """
        self.topic = topic
        self.heard = False
        self._keep = keep
        self._poses = FramePoses(lambda *_pose: None)
        self._listener = FrameListener(graph, topic, self._poses, self._hear)

    def _hear(self, message: Any) -> None:
        self.heard = self.heard or bool(message.transforms)
        for transform in message.transforms:
            self._keep(plain_name(transform.child_frame_id), transform.header.stamp)

    def candidates(self, wrench_frames: Iterable[str]) -> list[tuple[str, str, str]]:
        """Return frames that may be the tool's, best first: each with its root, and what moves it.

        Args:
            wrench_frames: frames of the wrenches that there are.
        """
        return tool_frames(self._poses, wrench_frames)

    def close(self) -> None:
        """Listen no more."""
        self._listener.close()
