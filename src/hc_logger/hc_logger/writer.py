"""Writes a bag: a folder with MCAP files and metadata.yaml, in the layout of rosbag2.

Chunks are small and flushed often, so that little is lost when the process is killed. flush()
hands everything to the operating system (survives SIGKILL), sync() to the disk (survives a power
cut). mcap_writer.py does the encoding.
"""

from __future__ import annotations

import contextlib
import os
import threading
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

from hc_logger.definitions import TypeDefinition, installed_definition
from hc_logger.errors import BagError, BagExistsError
from hc_logger.followed_folder import FollowedFolder
from hc_logger.mcap_writer import McapWriter
from hc_logger.metadata import (
    BagMetadata,
    FileRecord,
    TopicRecord,
    information_text,
    qos_text,
    remove_metadata,
    write_metadata,
)
from hc_logger.new_file import RawFile, sync

CHUNK_BYTES = 256 * 1024
MOST_TOGETHER = 64
"""Messages between two looks at whether the file is long enough."""
LIBRARY = "hc_logger"
_TIME_BITS = 2**64 - 1


class BagWriter:
    """Writes messages into a new bag folder."""

    def __init__(
        self,
        path: str | os.PathLike[str],
        *,
        custom_data: Mapping[str, str] | None = None,
        chunk_bytes: int = CHUNK_BYTES,
        max_file_bytes: int = 0,
        max_file_duration_s: float = 0.0,
    ) -> None:
        """Make the folder and its first file.

        Args:
            path: bag folder; must not exist.
            custom_data: texts that go into the metadata (configuration, seed, version).
            chunk_bytes: size at which a chunk is compressed and written.
            max_file_bytes: begin a new file when one has got this large (on the disk, at most a
                chunk and `MOST_TOGETHER` messages more); 0 for no limit. It also bounds memory:
                the index of a file is kept until the file is finished.
            max_file_duration_s: begin a new file after so many seconds of log time; 0 as above.

        Raises:
            BagExistsError: if the path exists.
            BagError: if the folder cannot be made.
        """
        self.path = Path(path)
        self._followed = FollowedFolder(self.path)
        self._chunk_bytes = chunk_bytes
        self._max_file_bytes = max_file_bytes or 2**63
        self._max_file_ns = round(max_file_duration_s * 1e9) or 2**63
        self._topics: list[TopicRecord] = []
        self._definitions: list[TypeDefinition] = []
        self._files: list[FileRecord] = []
        self._custom_data = {k: _plain(v) for k, v in (custom_data or {}).items()}
        self._schemas: dict[tuple[str, str], int] = {}
        self._safe_before: dict[int, int] = {}  # in whole chunks of files before the present one
        self._closed = False
        self._opens = False  # a file, which is not complete before that is over
        self._files_lock = threading.Lock()
        self._unsynced: list[int] = []
        try:
            self.path.mkdir(parents=True)  # atomic: of two recorders on one folder one gets it
        except OSError as error:
            if self.path.exists():
                raise BagExistsError(
                    f"{self.path} exists already and is not overwritten; "
                    "give another name or delete it"
                ) from None
            raise BagError(f"cannot make the bag folder {self.path}: {error.strerror}") from error
        self._stream = RawFile.none()
        self._writer = McapWriter(self._stream, chunk_bytes)
        try:
            self._followed.hold()
            self._open_file()
        except OSError as error:
            self.discard()
            raise BagError(f"cannot write {self.path}: {error.strerror}") from error

    def _open_file(self) -> None:
        self._opens = True
        self._file = FileRecord(_plain(f"{self.path.resolve().name}_{len(self._files)}.mcap"))
        self._files.append(self._file)
        with self._files_lock:
            self._stream = RawFile(self.folder / self._file.path)
        for number, count in self._writer.written.items():
            self._safe_before[number] = self._safe_before.get(number, 0) + count
        self._writer = McapWriter(self._stream, self._chunk_bytes)
        self._writer.start(profile="ros2", library=LIBRARY)
        self._counts_at_open = [topic.message_count for topic in self._topics]
        self._schemas.clear()
        for topic, definition in zip(self._topics, self._definitions, strict=True):
            self._register(topic, definition)
        self._opens = False

    def _register(self, topic: TopicRecord, definition: TypeDefinition) -> int:
        key = (definition.name, definition.text)
        if key not in self._schemas:
            self._schemas[key] = self._writer.register_schema(
                definition.name, "ros2msg", definition.text.encode()
            )
        channel_id: int = self._writer.register_channel(
            topic.name,
            "cdr",
            self._schemas[key],
            {
                "offered_qos_profiles": qos_text(topic.qos_profiles),
                "topic_type_hash": topic.type_hash,
            },
        )
        return channel_id

    def add_topic(
        self,
        name: str,
        type_name: str,
        *,
        qos_profiles: Sequence[Mapping[str, Any]] = (),
        definition: TypeDefinition | None = None,
    ) -> int:
        """Announce a topic and return its number for write().

        Args:
            name: topic name; a leading slash is added where it is missing.
            type_name: for example "hc_msgs/msg/IndenterSample".
            qos_profiles: what the publishers offered, as rosbag2 has it.
            definition: text and hash of the type; None takes those installed here.

        Raises:
            UnknownTypeError: if no definition is given and the type is not installed.
        """
        definition = definition or installed_definition(type_name)
        topic = TopicRecord(
            name if name.startswith("/") else "/" + name,
            definition.name,
            definition.type_hash,
            [dict(profile) for profile in qos_profiles],
        )
        self._topics.append(topic)
        self._definitions.append(definition)
        return self._register(topic, definition)

    def write(
        self,
        topic: int,
        log_time_ns: int,
        data: bytes,
        publish_time_ns: int | None = None,
        sequence: int = 0,
    ) -> None:
        """Add a message.

        Args:
            topic: number from add_topic().
            log_time_ns: time of reception, by which a player orders and spaces the messages.
            data: the message in CDR with its 4-byte encapsulation.
            publish_time_ns: time of publication; None takes the log time.
            sequence: the publisher's counter, 0 if not known.

        Raises:
            OSError: if the disk is full or gone.
        """
        published = log_time_ns if publish_time_ns is None else publish_time_ns
        self.write_many(topic, (log_time_ns,), (data,), (published,), (sequence,))

    def write_many(
        self,
        topic: int,
        log_times_ns: Sequence[int],
        data: Sequence[bytes],
        publish_times_ns: Sequence[int],
        sequences: Sequence[int],
    ) -> None:
        """Add messages of one topic, which cost half of as many calls of `write`.

        Args:
            topic: number from add_topic().
            log_times_ns: times of reception.
            data: the messages, as in `write`.
            publish_times_ns: times of publication.
            sequences: the publisher's counter, 0 if not known.

        Raises:
            OSError: if the disk is full or gone.
        """
        for start in range(0, len(data), MOST_TOGETHER):
            some = slice(start, start + MOST_TOGETHER)
            log_times = [time & _TIME_BITS for time in log_times_ns[some]]
            record = self._file
            if record.message_count and (
                log_times_ns[start] - record.start_ns > self._max_file_ns
                or self._stream.tell() > self._max_file_bytes
            ):
                self._finish_file()
                self._open_file()
                record = self._file
            published = [time & _TIME_BITS for time in publish_times_ns[some]]
            self._writer.add_messages(topic, log_times, data[some], published, sequences[some])
            earliest, latest = min(log_times_ns[some]), max(log_times_ns[some])
            if not record.message_count:
                record.start_ns, record.end_ns = earliest, latest
            record.start_ns = min(record.start_ns, earliest)
            record.end_ns = max(record.end_ns, latest)
            record.message_count += len(log_times)
            self._topics[topic - 1].message_count += len(log_times)

    def safe_count(self, topic: int) -> int:
        """Return how many messages of a topic are in chunks that were written whole."""
        return self._safe_before.get(topic, 0) + self._writer.written.get(topic, 0)

    @property
    def message_count(self) -> int:
        """Messages written so far, over all files."""
        return sum(record.message_count for record in self._files)

    @property
    def folder(self) -> Path:
        """The folder by the name that it has now."""
        return self._followed.path

    def bytes_written(self) -> int:
        """Return the size of the current file so far."""
        return self._stream.tell()

    @property
    def file_count(self) -> int:
        """Number of files so far."""
        return len(self._files)

    def flush(self) -> None:
        """Hand everything received so far to the operating system."""
        self._writer.flush()

    def sync(self) -> None:
        """Hand what was flushed to the disk; may take long, may be called from another thread.

        Raises:
            OSError: if the disk failed, or somebody has deleted the file.
        """
        with self._files_lock:
            numbers = [] if self._stream.closed else [self._stream.duplicate()]
            numbers, self._unsynced = self._unsynced + numbers, []
        try:
            for number in numbers:
                sync(number)
        finally:
            for number in numbers:
                os.close(number)

    def set_custom_data(self, key: str, value: str) -> None:
        """Set a text of the metadata that is known only at the end."""
        self._custom_data[key] = _plain(value)

    def _finish_file(self) -> None:
        own = [
            TopicRecord(t.name, t.type_name, t.type_hash, t.qos_profiles, t.message_count - before)
            for t, before in zip(
                self._topics,
                self._counts_at_open + [0] * (len(self._topics) - len(self._counts_at_open)),
                strict=True,
            )
        ]
        self.flush()
        self._writer.add_metadata(
            "rosbag2",
            {
                "serialized_metadata": information_text(
                    BagMetadata(own, [self._file], self._custom_data)
                )
            },
        )
        self._writer.finish()
        with self._files_lock:
            self._unsynced.append(self._stream.duplicate())
            self._stream.close()

    def close(self) -> None:
        """Finish the file and write metadata.yaml; a second call does nothing.

        Raises:
            OSError: if the disk is full or gone.
        """
        if self._closed:
            return
        self._finish_file()
        self.sync()
        write_metadata(self.folder, BagMetadata(self._topics, self._files, self._custom_data))
        self._closed = True
        self._followed.let_go()

    def go_on(self) -> None:
        """Go on behind the last whole chunk after a write that failed: there is room again.

        Raises:
            OSError: if there is none, or the disk is gone.
        """
        if self._opens:
            self._stream.close()
            with contextlib.suppress(FileNotFoundError):  # it could not even be made
                (self.folder / self._files[-1].path).unlink()
            self._files.pop()
            self._open_file()
            return
        self._stream.cut(self._writer.whole_end)
        self._writer.take_back()
        self._file.message_count = sum(self._writer.written.values())
        for number, topic in enumerate(self._topics, 1):
            topic.message_count = self.safe_count(number)

    def abandon(self) -> None:
        """Close the file as it is, without its end: after a write that failed."""
        self._closed = True
        self._followed.let_go()
        self._close_files()

    def _close_files(self) -> None:
        with self._files_lock:
            self._stream.close()
            for number in self._unsynced:
                os.close(number)
            self._unsynced = []

    def discard(self) -> None:
        """Delete what was written: for a conversion that failed half way.

        What cannot be deleted stays: the failure that led here is the one to tell.
        """
        self._closed = True
        self._close_files()
        folder = self._followed.let_go()
        with contextlib.suppress(OSError):
            for record in self._files:
                (folder / record.path).unlink(missing_ok=True)
            remove_metadata(folder)
            folder.rmdir()

    def __enter__(self) -> BagWriter:
        return self

    def __exit__(
        self,
        exc_type: type[BaseException] | None,
        exc: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if exc_type is not None:
            self.discard()
            return
        try:
            self.close()
        except OSError:
            self.discard()
            raise


def _plain(text: str) -> str:
    """Return a text that UTF-8 can hold: the name of a file may hold any bytes."""
    return "".join("_" if "\ud800" <= c <= "\udfff" else c for c in text)


@contextlib.contextmanager
def os_errors(what: str) -> Iterator[None]:
    """Turn an OSError of a file operation into a BagError of one line."""
    try:
        yield
    except OSError as error:
        raise BagError(f"{what}: {error.strerror or error}") from error
