"""One topic of the node's input: its subscription, its backlog, and which publisher it follows.

The executor hands messages over one at a time and does not say how many wait. A channel takes all
that wait, so that a backlog can be seen: when the node cannot keep up, the newest samples are worth
more than the oldest, and those beyond the allowed backlog are left out and counted. It works off
the rest in slices, with the executor's other work between them, so that parameters, services and
diagnostics are answered however far behind the node is.
"""

from __future__ import annotations

import copy
import re
import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Final

from rcl_interfaces.msg import SetParametersResult
from rclpy._rclpy_pybind11 import RCLError
from rclpy.exceptions import ParameterException
from rclpy.node import Node
from rclpy.qos import QoSPolicyKind, QoSProfile
from rclpy.qos_overriding_options import InvalidQosOverridesError, QoSOverridingOptions
from rclpy.subscription import Subscription

from hc_estimator.stream.publishers import PublisherLines
from hc_msgs_py.qos import SAMPLE_QOS, STREAM_DEPTH
from hc_msgs_py.topics import NODE_PLAYER

MOST_TOGETHER = 256
"""Messages that are handed on in one piece."""
SLICE_S = 0.01
"""So long a channel works off its backlog before others have their turn."""
LATELY_NS = 2_000_000_000
"""A publisher that sent a message within this time speaks."""
PLAYERS: Final = (NODE_PLAYER, "rosbag2_player")
"""Nodes that publish recordings: `hc replay`, `ros2 bag play`."""

LARGEST_DEPTH = 2**31 - 1
"""Of a queue, in DDS."""


def _check_depth(qos: QoSProfile) -> SetParametersResult:
    """Refuse a depth that the middleware would take for another number."""
    if 1 <= qos.depth <= LARGEST_DEPTH:
        return SetParametersResult(successful=True)
    return SetParametersResult(
        successful=False, reason=f"depth is {qos.depth}, must be 1 to {LARGEST_DEPTH}"
    )


_OVERRIDES = QoSOverridingOptions(
    (
        QoSPolicyKind.HISTORY,
        QoSPolicyKind.DEPTH,
        QoSPolicyKind.RELIABILITY,
        QoSPolicyKind.DURABILITY,
    ),
    callback=_check_depth,
)
"""What the parameters qos_overrides.TOPIC.subscription.* may change, as in every ROS 2 node."""
_CHOICES: Final = {
    "history": "keep_last or keep_all",
    "reliability": "reliable or best_effort",
    "durability": "volatile or transient_local",
}
_NO_CHOICE: Final = re.compile(r"policy `(\w+)`: `(.*)`")


class SubscriptionError(Exception):
    """Why a topic cannot be subscribed to, in one line."""


class QosOverrideError(SubscriptionError):
    """A parameter qos_overrides.* that says what cannot be: no later attempt goes better."""


