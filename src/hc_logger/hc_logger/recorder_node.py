"""Node `recorder`: writes topics into a bag as they come, bytes unopened.

The subscriptions are not served by the executor: a timer empties their queues. That costs less
than half the processor time per message, and gives the time of reception and the publisher's
counter, by which losses show.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from hc_logger.errors import BagError
from hc_logger.numbered_bags import new_numbered_bag
from hc_logger.reception_clock import ReceptionClock
from hc_logger.ros.qos_profiles import mapping_from_profile, subscription_profile
from hc_logger.ros.recorder_options import declare_options
from hc_logger.session import INCOMPLETE, RecordingSession
from hc_logger.writer import BagWriter
from hc_msgs_py.diagnostics import DiagnosticsPublisher, Level, Status
from hc_msgs_py.interface_class import UnknownInterfaceError, interface_class
from hc_msgs_py.nearest import hint
from hc_msgs_py.node_main import NodeStartError, run_node
from hc_msgs_py.services import add_ready_service
from hc_msgs_py.topics import NODE_RECORDER

DRAIN_PERIOD_S = 0.025
"""How often the queues are emptied: they hold seconds of messages, so this loses none. Every second
time it is flushed as well, so that what is killed loses no more than with shorter periods."""
DISCOVERY_PERIOD_S = 0.1
NAMING_S = 3.0
"""Then a topic that was named has been seen, if somebody publishes it."""
FULL_DISCOVERY_EVERY = 10
"""Looks at all that is known of every publisher; in between, at topics whose number changed."""
MOST_AT_ONCE = 5000
"""Messages taken from one queue before the others and the services get their turn."""
STANDSTILL_S = 0.3
"""Without a look at the queues for so long the process stood still, or was held up by a disk."""
QUIET_S = 0.3
"""Publishers are asked for what was missed within 0.1 s (fast_dds.xml); then all has come."""
LONGEST_CATCH_UP_S = 2.0
OVERLAP_S = 1.0
"""So long a topic is heard by both subscriptions where one with other QoS takes over."""


@dataclass
class Former:
    """A subscription that another one takes over from: what is on its way to it still comes."""

    subscription: Any
    until_s: float
    heard: set[tuple[int, int]] = field(default_factory=set)

    def is_new(self, info: Mapping[str, Any]) -> bool:
        """Whether a message has not come by the other subscription yet."""
        key = (info["source_timestamp"], info["publication_sequence_number"])
        before = len(self.heard)
        self.heard.add(key)
        return len(self.heard) > before


@dataclass
class Tap:
    """One subscription of the recorder."""

    topic: str
    number: int
    subscription: Any
    reliable: bool
    transient_local: bool
    publishers: int
    former: Former | None = None


class RecorderNode(Node):  # type: ignore[misc]  # rclpy ships no types
    """Records topics until it is ended."""

    def __init__(self) -> None:
        """Make the bag and look for topics.

        Raises:
            NodeStartError: if the bag cannot be made.
        """
        self._taps: dict[str, Tap] = {}
        self._tapped: frozenset[int] = frozenset()
        self._looks = 0
        self._numbers: dict[str, int] = {}  # of publishers, at the last look
        super().__init__(NODE_RECORDER)
        options = declare_options(self)
        self._depth = options.queue_depth
        self._named, self._expected = options.named, options.expected
        self._selection = options.selection
        self._skipped: dict[str, str] = {}
        self._reported_failure = ""
        self._closed = False
        self._last_reported = (time.monotonic(), 0)
        self._clock_of_reception = ReceptionClock()
        self._drained_s = time.monotonic()
        self._sim_time = bool(self.get_parameter("use_sim_time").value)
        try:
            make = new_numbered_bag if options.is_numbered else BagWriter
            writer = make(options.output, custom_data=options.custom_data, **options.split)
        except BagError as error:
            raise NodeStartError(str(error)) from error
        self._session = RecordingSession(
            writer,
            flush_interval_s=options.flush_interval_s,
            fsync_interval_s=options.fsync_interval_s,
        )
        self._removes_empty = options.removes_empty
        steady = Clock(clock_type=ClockType.STEADY_TIME)  # simulated time may stand still
        self.create_timer(DRAIN_PERIOD_S, self._drain, clock=steady)
        self.create_timer(DISCOVERY_PERIOD_S, self._discover, clock=steady)
        self._naming = self.create_timer(NAMING_S, self._name_the_silent, clock=steady)
        add_ready_service(self, self._missing)
        self._diagnostics = DiagnosticsPublisher(self, str(writer.path), self._status)
        self._discover()

    @property
    def subscriptions(self) -> Iterator[Any]:
        """Subscriptions that an executor serves: not the recorded ones."""
        return (s for s in super().subscriptions if id(s) not in self._tapped)

    def _discover(self) -> None:
        """Subscribe to what is new, and again where publishers came that need other QoS."""
        whole = self._looks % FULL_DISCOVERY_EVERY == 0
        self._looks += 1
        for topic, types in self.get_topic_names_and_types():
            if topic not in self._selection or topic in self._skipped:
                continue
            before, number = self._numbers.get(topic), self.count_publishers(topic)
            self._numbers[topic] = number
            if number == before and not whole:
                continue
            endpoints = self.get_publishers_info_by_topic(topic)
            if not endpoints:
                continue
            if len(types) > 1:
                self._skip(topic, f"has several types: {', '.join(types)}")
                continue
            offered = [endpoint.qos_profile for endpoint in endpoints]
            profile = subscription_profile(offered, self._depth)
            reliable = profile.reliability.name == "RELIABLE"
            local = profile.durability.name == "TRANSIENT_LOCAL"
            tap = self._taps.get(topic)
            if tap is None:
                try:
                    kind = interface_class(types[0])
                    number = self._session.add_topic(
                        topic, types[0], [mapping_from_profile(p) for p in offered]
                    )
                    subscription = self._subscribe(kind, topic, profile)
                except UnknownInterfaceError as error:
                    self._skip(topic, str(error))
                    continue
                self._taps[topic] = Tap(
                    topic, number, subscription, reliable, local, len(endpoints)
                )
                continue
            tap.publishers = len(endpoints)
            if (tap.reliable and not reliable) or (tap.transient_local and not local):
                self._forget_former(tap)
                tap.former = Former(tap.subscription, time.monotonic() + OVERLAP_S)
                tap.subscription = self._subscribe(interface_class(types[0]), topic, profile)
                tap.reliable, tap.transient_local = reliable, local

    def _name_the_silent(self) -> None:
        """Say once which topics that were named are not there."""
        self._naming.cancel()
        there = [name for name, _ in self.get_topic_names_and_types()]
        for name in self._named:
            if name and name not in self._taps and name not in self._skipped:
                meant = hint(name, (t for t in there if t != name), "there are")
                self.get_logger().warning(
                    f"nobody publishes {name} yet ({meant}); it is recorded once somebody does"
                )

    def _subscribe(self, kind: Any, topic: str, profile: Any) -> Any:
        subscription = self.create_subscription(kind, topic, _never_called, profile, raw=True)
        self._tapped |= {id(subscription)}
        return subscription

    def _forget_former(self, tap: Tap) -> None:
        """End the overlap of two subscriptions to a topic."""
        if tap.former is not None:
            self._drain_all([tap])
            self._tapped -= {id(tap.former.subscription)}
            self.destroy_subscription(tap.former.subscription)
            tap.former = None

    def _skip(self, topic: str, reason: str) -> None:
        self._skipped[topic] = reason
        self.get_logger().warning(f"{topic} is not recorded: {reason}")

    def _drain(self) -> None:
        """Write what has arrived."""
        self._drained_s = time.monotonic()
        self._clock_of_reception.update()
        for tap in self._taps.values():
            self._drain_one(tap)
            if tap.former is not None and self._drained_s > tap.former.until_s:
                self._forget_former(tap)
        self._session.flush_if_due(DRAIN_PERIOD_S / 2)
        if self._session.failure and not self._reported_failure:
            self._reported_failure = self._session.failure
            later = ", and so does the recording once there is room" if self._session.waits else ""
            self.get_logger().error(
                f"{self._session.failure}; recording has stopped, the run goes on{later}"
            )
            self._diagnostics.publish()  # at once, not within a second
        if self._session.go_on():
            self._reported_failure = ""
            self.get_logger().warning(
                f"there is room again: recording goes on; {self._session.incomplete}"
            )
            self._diagnostics.publish()

    def _drain_one(self, tap: Tap) -> int:
        """Write what of one topic has arrived, a bounded number; returns how many there were."""
        now = self.get_clock().now().nanoseconds if self._sim_time else 0
        if self._sim_time and not now:
            return 0  # nobody has said yet what time it is: the messages wait in their queues
        if tap.former is None:
            taken = _take(tap.subscription)
        else:
            both = [*_take(tap.former.subscription), *_take(tap.subscription)]
            taken = [message for message in both if tap.former.is_new(message[1])]
        if not taken:
            return 0
        data, infos = [message[0] for message in taken], [message[1] for message in taken]
        if now:
            log_times = [now] * len(data)
        else:
            received = [info["received_timestamp"] for info in infos]
            log_times = self._clock_of_reception.steady_all(received)
        published = [info["source_timestamp"] for info in infos]
        sequences: list[int | None] = [None] * len(data)
        if tap.publishers == 1:
            sequences = [info["publication_sequence_number"] for info in infos]
        self._session.add_many(tap.number, log_times, data, published, sequences)
        return len(data)

    def _drain_all(self, taps: Iterable[Tap]) -> int:
        """Write what has arrived of some topics to its end: their queues are taken no more."""
        number = 0
        for tap in taps:
            more = MOST_AT_ONCE
            while more >= MOST_AT_ONCE:
                more = self._drain_one(tap)
                number += more
        return number

    def _drain_last(self) -> None:
        """Write what has arrived; if the process stood still before, what it missed as well.

        That is in the system's buffers, or kept by the publishers, which are asked for it soon.
        """
        stood_still = time.monotonic() - self._drained_s > STANDSTILL_S
        until = quiet_until = time.monotonic()
        if stood_still:
            until, quiet_until = until + LONGEST_CATCH_UP_S, until + QUIET_S
        while True:
            self._clock_of_reception.update()
            number, now = self._drain_all(self._taps.values()), time.monotonic()
            if number:
                quiet_until = now + QUIET_S
            if now >= min(until, quiet_until):
                return
            time.sleep(DRAIN_PERIOD_S)

    def _missing(self) -> list[str]:
        """Return which expected topics are not matched yet, for ~/ready."""
        self._discover()
        lines = []
        for topic in self._expected:
            tap = self._taps.get(topic)
            if topic in self._skipped:
                lines.append(f"{topic} {self._skipped[topic]}")
            elif tap is None or tap.subscription.get_publisher_count() == 0:
                lines.append(f"{topic} has no publisher yet")
        return lines

    def _status(self) -> Status:
        """Return what /diagnostics says."""
        session = self._session
        now, before = time.monotonic(), self._last_reported
        self._last_reported = (now, session.messages)
        values: dict[str, Any] = {
            "bag": session.writer.path,
            "folder": session.writer.folder,
            "messages": session.messages,
            "rate_hz": (session.messages - before[1]) / max(now - before[0], 1e-9),
            "bytes": sum(count.bytes for count in session.counts.values()),
            "file_bytes": session.writer.bytes_written(),
            "topics": len(self._taps),
            "files": session.writer.file_count,
            "dropped": session.dropped,
            "clock_jumps": len(self._clock_of_reception.jumps_ns),
            "unwritten": session.unwritten,
            "closed": int(self._closed),  # the counts are those of the whole bag
        }
        for tap in self._taps.values():
            count = session.counts[tap.number]
            values[f"{tap.topic} messages"] = count.messages
            if count.dropped:
                values[f"{tap.topic} dropped"] = count.dropped
        for topic, reason in self._skipped.items():
            values[f"{topic} skipped"] = reason
        if session.failure:
            return Status(Level.ERROR, session.failure, values)
        if session.incomplete:
            return Status(Level.WARN, session.incomplete, values)
        if session.dropped:
            return Status(Level.WARN, f"{session.dropped} messages dropped", values)
        if self._skipped:
            return Status(Level.WARN, f"{len(self._skipped)} topics not recorded", values)
        return Status(Level.OK, "recording", values)

    def finished(self) -> bool:
        """Whether the node wants to end by itself: never."""
        return False

    def close(self) -> None:
        """Write everything received, and the metadata; a bag without a message may go."""
        self._drain_last()
        if self._sim_time and not self.get_clock().now().nanoseconds:
            self.get_logger().error("nothing recorded: use_sim_time is set and /clock is silent")
        writer = self._session.writer
        writer.set_custom_data("dropped", str(self._session.dropped))
        if self._session.unwritten:
            writer.set_custom_data("unwritten", str(self._session.unwritten))
        jumps = self._clock_of_reception.jumps_ns
        if jumps:
            writer.set_custom_data("clock_jumps_s", ", ".join(f"{j * 1e-9:.6f}" for j in jumps))
        self._session.close()
        self._closed = True
        if self._removes_empty and not (writer.message_count or self._session.failure):
            writer.discard()
        if self._session.failure and not self._reported_failure:
            self.get_logger().error(self._session.failure)
        self._diagnostics.publish_last()

    @property
    def failure(self) -> str:
        """Why not everything is in the bag, empty if all is."""
        return self._session.incomplete


def _take(subscription: Any) -> list[tuple[bytes, Mapping[str, Any]]]:
    """Take what has arrived, a bounded number: bytes, and what the middleware says of them."""
    handle, kind = subscription.handle, subscription.msg_type
    found: list[tuple[bytes, Mapping[str, Any]]] = []
    with handle:
        while len(found) < MOST_AT_ONCE:
            taken = handle.take_message(kind, True)
            if taken is None:
                break
            found.append(taken)
    return found


def _never_called(_data: bytes) -> None:
    """Stand in for the callback that a subscription must have."""


def main() -> int:
    """Run the node; returns the exit status: that of run_node, INCOMPLETE for a bag that is cut."""
    nodes: list[RecorderNode] = []

    def make() -> RecorderNode:
        nodes.append(RecorderNode())
        return nodes[0]

    status = run_node(make, below=1)  # its queues hold seconds: samples and estimates come first
    return status or (INCOMPLETE if nodes and nodes[0].failure else 0)


if __name__ == "__main__":
    sys.exit(main())
