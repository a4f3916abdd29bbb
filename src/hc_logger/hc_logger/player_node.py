"""Node `player`: publishes a bag again with its timing, message bytes unchanged.

Header stamps are those of the recording, so that estimates from a replay equal those from the bag.
"""

from __future__ import annotations

import sys
import time
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.exceptions import NameValidationException
from rclpy.node import Node

from hc_logger.bag import Message, Topic
from hc_logger.definitions import installed_definition
from hc_logger.errors import BagError, UnknownTypeError
from hc_logger.foreign import open_bag
from hc_logger.playback import Playback
from hc_logger.ros.player_controls import LARGEST_RATE, SMALLEST_RATE, PlayerControls
from hc_logger.ros.qos_profiles import publisher_profile
from hc_logger.selection import TopicSelection, full_name
from hc_logger.type_names import FORCE_TYPE, POSITION_TYPES, SAMPLE_TYPE, SAMPLES_TYPE
from hc_msgs_py.diagnostics import DiagnosticsPublisher, Level, Status
from hc_msgs_py.interface_class import UnknownInterfaceError, interface_class
from hc_msgs_py.node_main import NodeStartError, run_node
from hc_msgs_py.parameters import declare, refuse_unknown
from hc_msgs_py.plain_text import in_one_line, visible
from hc_msgs_py.qos import KEPT_DEPTH
from hc_msgs_py.services import add_ready_service
from hc_msgs_py.topics import NODE_PLAYER

LAST_DELIVERY_S = 0.5
"""How long the node lives on after the last message, so that slow subscribers get it."""
START_CHECK_PERIOD_S = 0.05