class Channel:
    """Hands on the messages of one publisher of a topic: one by one, or those that wait together.

    Attributes:
        topic: name of the topic as it was given.
        type_name: name of the messages' type, as the graph names it.
        received: messages that came, whoever sent them.
        received_ns: when the message that is handed on now came, by the system's clock.
        lines: tells the publishers apart, where one is followed.
        most_waiting: messages that waited at once, the most since somebody set it to 0.
    """

    def __init__(
        self,
        node: Node,
        message_type: Any,
        topic: str,
        take: Callable[[Any], None],
        *,
        skip: Callable[[int], None],
        fail: Callable[[Exception], None],
        raw: bool = False,
        take_many: Callable[[list[Any]], None] | None = None,
        fewest: Callable[[], int] = lambda: 2,
        samples_in: Callable[[Any], int] | None = None,
        qos: QoSProfile = SAMPLE_QOS,
        one_publisher: bool = True,
    ) -> None:
        """Subscribe.

        Args:
            node: the node, which destroys subscriptions late (hc_msgs_py.late_destruction).
            message_type: class of the messages.
            topic: name of the topic.
            take: takes one message.
            skip: hears how many samples were left out.
            fail: hears of what `take` raised where no executor would.
            raw: hand on the messages' bytes.
            take_many: takes several messages that wait; None hands them to `take`.
            fewest: returns how many that wait go to `take_many`, 2 at least; fewer go to `take`.
            samples_in: returns how many samples a message holds; None: one.
            qos: quality of service, unless parameters qos_overrides.TOPIC.subscription.* of the
                node say otherwise.
            one_publisher: follow one publisher; false takes what all of them send.

        Raises:
            SubscriptionError: if the middleware refuses; it has one type for each topic of a
                process, and a subscription of another type that was just given up still has it.
            QosOverrideError: if a parameter qos_overrides.* is not allowed.
        """
        self.topic = topic
        self.type_name = "/msg/".join(
            (message_type.__module__.split(".")[0], message_type.__name__)
        )
        self._maximum_backlog = STREAM_DEPTH
        self.received = 0
        self.received_ns = 0
        self.most_waiting = 0
        self._node = node
        self._message_type = message_type
        self._raw = raw
        self._take, self._skip, self._fail = take, skip, fail
        self._take_many, self._fewest, self._samples_in = take_many, fewest, samples_in
        self._waiting: deque[tuple[Any, dict[str, Any]]] = deque()
        self._continues = False
        self._closed = False
        self._one_publisher = one_publisher
        try:
            self._subscription = node.create_subscription(
                message_type,
                topic,
                self._on_message,
                copy.copy(qos),  # rclpy writes the overrides into it
                raw=raw,
                qos_overriding_options=_OVERRIDES,
            )
        except RCLError as error:
            raise SubscriptionError(
                f"cannot subscribe to {topic} as {self.type_name}: this node has it with another "
                "type"
            ) from error
        except (
            RuntimeError,
            ValueError,
            ParameterException,
            InvalidQosOverridesError,
        ) as error:  # a parameter qos_overrides.*
            raise QosOverrideError(f"cannot subscribe to {topic}: {_why_not(error)}") from error
        # rclpy's signature check would give a callback of this form the message alone.
        self._subscription._callback_type = Subscription.CallbackType.WithMessageInfo
        self.lines = PublisherLines(self._subscription.get_publisher_count)

    @property
    def maximum_backlog(self) -> int:
        """Messages that may wait, no more than the queue holds; the oldest are skipped first."""
        return self._maximum_backlog

    @maximum_backlog.setter
    def maximum_backlog(self, messages: int) -> None:
        self._maximum_backlog = min(messages, STREAM_DEPTH)

    @property
    def waits(self) -> bool:
        """Whether a message was fetched and not handed on yet."""
        return bool(self._waiting)

    @property
    def full_name(self) -> str:
        """The topic's name as the graph has it."""
        return str(self._subscription.topic_name)

    @property
    def publishers(self) -> int:
        """Number of matched publishers."""
        return int(self._subscription.get_publisher_count())

    @property
    def crowded(self) -> bool:
        """Whether there are several publishers, and only one of them is followed."""
        return self._one_publisher and self.publishers > 1

    @property
    def speaking(self) -> int:
        """Number of publishers that sent something lately, where one is followed."""
        return self.lines.speaking(time.time_ns(), LATELY_NS)

    @property
    def publisher_names(self) -> list[str]:
        """Full names of the nodes that publish the topic, with another type in brackets."""
        names = []
        for info in self._node.get_publishers_info_by_topic(self.full_name):
            name = f"{info.node_namespace.rstrip('/')}/{info.node_name}"
            names.append(
                name if info.topic_type == self.type_name else f"{name} ({info.topic_type})"
            )
        return sorted(names)

    def close(self) -> None:
        """Stop listening; what waits is dropped."""
        self._closed = True
        self._waiting.clear()
        self._node.destroy_subscription(self._subscription)

    def next_ns(self) -> int | None:
        """When the oldest message that waits came, by the system's clock; None if none waits."""
        if not self._waiting and not self._closed:
            self._fetch()
            if self._waiting:  # for what is fetched here the executor finds nothing to hand over
                self._go_on_later()
        return _came_ns(self._waiting[0][1]) if self._waiting else None

    def _on_message(self, message: Any, info: dict[str, Any] | None = None) -> None:
        """Take a message that the executor hands over.

        rclpy's EventsExecutor gives message and info as one tuple, its other executors as two
        arguments.
        """
        if self._closed:  # an event of the executor's that was on its way
            return
        self._waiting.append(message if info is None else (message, info))
        self._fetch()
        if not self._continues:
            self._work(time.perf_counter() + SLICE_S)

    def _fetch(self) -> None:
        """Take what waits in the middleware, and leave out what is too much."""
        waiting = self._waiting
        handle = self._subscription.handle
        with handle:
            while len(waiting) <= STREAM_DEPTH:
                taken = handle.take_message(self._message_type, self._raw)
                if taken is None:
                    break
                waiting.append(taken)
        self.most_waiting = max(self.most_waiting, len(waiting))
        surplus = len(waiting) - self._maximum_backlog
        if surplus > 0:
            skipped = [waiting.popleft()[0] for _ in range(surplus)]
            count = self._samples_in
            self._skip(surplus if count is None else sum(map(count, skipped)))

    def _work(self, deadline_s: float) -> None:
        waiting = self._waiting
        while waiting:
            if self._take_many is not None and len(waiting) >= self._fewest():
                several = [waiting.popleft() for _ in range(min(len(waiting), MOST_TOGETHER))]
                messages = [message for message, info in several if self._follows(info)]
                if messages:
                    self._take_many(messages)
            else:
                message, info = waiting.popleft()
                if self._follows(info):
                    self._take(message)
            if waiting and time.perf_counter() > deadline_s:
                self._go_on_later()
                return

    def _follows(self, info: Mapping[str, Any]) -> bool:
        """Count a message; returns whether it is to be taken, by who published it."""
        self.received += 1
        self.received_ns = _came_ns(info)
        if not self._one_publisher:
            return True
        number, came_ns = info["publication_sequence_number"], info["received_timestamp"]
        return self.lines.follows(number, came_ns)

    def _go_on_later(self) -> None:
        if not self._continues:
            self._continues = True
            self._node.executor.create_task(self._continue)

    def _continue(self) -> None:
        """Go on after a slice: a task of the executor's."""
        self._continues = False
        try:
            self._work(time.perf_counter() + SLICE_S)
        except Exception as error:  # noqa: BLE001 - a task that raises ends this executor in a crash
            self._fail(error)


