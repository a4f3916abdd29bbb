"""Bags of others: rosbag2 with sqlite3, compressed files or messages, older metadata; by rosbags.

rosbags does the reading. Its bags look here like our own, so whatever plays, converts or
estimates takes them.
"""

from __future__ import annotations

import contextlib
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import zstandard
from rosbags.interfaces import Connection, ConnectionExtRosbag2, MessageDefinitionFormat, Qos
from rosbags.rosbag2 import Reader

from hc_logger import limits
from hc_logger.bag import Bag, Message, Topic
from hc_logger.definitions import TypeDefinition, installed_definition
from hc_logger.errors import BagError, UnknownTypeError
from hc_logger.mcap_chunk import Messages
from hc_logger.metadata import read_information, recorded_custom_data, recorded_hashes

BLOCK_MESSAGES = 16_384
_ADVICE = (
    (
        "disk image is malformed",
        "the file was cut off or damaged: sqlite3 OLD.db3 .dump | sed 's/^ROLLBACK.*/COMMIT;/' | "
        "sqlite3 NEW.db3 copies what is left",
    ),
    ("end magic is invalid", "the file was cut off: mcap recover OLD.mcap -o NEW.mcap copies it"),
    (
        "before the end-of-stream",
        "the compressed file was cut off: zstd -dc OLD > NEW.db3 saves a part",
    ),
)
"""By what rosbags and its libraries say: what helps; our recovery reads no such bag."""


class ForeignBag(Bag):
    """A bag that rosbags reads."""

    def __init__(self, path: Path) -> None:
        """Open a bag folder with its metadata.yaml.

        Raises:
            BagError: if rosbags cannot read it.
        """
        self.path = path
        information = read_information(path) or {}
        self.paths = [path / name for name in information.get("relative_file_paths", [])]
        if information.get("compression_mode", "").lower() == "file":
            for file in self.paths:
                _check_unpacked_size(file)
        with _errors(path):
            self._reader = Reader(path)
            self._reader.open()
        self.custom_data = recorded_custom_data(information)
        self._problems: list[str] = []
        self._hashes = recorded_hashes(information)
        self._connections: dict[str, list[Connection]] = {}
        self.topics = {}
        for connection in self._reader.connections:
            definition = self._definition(connection)
            if definition is not None:
                self._connections.setdefault(connection.topic, []).append(connection)
                self.topics.setdefault(
                    connection.topic, Topic(connection.topic, definition, _profiles(connection))
                )
        self.topics = dict(sorted(self.topics.items()))

    def _definition(self, connection: Connection) -> TypeDefinition | None:
        """Return the type's definition: the bag's own, else the installed one."""
        name = connection.msgtype
        if connection.msgdef.format == MessageDefinitionFormat.MSG and connection.msgdef.data:
            type_hash = connection.digest or self._hashes.get(connection.topic, "")
            return TypeDefinition(name, connection.msgdef.data, type_hash)
        try:
            return installed_definition(name)
        except UnknownTypeError as error:
            self._problems.append(f"{connection.topic} cannot be read: {error}")
            return None

    @property
    def problems(self) -> list[str]:
        """One line for each topic that cannot be read."""
        return list(self._problems)

    def time_range(self) -> tuple[int, int] | None:
        """Return first and last log time (ns); None without messages."""
        if not self._reader.message_count:
            return None
        return int(self._reader.start_time), int(self._reader.end_time) - 1

    def messages(
        self,
        topics: Collection[str] | None = None,
        start_ns: int | None = None,
        end_ns: int | None = None,
    ) -> Iterator[Message]:
        """Yield messages by log time; see Bag."""
        wanted = [
            connection
            for topic, connections in self._connections.items()
            if topics is None or topic in topics
            for connection in connections
        ]
        if not wanted:
            return
        stop = None if end_ns is None else end_ns + 1
        messages = self._reader.messages(wanted, start=start_ns, stop=stop)
        while True:
            with _errors(self.path):
                message = next(messages, None)
            if message is None:
                return
            connection, time, data = message
            if not isinstance(time, int) or not isinstance(data, (bytes, memoryview)):
                raise BagError(f"{self.path} cannot be read: a message is of another kind")
            yield Message(connection.topic, time, time, bytes(data))

    def chunks(self) -> Iterator[tuple[Messages, dict[int, str]]]:
        """Yield all messages in blocks; see Bag."""
        numbers = {topic: number for number, topic in enumerate(self.topics)}
        names = dict(enumerate(self.topics))
        block: list[Message] = []
        for message in self.messages():
            block.append(message)
            if len(block) == BLOCK_MESSAGES:
                yield _stack(block, numbers), names
                block = []
        if block:
            yield _stack(block, numbers), names

    def close(self) -> None:
        """Close the bag."""
        self._reader.close()


@contextlib.contextmanager
def _errors(path: Path) -> Iterator[None]:
    """Turn what rosbags raises into one line: its own errors and those of what it builds on."""
    try:
        yield
    except BagError:
        raise
    except MemoryError as error:
        raise BagError(f"{path}: not enough memory to unpack it") from error
    except Exception as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        advice = next((f"; {what}" for sign, what in _ADVICE if sign in reason), "")
        raise BagError(f"{path} cannot be read: {reason[:200]}{advice}") from error


def _check_unpacked_size(path: Path) -> None:
    """See what a compressed file unpacks to before all of it is unpacked to the disk.

    Raises:
        BagError: if it is more than may be, or cannot be unpacked.
    """
    size = 0
    with _errors(path), open(path, "rb") as file:
        for part in zstandard.ZstdDecompressor().read_to_iter(file, write_size=limits.MIB):
            size += len(part)
            limits.check_in_memory(size, str(path))


def _stack(block: list[Message], numbers: dict[str, int]) -> Messages:
    length = np.array([len(m.data) for m in block], np.int64)
    time = np.array([m.log_time for m in block], np.int64)
    return Messages(
        np.frombuffer(b"".join(m.data for m in block), np.uint8),
        np.array([numbers[m.topic] for m in block], np.int64),
        time,
        time,
        np.zeros(len(block), np.uint32),
        np.concatenate([[0], np.cumsum(length)[:-1]]),
        length,
    )


def _profiles(connection: Connection) -> list[dict[str, Any]]:
    if not isinstance(connection.ext, ConnectionExtRosbag2):
        return []
    return [_profile(qos) for qos in connection.ext.offered_qos_profiles]


def _profile(qos: Qos) -> dict[str, Any]:
    """Return a profile as rosbag2 writes it in version 9."""

    def time(value: Any) -> dict[str, int]:
        return {"sec": value.sec, "nsec": value.nsec}

    return {
        "history": qos.history.name.lower(),
        "depth": qos.depth,
        "reliability": qos.reliability.name.lower(),
        "durability": qos.durability.name.lower(),
        "deadline": time(qos.deadline),
        "lifespan": time(qos.lifespan),
        "liveliness": qos.liveliness.name.lower(),
        "liveliness_lease_duration": time(qos.liveliness_lease_duration),
        "avoid_ros_namespace_conventions": qos.avoid_ros_namespace_conventions,
    }
