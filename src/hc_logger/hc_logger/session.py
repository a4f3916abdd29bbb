"""What the recorder keeps besides the ROS graph: the bag, its flushing, counts, a full disk.

A write that fails (full disk, unplugged disk) must not end a run: the session then stops writing,
keeps counting, and says so. Where a disk that was full has room again it goes on, in the same bag.
Its counts never claim what is not in the bag.
"""

from __future__ import annotations

import errno
import os
import threading
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from hc_logger.writer import BagWriter

FLUSH_INTERVAL_S = 0.05
"""What a killed recorder loses; the recorder looks for messages twice in it.
Chunks of so little make the file 6 % larger than chunks of 0.25 s, at the same processor time."""
INCOMPLETE = 3
"""Exit status of a recorder that went on to the end of the run and could not write all of it."""
ROOM_BYTES, ROOM_SHARE = 64 * 1024**2, 0.01
"""What has to be free on a disk that was full before writing goes on, and at most of the disk: less
is soon full again."""
LOOK_S = 1.0
"""How often that is looked at."""
LONGEST_COUNTED_GAP = 1_000_000
"""A jump of a publisher's counter beyond this is a restarted publisher, not a loss."""


@dataclass
class TopicCount:
    """Messages and bytes written of a topic, and messages lost on the way to the recorder.

    Losses are gaps in the publisher's own counter, so they cannot be told where several
    publishers share a topic.
    """

    messages: int = 0
    bytes: int = 0
    dropped: int = 0
    last_sequence: int | None = None

    def note(self, sequence: int | None) -> None:
        """Count what is missing before a message; a counter that goes back is another publisher."""
        last, self.last_sequence = self.last_sequence, sequence
        if sequence is None or last is None:
            return
        missing = sequence - last - 1
        if missing < 0:
            self.last_sequence = None
        elif missing < LONGEST_COUNTED_GAP:
            self.dropped += missing


