"""The topic indenter/sample as the node's input, and what every input has in common.

The queue is bounded by the topic's depth. When the node cannot keep up, the newest samples are
worth more than the oldest: those beyond the allowed backlog are left out and counted.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from typing import Any, Protocol

from hc_msgs.msg import IndenterSample
from rclpy._rclpy_pybind11 import RCLError
from rclpy.node import Node

from hc_msgs_py.qos import SAMPLE_QOS, STREAM_DEPTH
from hc_msgs_py.topics import SAMPLE
from hc_msgs_py.wire import SampleDecoder


class SubscriptionError(Exception):
    """Why a topic cannot be subscribed to, in one line."""


def subscribe(
    node: Node, message_type: Any, topic: str, callback: Callable[..., None], *, raw: bool = False
) -> Any:
    """Subscribe to a stream of samples.

    Raises:
        SubscriptionError: if the middleware refuses; it has one type for each topic of a process,
            and a subscription of another type that was just given up still has the topic.
    """
    try:
        return node.create_subscription(message_type, topic, callback, SAMPLE_QOS, raw=raw)
    except RCLError as error:
        name = message_type.__name__
        raise SubscriptionError(
            f"cannot subscribe to {topic} as {name}: this node has it with another type"
        ) from error


class Receiver(Protocol):
    """Who takes the samples: the node."""

    def on_sample(
        self, stamp_ns: int, sequence: int, displacement_mm: float, force_n: float
    ) -> None:
        """Take in a sample."""

    def on_skip(self, number: int) -> None:
        """Hear that samples were left out, and their numbers with them."""

    def on_frame(self, frame_id: str) -> None:
        """Hear that the samples are in another frame from now on."""


class Input(Protocol):
    """What the node needs of an input.

    Attributes:
        position: newest position of the tip [m] and its frame; None when no pose is received.
    """

    position: tuple[tuple[float, float, float], str] | None

    @property
    def publishers(self) -> Mapping[str, int]:
        """Matched publishers by topic."""

    @property
    def counters(self) -> Mapping[str, int]:
        """What the input itself counted, for diagnostics."""

    def configure(self, values: Mapping[str, Any]) -> None:
        """Take other settings that do not need other subscriptions."""

    def close(self) -> None:
        """Stop listening; a message that was on its way is not handed on."""


class Drain:
    """Takes all messages that wait in a subscription, so that a backlog can be seen.

    The executor hands messages over one at a time and does not say how many wait.

    Attributes:
        maximum_backlog: messages that may wait; more are skipped, the oldest first.
    """

    def __init__(self, skip: Callable[[int], None]) -> None:
        self.maximum_backlog = STREAM_DEPTH
        self._skip = skip
        self._waiting: deque[Any] = deque()

    def take(
        self, subscription: Any, message_type: Any, first: Any = None, *, raw: bool = False
    ) -> deque[Any]:
        """Return the first message and all that wait behind it, but for those to be skipped.

        Args:
            subscription: subscription to take from.
            message_type: its type.
            first: message that the executor handed over; None if it did not.
            raw: take the messages' bytes.
        """
        waiting = self._waiting
        if first is not None:
            waiting.append(first)
        handle = subscription.handle
        with handle:
            while len(waiting) <= STREAM_DEPTH:
                taken = handle.take_message(message_type, raw)
                if taken is None:
                    break
                waiting.append(taken[0])
        surplus = len(waiting) - self.maximum_backlog
        if surplus > 0:
            for _ in range(surplus):
                waiting.popleft()
            self._skip(surplus)
        return waiting


class SampleInput:
    """Subscribes to indenter/sample and hands every sample on, less the zeros."""

    def __init__(self, node: Node, receiver: Receiver, values: Mapping[str, Any]) -> None:
        """Start listening.

        Raises:
            SubscriptionError: if the topic cannot be subscribed to.
        """
        self.position: tuple[tuple[float, float, float], str] | None = None
        self._node = node
        self._receiver = receiver
        self._drain = Drain(receiver.on_skip)
        self._decoder = SampleDecoder()
        self._undecodable = 0
        self.configure(values)
        self._frame_id = ""
        self._closed = False
        self._subscription = subscribe(node, IndenterSample, SAMPLE, self._on_message, raw=True)

    def configure(self, values: Mapping[str, Any]) -> None:
        """Take other zeros and another limit of the backlog."""
        self._force_zero = values["input.force.zero"]
        self._position_zero = values["input.position.zero"]
        self._drain.maximum_backlog = values["input.maximum_backlog"]

    @property
    def publishers(self) -> Mapping[str, int]:
        """Matched publishers by topic."""
        return {SAMPLE: self._subscription.get_publisher_count()}

    @property
    def counters(self) -> Mapping[str, int]:
        """Messages that were none."""
        return {"undecodable": self._undecodable}

    def close(self) -> None:
        """Stop listening."""
        self._closed = True
        self._node.destroy_subscription(self._subscription)

    def _on_message(self, data: bytes) -> None:
        if self._closed:  # an event of the executor's that was on its way
            return
        waiting = self._drain.take(self._subscription, IndenterSample, data, raw=True)
        while waiting:
            self._take(waiting.popleft())

    def _take(self, data: bytes) -> None:
        decoder = self._decoder
        try:
            stamp_ns, sequence, displacement_mm, force_n = decoder.decode(data)
        except ValueError:
            self._undecodable += 1
            return
        if decoder.frame_id != self._frame_id:
            self._frame_id = decoder.frame_id
            self._receiver.on_frame(self._frame_id)
        self._receiver.on_sample(
            stamp_ns, sequence, displacement_mm - self._position_zero, force_n - self._force_zero
        )