def _why_not(error: Exception) -> str:
    """Say in the words of a user what rclpy says of a parameter qos_overrides.*."""
    text = str(error)
    if found := _NO_CHOICE.search(text):
        policy, value = found.groups()
        return f"{policy} is {value!r}, must be {_CHOICES.get(policy, 'another')}"
    return text.rpartition("are not valid: ")[2]


def idle_overrides(node: Node, channels: Iterable[Channel]) -> list[str]:
    """Say of each parameter qos_overrides.* that was given, and that nothing asked for, what is.

    Args:
        node: the node, which listens by now.
        channels: what it listens to.
    """
    topics = " and ".join(channel.full_name for channel in channels)
    # rclpy offers no public way to ask for the overrides of parameters that nobody declares.
    return [
        f"{name} has no effect: the node asks for qos_overrides.TOPIC.subscription.POLICY of "
        f"{topics}, with history, depth, reliability and durability"
        for name in node._parameter_overrides
        if name.startswith("qos_overrides.") and not node.has_parameter(name)
    ]


def is_replayed(channels: Iterable[Channel]) -> bool:
    """Whether all that is published on these topics comes out of recordings."""
    names = [name for channel in channels for name in channel.publisher_names]
    return bool(names) and all(name.rpartition("/")[2] in PLAYERS for name in names)


def _came_ns(info: Mapping[str, Any]) -> int:
    """Return when a message came; now, where the middleware does not say."""
    return info["received_timestamp"] or time.time_ns()
