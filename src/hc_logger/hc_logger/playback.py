"""Plays a bag: each message at its absolute deadline, from a thread of its own.

Reading and unpacking happen in another thread, ahead of time, so that a new chunk never makes a
message late. Deadlines are absolute: an error does not add up. After a jump (seek, loop) the
threads tell old batches from new ones by a number, the generation.
"""

from __future__ import annotations

import queue
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from hc_logger.bag import Bag, Message
from hc_logger.errors import BagError
from hc_logger.origin import origin_ns
from hc_logger.selection import TopicSelection
from hc_msgs_py.histogram import DurationHistogram

BATCH = 256
BATCHES_AHEAD = 64
"""Messages are handed over in batches, and at most so many wait: memory stays bounded."""
LONGEST_SLEEP_S = 0.02
"""How long a pause or a stop can go unnoticed while the next message is far."""
SWITCH_INTERVAL_S = 1e-4
"""Python's thread switching while a bag plays: the reading thread must let go quickly."""


class _Batch(NamedTuple):
    """What the reading thread hands over; `last` marks the end of the bag."""

    generation: int
    messages: list[Message]
    last: bool = False


@dataclass(frozen=True)
class Delays:
    """How late messages were published, in microseconds; NaN before the first one."""

    p50: float
    p99: float
    maximum: float


