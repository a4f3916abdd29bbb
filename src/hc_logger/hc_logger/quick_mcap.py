"""The mcap package's writer with a shorter way for a message.

The package makes an object of every message and writes it, and later its place in the index, one
number at a time: 16 calls of Python for each. Here a message is one pack, and the index of a chunk
another. The bytes are those of the package's own writer: a test compares them.
"""

from __future__ import annotations

import struct
from typing import Any, Final

from mcap._chunk_builder import ChunkBuilder
from mcap.opcode import Opcode
from mcap.records import Channel, Schema
from mcap.writer import Writer

_HEAD: Final = struct.Struct("<BQHIQQ")
_HEAD_BYTES: Final = _HEAD.size
_AFTER_LENGTH: Final = _HEAD_BYTES - 9
_MESSAGE: Final = int(Opcode.MESSAGE)


class _Index:
    """Times and places of the messages of one channel in one chunk."""

    def __init__(self, channel: int) -> None:
        self.channel = channel
        self.numbers: list[int] = []  # time, place, time, place, and so on

    def write(self, builder: Any) -> None:
        """Write the record of the index."""
        numbers = self.numbers
        builder.start_record(Opcode.MESSAGE_INDEX)
        builder.write(struct.pack("<HI", self.channel, 8 * len(numbers)))
        builder.write(struct.pack(f"<{len(numbers)}Q", *numbers))
        builder.finish_record()


class _Chunk:
    """The chunk in progress: what the writer knows as a ChunkBuilder."""

    def __init__(self) -> None:
        self._first = ChunkBuilder()  # makes the records of schemas and channels
        self.reset()

    def reset(self) -> None:
        """Begin anew."""
        self._parts: list[bytes] = []
        self.count = 0
        self.num_messages = 0
        self.message_start_time = self.message_end_time = 0
        self.message_indices: dict[int, _Index] = {}

    def end(self) -> bytes:
        """Return what the chunk holds."""
        return b"".join(self._parts)

    def add_schema(self, schema: Schema) -> None:
        """Add a schema."""
        self._first.add_schema(schema)
        self._take()

    def add_channel(self, channel: Channel) -> None:
        """Add a channel."""
        self._first.add_channel(channel)
        self._take()

    def _take(self) -> None:
        data = self._first.end()
        self._parts.append(data)
        self.count += len(data)

    def add(self, channel: int, log_time: int, data: bytes, publish_time: int, number: int) -> None:
        """Add a message."""
        length = len(data)
        index = self.message_indices.get(channel)
        if index is None:
            index = self.message_indices[channel] = _Index(channel)
        index.numbers += (log_time, self.count)
        self._parts += (
            _HEAD.pack(_MESSAGE, length + _AFTER_LENGTH, channel, number, log_time, publish_time),
            data,
        )
        self.count += length + _HEAD_BYTES
        if not self.num_messages or log_time < self.message_start_time:
            self.message_start_time = log_time
        if log_time > self.message_end_time:
            self.message_end_time = log_time
        self.num_messages += 1


class QuickWriter(Writer):  # type: ignore[misc]  # mcap has no types here
    """Writes MCAP in chunks; as mcap.writer.Writer, which has its parts to itself."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._chunk = self._Writer__chunk_builder = _Chunk()
        self._statistics: Any = self._Writer__statistics
        self._largest: int = self._Writer__chunk_size

    def add_message(
        self, channel_id: int, log_time: int, data: bytes, publish_time: int, sequence: int = 0
    ) -> None:
        """Add a message, as the package's writer does."""
        statistics, chunk = self._statistics, self._chunk
        if not statistics.message_count or log_time < statistics.message_start_time:
            statistics.message_start_time = log_time
        if log_time > statistics.message_end_time:
            statistics.message_end_time = log_time
        statistics.channel_message_counts[channel_id] += 1
        statistics.message_count += 1
        chunk.add(channel_id, log_time, data, publish_time, sequence)
        if chunk.count > self._largest:
            self._Writer__finalize_chunk()
