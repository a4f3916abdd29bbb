"""Where the node's samples come from: the topic indenter/sample.

The queue is bounded by the topic's depth. When the node cannot keep up, the newest samples are
worth more than the oldest: those beyond the allowed backlog are left out and counted.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any

from hc_msgs.msg import IndenterSample
from rclpy.node import Node

from hc_msgs_py.qos import SAMPLE_QOS, STREAM_DEPTH
from hc_msgs_py.topics import SAMPLE
from hc_msgs_py.units import METRE_IN_MM, nanoseconds_from_stamp

Process = Callable[[int, int, float, float], None]
"""Takes stamp [ns], sequence, displacement [mm] and force [N]."""


class SampleInput:
    """Subscribes to indenter/sample and hands every sample on.

    Attributes:
        maximum_backlog: samples that may wait; more are skipped.
        frame_id: frame of the newest sample.
    """

    def __init__(
        self,
        node: Node,
        process: Process,
        skip: Callable[[int], None],
        set_frame: Callable[[str], None],
        maximum_backlog: int,
    ) -> None:
        self.maximum_backlog = maximum_backlog
        self.frame_id = ""
        self._process = process
        self._skip = skip
        self._set_frame = set_frame
        self._waiting: deque[Any] = deque()
        self._node = node
        self._subscription = node.create_subscription(
            IndenterSample, SAMPLE, self._on_sample, SAMPLE_QOS
        )

    @property
    def publishers(self) -> dict[str, int]:
        """Matched publishers by topic."""
        return {SAMPLE: self._subscription.get_publisher_count()}

    def close(self) -> None:
        """Stop listening."""
        self._node.destroy_subscription(self._subscription)

    def _on_sample(self, message: Any) -> None:
        waiting = self._waiting
        waiting.append(message)
        # Take what else is there: only so can a backlog be seen before it is worked off.
        handle = self._subscription.handle
        with handle:
            while len(waiting) <= STREAM_DEPTH:
                taken = handle.take_message(IndenterSample, False)
                if taken is None:
                    break
                waiting.append(taken[0])
        surplus = len(waiting) - self.maximum_backlog
        if surplus > 0:
            for _ in range(surplus):
                waiting.popleft()
            self._skip(surplus)
        while waiting:
            self._take(waiting.popleft())

    def _take(self, message: Any) -> None:
        header = message.header
        if header.frame_id != self.frame_id:
            self.frame_id = header.frame_id
            self._set_frame(header.frame_id)
        self._process(
            nanoseconds_from_stamp(header.stamp),
            message.sequence,
            message.displacement * METRE_IN_MM,
            message.force,
        )