class RecordingSession:
    """Writes what arrives into a bag, flushes by time, and counts.

    Attributes:
        counts: by topic number.
        failure: why writing has stopped, empty while it works.
        unwritten: messages that arrived and are not in the bag.
        waits: whether writing has stopped for a full disk, and goes on once there is room.
    """

    def __init__(
        self,
        writer: BagWriter,
        *,
        flush_interval_s: float = FLUSH_INTERVAL_S,
        fsync_interval_s: float = 5.0,
    ) -> None:
        """Start a session.

        Args:
            writer: the open bag.
            flush_interval_s: a killed recorder loses at most this much (and what is on its way).
            fsync_interval_s: a power cut loses at most this much more; 0 leaves it to the system.
        """
        self.writer = writer
        self.counts: dict[int, TopicCount] = {}
        self.failure = ""
        self.unwritten = 0
        self.waits = False
        self._flush_interval_s = flush_interval_s
        self._last_flush = self._last_look = time.monotonic()
        self._stop = threading.Event()
        self._sync_error: OSError | None = None
        self._syncer: threading.Thread | None = None
        if fsync_interval_s > 0:
            # in a thread of its own: a slow disk must not hold up the reception
            self._syncer = threading.Thread(
                target=self._sync_repeatedly, args=(fsync_interval_s,), daemon=True
            )
            self._syncer.start()

    def add_topic(
        self, name: str, type_name: str, qos_profiles: Sequence[Mapping[str, Any]]
    ) -> int:
        """Announce a topic; returns its number.

        Raises:
            UnknownTypeError: if the type is not installed.
        """
        number = self.writer.add_topic(name, type_name, qos_profiles=qos_profiles)
        self.counts[number] = TopicCount()
        return number

    def add_many(
        self,
        topic: int,
        log_times_ns: Sequence[int],
        data: Sequence[bytes],
        publish_times_ns: Sequence[int],
        sequences: Sequence[int | None],
    ) -> None:
        """Write messages of one topic in the order in which they came.

        Args:
            topic: number from add_topic().
            log_times_ns: times of reception.
            data: CDR bytes.
            publish_times_ns: times of publication.
            sequences: the publisher's counter; None if not known or not of one publisher.
        """
        count, number = self.counts[topic], len(data)
        for sequence in sequences:
            count.note(sequence)
        if self.failure:
            self.unwritten += number
            return
        # Counted before: what of them is in no whole chunk if it fails, `_fail` takes off again.
        count.messages += number
        count.bytes += sum(map(len, data))
        counters = [(sequence or 0) & 0xFFFFFFFF for sequence in sequences]
        try:
            self.writer.write_many(topic, log_times_ns, data, publish_times_ns, counters)
        except OSError as error:
            self._fail(error)

    def flush_if_due(self, early_s: float = 0.0) -> None:
        """Flush when the interval is over, or will be so soon; call it often.

        Args:
            early_s: so much before its end counts as its end, for who comes by a clock.
        """
        now = time.monotonic()
        if now - self._last_flush < self._flush_interval_s - early_s or self.failure:
            return
        self._last_flush = now
        if self._sync_error is not None:
            self._fail_for_good(self._sync_error)
            return
        try:
            self.writer.flush()
        except OSError as error:
            self._fail(error)

    def go_on(self) -> bool:
        """Go on writing if the disk was full and has room again; call it often.

        Returns:
            Whether writing goes on from here.
        """
        now = time.monotonic()
        if not self.waits or now - self._last_look < LOOK_S:
            return False
        self._last_look = now
        return self._goes_on()

    def _goes_on(self) -> bool:
        try:
            disk = os.statvfs(self.writer.folder)
            if disk.f_bavail < min(ROOM_BYTES / disk.f_frsize, ROOM_SHARE * disk.f_blocks):
                return False
            self.writer.go_on()
        except OSError:  # the failure that is told already lasts
            return False
        self.failure, self.waits = "", False
        return True

    @property
    def incomplete(self) -> str:
        """Why not everything that arrived is in the bag; empty where it is."""
        if self.failure or not self.unwritten:
            return self.failure
        plural = "s were" if self.unwritten > 1 else " was"
        return (
            f"{self.unwritten} message{plural} not written into {self.writer.path} while its disk "
            "was full"
        )

    def _fail(self, error: OSError) -> None:
        """Stop writing; what was handed over and is in no whole chunk does not count as written."""
        self.waits = error.errno == errno.ENOSPC
        self._last_look = time.monotonic()
        self.failure = f"cannot write {self.writer.path}: {error.strerror or error}"
        for topic, count in self.counts.items():
            safe = self.writer.safe_count(topic)
            self.unwritten += count.messages - safe
            count.messages = safe

    def _fail_for_good(self, error: OSError) -> None:
        """Stop writing to a disk that did not keep what it had taken: nobody knows what."""
        self._fail(error)
        self.waits = False

    def _sync_repeatedly(self, interval_s: float) -> None:
        while not self._stop.wait(interval_s):
            if self.failure:
                continue  # there may be room again
            try:
                self.writer.sync()
            except OSError as error:
                self._sync_error = error  # told by the thread that writes and counts
                return

    @property
    def messages(self) -> int:
        """Messages written."""
        return sum(count.messages for count in self.counts.values())

    @property
    def dropped(self) -> int:
        """Messages that publishers sent and that did not arrive."""
        return sum(count.dropped for count in self.counts.values())

    def close(self) -> None:
        """Write the rest and the metadata."""
        self._stop.set()
        if self._syncer is not None:
            self._syncer.join()
        if self._sync_error is not None and not self.failure:
            self._fail_for_good(self._sync_error)
        if self.failure and not (self.waits and self._goes_on()):
            self.writer.abandon()
            return
        try:
            self.writer.close()
        except OSError as error:
            self._fail(error)
            self.writer.abandon()