class PlayerNode(Node):  # type: ignore[misc]  # rclpy ships no types
    """Plays a bag."""

    def __init__(self) -> None:
        """Open the bag and make a publisher for each chosen topic.

        Raises:
            NodeStartError: if the bag cannot be read or has nothing to play.
        """
        super().__init__(NODE_PLAYER)
        bag = declare(self, "bag", "", "bag to play: a folder or an .mcap file", read_only=True)
        if not bag:
            raise NodeStartError("parameter bag is empty; give the bag to play")
        namespace = self.get_namespace()
        selection = TopicSelection(
            declare(
                self,
                "topics",
                ["*"],
                "topics to play: names or patterns with * and ?",
                read_only=True,
            ),
            declare(
                self, "exclude", [""], "topics to leave out: names or patterns", read_only=True
            ),
            namespace,
        )
        renames = _renames(
            declare(self, "remap", [""], "topics to rename, recorded:=played", read_only=True),
            namespace,
        )
        self._expected = declare(
            self,
            "expected_sample_subscribers",
            0,
            "how many subscribers of the samples ~/ready and the start wait for",
            minimum=0,
            maximum=1000,
            read_only=True,
        )
        awaited = declare(
            self,
            "expected_topics",
            [""],
            "topics whose subscribers are counted; empty: those of samples, or of sensors",
            read_only=True,
        )
        self._start_paused = declare(
            self, "start_paused", False, "wait for ~/run before the first message", read_only=True
        )
        self._exit_when_done = declare(
            self, "exit_when_done", False, "end the node after the last message", read_only=True
        )
        try:
            self._reader = open_bag(bag)
            for problem in self._reader.problems:
                # The name of a file may hold any bytes; a log takes what UTF-8 can hold.
                line = problem.encode(errors="backslashreplace").decode()
                self.get_logger().warning(visible(line))
            self._skipped: dict[str, str] = {}
            self._publishers_by_topic = self._make_publishers(selection, renames)
            self._playback = Playback(
                self._reader,
                self._publish,
                TopicSelection(list(self._publishers_by_topic)),
                **self._timing(),
            )
            self._controls = PlayerControls(self, self._playback, self.get_logger().info)
            self._awaited = self._topics_waited_for([n for n in awaited if n], namespace)
            refuse_unknown(self)
        except (BagError, ValueError) as error:
            raise NodeStartError(str(error)) from error
        self._playback.prepare()
        self._finished_at: float | None = None
        self._last_reported = (time.monotonic(), 0)
        add_ready_service(self, self._missing)
        self._diagnostics = DiagnosticsPublisher(self, bag, self._status)
        if not self._start_paused:
            steady = Clock(clock_type=ClockType.STEADY_TIME)  # simulated time may come from here
            self._start_timer = self.create_timer(
                START_CHECK_PERIOD_S, self._start_when_ready, clock=steady
            )

    def _topics_waited_for(self, named: list[str], namespace: str) -> list[str]:
        """Return the played topics whose subscribers are counted, by their names in the bag.

        Raises:
            BagError: if one that is named is not played.
        """
        names = [full_name(name, namespace) for name in named]
        played = self._publishers_by_topic
        by_name = {publisher.topic_name: name for name, publisher in played.items()}
        for name in names:
            if name not in by_name:
                raise BagError(
                    f"{self._reader.path} has nothing to play on {name}: {', '.join(by_name)}"
                )
        return [by_name[name] for name in names] or self._of_types(
            (SAMPLE_TYPE,), (SAMPLES_TYPE,), (FORCE_TYPE, *POSITION_TYPES)
        )

    def _of_types(self, *choices: tuple[str, ...]) -> list[str]:
        """Return the played topics of the first of several sets of types that is there."""
        topics = self._reader.topics
        for types in choices:
            found = [n for n in self._publishers_by_topic if topics[n].definition.name in types]
            if found:
                return found
        return []

    def _timing(self) -> dict[str, Any]:
        return {
            "rate": declare(
                self,
                "rate",
                1.0,
                "recorded seconds per second",
                minimum=SMALLEST_RATE,
                maximum=LARGEST_RATE,
            ),
            "loop": declare(self, "loop", False, "start again at the end", read_only=True),
            "start_offset_s": declare(
                self,
                "start_offset",
                0.0,
                "where to begin, after the first sample; 0: with what lies before it",
                minimum=0.0,
                unit="s",
                read_only=True,
            ),
            "duration_s": declare(
                self,
                "duration",
                0.0,
                "how much to play, from the first sample on; 0 plays to the end",
                minimum=0.0,
                unit="s",
                read_only=True,
            ),
        }

    def _make_publishers(
        self, selection: TopicSelection, renames: dict[str, str]
    ) -> dict[str, Any]:
        for name in renames:
            if name not in self._reader.topics:
                raise BagError(f"remap: {self._reader.path} has no topic {name}")
        publishers = {}
        for name, topic in self._reader.topics.items():
            if name not in selection:
                continue
            try:
                self._check_type(topic)
                publishers[name] = self.create_publisher(
                    interface_class(topic.definition.name),
                    renames.get(name, name),
                    publisher_profile(topic.qos_profiles, KEPT_DEPTH),
                )
            except UnknownInterfaceError as error:
                self._skipped[name] = visible(str(error))
            except NameValidationException:
                self._skipped[name] = "ROS permits no such name"
            if name in self._skipped:
                line = f"{in_one_line(name)} is not played: {self._skipped[name]}"
                self.get_logger().warning(line)
        if self._skipped and not publishers:
            raise BagError("; ".join(f"{n}: {reason}" for n, reason in self._skipped.items()))
        return publishers

    @staticmethod
    def _check_type(topic: Topic) -> None:
        """Refuse a topic whose messages others would read wrongly."""
        recorded = topic.definition.type_hash
        installed = installed_definition(topic.definition.name).type_hash
        if recorded.startswith("RIHS01_") and recorded != installed:
            raise UnknownTypeError(
                f"{topic.definition.name} was recorded with another definition than the one "
                "installed here"
            )

    def _publish(self, message: Message) -> None:
        """Publish one message; called from the playing thread."""
        self._publishers_by_topic[message.topic].publish(message.data)

    def _start_when_ready(self) -> None:
        if not self._missing():
            self.destroy_timer(self._start_timer)
            if self._playback.paused:
                self._playback.resume()

    def _missing(self) -> list[str]:
        """Return who is not there yet, for ~/ready."""
        counts = {n: self._publishers_by_topic[n].get_subscription_count() for n in self._awaited}
        if self._expected and not counts:
            return [f"{self._reader.path} has no samples to play"]
        return [
            f"{name} has {found} of {self._expected} subscribers"
            for name, found in counts.items()
            if found < self._expected
        ]

    def _samples(self) -> dict[str, int]:
        """Return how many samples went out; nothing where there are none to count.

        Of sensors there are no samples but what an estimator makes of them, and in arrays they are
        more than messages.
        """
        topics = self._of_types((SAMPLE_TYPE,))
        if not topics:
            return {}
        return {"samples": sum(self._playback.published[name] for name in topics)}

    def _status(self) -> Status:
        """Return what /diagnostics says."""
        playback = self._playback
        count = sum(playback.published.values())
        now, before = time.monotonic(), self._last_reported
        self._last_reported = (now, count)
        delays = playback.delays()
        values: dict[str, Any] = {
            "bag": self._reader.path,
            "messages": count,
            **self._samples(),
            "rate_hz": (count - before[1]) / max(now - before[0], 1e-9),
            "rate": playback.rate,
            "position_s": (playback.time_ns() - playback.first_ns) * 1e-9,
            "duration_s": (playback.last_ns - playback.first_ns) * 1e-9,
            "loops": playback.loops,
            "delay_p50_us": delays.p50,
            "delay_p99_us": delays.p99,
            "delay_max_us": delays.maximum,
        }
        for topic, reason in self._skipped.items():
            values[f"{topic} skipped"] = reason
        problems = self._reader.problems
        if playback.error is not None:
            return Status(Level.ERROR, str(playback.error), values)
        if playback.finished:
            return Status(Level.OK, "finished", values)
        if playback.paused and not count:
            return Status(Level.OK, "waits for ~/run or its subscribers", values)
        if problems:
            return Status(Level.WARN, "; ".join(problems), values)
        return Status(Level.OK, "paused" if playback.paused else "plays", values)

    def finished(self) -> bool:
        """Whether the node wants to end by itself.

        Raises:
            NodeStartError: if the bag could not be read on.
        """
        if not self._playback.finished:
            self._finished_at = None
            return False
        if self._finished_at is None:
            self._finished_at = time.monotonic()
            self._diagnostics.publish()
        if time.monotonic() - self._finished_at < LAST_DELIVERY_S:
            return False
        if self._playback.error is not None:
            raise NodeStartError(f"{self._reader.path}: {self._playback.error}")
        return bool(self._exit_when_done)

    def close(self) -> None:
        """End the playing and close the bag."""
        self._controls.close()
        self._playback.stop()
        self._diagnostics.publish_last()
        self._reader.close()


def _renames(entries: list[str], namespace: str) -> dict[str, str]:
    """Split recorded:=played texts.

    Raises:
        NodeStartError: if one is not of that form.
    """
    renames = {}
    for entry in entries:
        if not entry:
            continue
        recorded, separator, played = entry.partition(":=")
        if not (separator and recorded and played):
            raise NodeStartError(f"remap entry {entry!r} is not recorded:=played")
        renames[full_name(recorded, namespace)] = full_name(played, namespace)
    return renames


def main() -> int:
    """Run the node; returns the exit status."""
    return run_node(PlayerNode)


if __name__ == "__main__":
    sys.exit(main())