class Playback:
    """Publishes the messages of a bag with their timing.

    Attributes:
        published: messages published so far, by topic.
        loops: how often the end of the bag was reached.
        error: what ended the playback early, None if nothing did.
        first_ns: log time of the start.
        last_ns: log time of the end.
    """

    def __init__(
        self,
        reader: Bag,
        publish: Callable[[Message], None],
        selection: TopicSelection,
        *,
        rate: float = 1.0,
        loop: bool = False,
        start_offset_s: float = 0.0,
        duration_s: float = 0.0,
    ) -> None:
        """Prepare a playback; it begins paused.

        Args:
            reader: the bag; left to the reading thread from the first resume() on.
            publish: called with each message at its time, from the playing thread.
            selection: which topics.
            rate: recorded seconds per second.
            loop: start again at the end, until stop().
            start_offset_s: begin so many recorded seconds after the first sample (origin.py); 0
                plays what lies before it as well.
            duration_s: end so many recorded seconds after that; 0 plays to the end.

        Raises:
            ValueError: if a number is out of range or the bag has nothing to play.
        """
        if start_offset_s < 0.0 or duration_s < 0.0:
            raise ValueError("start offset and duration must not be negative")
        span = reader.time_range()
        if span is None:
            raise ValueError(f"{reader.path} has no messages")
        topics = [name for name in reader.topics if name in selection]
        if not topics:
            raise ValueError(f"no topic of {reader.path} is chosen: {', '.join(reader.topics)}")
        first = next(reader.messages(topics), None)
        if first is None:
            raise ValueError(f"{reader.path} has no message on {', '.join(topics)}")
        origin = origin_ns(reader) or first.log_time
        lasts_s = (span[1] - origin) * 1e-9
        if start_offset_s > lasts_s:
            since = "" if origin == span[0] else " from its first sample on"
            raise ValueError(
                f"start offset is {start_offset_s:g} s, the bag lasts only {lasts_s:g} s{since}"
            )
        counted_ns = origin + round(start_offset_s * 1e9)
        self.first_ns = counted_ns if start_offset_s else first.log_time
        self.last_ns = span[1]
        if 0.0 < duration_s < (span[1] - counted_ns) * 1e-9:
            self.last_ns = counted_ns + round(duration_s * 1e9)
        self.published = dict.fromkeys(topics, 0)
        self.loops = 0
        self.error: Exception | None = None
        self._reader = reader
        self._publish = publish
        self._topics = topics
        self._loop = loop
        self._delays = DurationHistogram()
        self._queue: queue.Queue[_Batch] = queue.Queue(BATCHES_AHEAD)
        self._threads: list[threading.Thread] = []
        # Everything below changes under the lock only. The pair of anchors maps recorded time to
        # the monotonic clock; the generation grows with every jump.
        self._changed = threading.Condition()
        self._generation = 0
        self._position_ns = self.first_ns
        self._anchor_ns = self.first_ns
        self._anchor_s: float | None = None  # None: set by the first message after a jump
        self._rate = 1.0
        self._paused = True
        self._burst = 0
        self._finished = False
        self._stopping = False
        self.set_rate(rate)

    def _begin(self) -> None:
        if not self._threads:
            sys.setswitchinterval(SWITCH_INTERVAL_S)
            self._threads = [
                threading.Thread(target=target, daemon=True) for target in (self._read, self._play)
            ]
            for thread in self._threads:
                thread.start()

    def prepare(self) -> None:
        """Read ahead already, so that the first message is there when resume() wants it."""
        with self._changed:
            self._begin()

    def resume(self) -> None:
        """Play, or play on."""
        with self._changed:
            self._anchor()
            self._paused = False
            self._begin()
            self._changed.notify_all()

    def _anchor(self) -> None:
        """Let the recorded time that is now be now on the monotonic clock."""
        self._anchor_ns = self._time_ns()
        if self._anchor_s is not None:
            self._anchor_s = time.monotonic()

    def pause(self) -> None:
        """Publish nothing until resume() or burst()."""
        with self._changed:
            self._anchor_ns = self._time_ns()
            self._paused = True

    def burst(self, count: int = 1) -> None:
        """Publish the next messages at once; a running playback is paused by it.

        Raises:
            ValueError: if the count is not positive.
        """
        if count < 1:
            raise ValueError(f"burst of {count} messages; give 1 or more")
        self.pause()
        with self._changed:
            self._burst += count
            self._begin()
            self._changed.notify_all()

    def seek(self, time_ns: int) -> int:
        """Jump to a recorded time; one outside the playback is moved to its start or end.

        Returns:
            The time that was taken.
        """
        with self._changed:
            position = min(max(time_ns, self.first_ns), self.last_ns)
            self._generation += 1
            self._position_ns = position
            self._anchor_ns, self._anchor_s = position, None
            self._finished = False
            self._changed.notify_all()
        return position

    def set_rate(self, rate: float) -> None:
        """Change the speed from now on.

        Raises:
            ValueError: if the rate is not a positive, finite number.
        """
        if not 0.0 < rate < float("inf"):
            raise ValueError(f"rate is {rate}; give a number above 0")
        with self._changed:
            self._anchor()
            self._rate = rate

    def stop(self) -> None:
        """End both threads."""
        with self._changed:
            self._stopping = True
            self._changed.notify_all()
        for thread in self._threads:
            thread.join()

    @property
    def rate(self) -> float:
        """Recorded seconds per second."""
        return self._rate

    @property
    def paused(self) -> bool:
        """True before the first resume() and after pause()."""
        return self._paused

    @property
    def finished(self) -> bool:
        """True when the last message has been published, or after an error."""
        return self._finished

    def time_ns(self) -> int:
        """Return the recorded time that is now, as a /clock would tell it."""
        with self._changed:
            return self._time_ns()

    def _time_ns(self) -> int:
        if self._paused or self._anchor_s is None:
            return self._anchor_ns
        now = self._anchor_ns + round((time.monotonic() - self._anchor_s) * self._rate * 1e9)
        return min(now, self.last_ns)

    def delays(self) -> Delays:
        """Return how late messages were, over the whole playback."""
        delays = self._delays
        if not delays.count:
            return Delays(float("nan"), float("nan"), float("nan"))
        return Delays(
            1e6 * delays.quantile_s(0.5), 1e6 * delays.quantile_s(0.99), 1e6 * delays.maximum_s
        )

    def _read(self) -> None:
        """Read ahead from wherever the position was put last; the reading thread."""
        generation = -1
        while True:
            with self._changed:
                while generation == self._generation and not self._stopping:
                    self._changed.wait()
                if self._stopping:
                    return
                generation, position = self._generation, self._position_ns
            self._read_from(generation, position)

    def _read_from(self, generation: int, position: int) -> None:
        batch: list[Message] = []
        try:
            for message in self._reader.messages(self._topics, position, self.last_ns):
                batch.append(message)
                if len(batch) == BATCH:
                    if not self._put(_Batch(generation, batch)):
                        return
                    batch = []
        except (OSError, ValueError, BagError) as error:
            self.error = error
        self._put(_Batch(generation, batch, last=True))

    def _put(self, batch: _Batch) -> bool:
        """Hand over a batch; False if it is no longer wanted."""
        while batch.generation == self._generation and not self._stopping:
            try:
                self._queue.put(batch, timeout=0.05)
            except queue.Full:
                continue
            return True
        return False

    def _play(self) -> None:
        """Publish batch after batch; the playing thread."""
        while not self._stopping:
            try:
                batch = self._queue.get(timeout=0.05)
            except queue.Empty:
                continue
            for message in batch.messages:
                if not self._play_one(batch.generation, message):
                    break
            else:
                if batch.last:
                    self._end_of_bag(batch.generation)

    def _end_of_bag(self, generation: int) -> None:
        with self._changed:
            if generation != self._generation:  # somebody has jumped meanwhile
                return
            self.loops += 1
            if self._loop and self.error is None:
                self.seek(self.first_ns)
            else:
                self._finished = True

    def _play_one(self, generation: int, message: Message) -> bool:
        """Wait for a message's time and publish it; False if it is no longer wanted."""
        while True:
            if self._stopping or generation != self._generation:
                return False
            if self._paused:
                with self._changed:
                    if self._paused and not self._burst:
                        self._changed.wait(LONGEST_SLEEP_S)
                        continue
                    if self._burst:
                        self._burst -= 1
                        self._anchor_ns = message.log_time
                self._publish_one(message)
                return True
            with self._changed:  # the three of one moment
                if self._anchor_s is None and generation == self._generation:
                    self._anchor_s = time.monotonic()
                anchor_ns, anchor_s, rate = self._anchor_ns, self._anchor_s, self._rate
            if anchor_s is None:
                continue
            deadline = anchor_s + (message.log_time - anchor_ns) * 1e-9 / rate
            remaining = deadline - time.monotonic()
            if remaining > LONGEST_SLEEP_S:
                time.sleep(LONGEST_SLEEP_S)
                continue
            if remaining > 0.0:
                time.sleep(remaining)
            self._publish_one(message)
            self._delays.add_s(time.monotonic() - deadline)
            return True

    def _publish_one(self, message: Message) -> None:
        self._publish(message)
        self.published[message.topic] += 1
