"""Writes an MCAP file, many small messages at a time.

The MCAP package's own writer makes 16 calls for a message and as many for its place in the index:
9 us a message, and a chunk's index of 1.4 kB stays in memory until the file ends. A recorder of
4,000 messages a second pays for that. Here a message is one packed head and its bytes, an index is
one array, and what stays of a chunk are the bytes of its index record. What is rare (schemas,
channels, statistics, the summary) is written by the package's records. The file is the same, byte
for byte (test_mcap_writer.py). Record layout: the MCAP specification, version 0.
"""

from __future__ import annotations

import struct
import zlib
from array import array
from collections.abc import Callable, Iterable, Mapping
from typing import Protocol

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

MAGIC = b"\x89MCAP0\r\n"
_MESSAGE = struct.Struct("<BQHIQQ")  # opcode, length, channel, sequence, both times
_OPCODE = int(Opcode.MESSAGE)  # a plain number: looking an enumeration up costs as much as packing
_MESSAGE_INDEX = struct.Struct("<BQHI")
_CHUNK = struct.Struct("<BQQQQII4sQ")
_HEAD = 9  # opcode and length, which the length does not count
_COMPRESSION = "zstd"
_NO_TIME = 2**64  # later than any


class Stream(Protocol):
    """What a file is written to."""

    def write(self, data: bytes) -> int:
        """Write all of it."""

    def tell(self) -> int:
        """Return how many bytes were written."""

    def flush(self) -> None:
        """Hand everything on."""


class McapWriter:
    """Writes one file: `start`, schemas and channels, messages, `finish`.

    Attributes:
        written: messages in chunks that were written whole, by channel.
        whole_end: offset behind the last of these chunks, and its index.
    """

    def __init__(self, stream: Stream, chunk_bytes: int) -> None:
        """Write nothing yet.

        Args:
            stream: takes the file; it is not closed.
            chunk_bytes: size beyond which a chunk is compressed and written.
        """
        self._stream = stream
        self._chunk_bytes = chunk_bytes
        self._compress: Callable[[bytes], bytes] = zstandard.ZstdCompressor().compress
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._metadata: list[MetadataIndex] = []
        self._chunk_indexes = bytearray()
        self._chunk_count = 0
        self.written: dict[int, int] = {}
        self.whole_end = 0
        self._first_ns = _NO_TIME
        self._last_ns = 0
        self._parts: list[bytes] = []  # of the chunk that is being filled
        self._size = 0
        self._places: dict[int, array[int]] = {}  # by channel: log time and offset, in turns
        self._chunk_first_ns = _NO_TIME
        self._chunk_last_ns = 0

    def start(self, profile: str, library: str) -> None:
        """Write the beginning of the file."""
        self._stream.write(MAGIC)
        self._stream.write(_record(Header(profile, library)))
        self.whole_end = self._stream.tell()

    def register_schema(self, name: str, encoding: str, data: bytes) -> int:
        """Add a schema and return its number."""
        number = len(self._schemas) + 1
        self._schemas[number] = Schema(id=number, data=data, encoding=encoding, name=name)
        self._add(_record(self._schemas[number]))
        return number

    def register_channel(
        self, topic: str, encoding: str, schema: int, metadata: Mapping[str, str]
    ) -> int:
        """Add a channel and return its number."""
        number = len(self._channels) + 1
        self._channels[number] = Channel(
            id=number,
            topic=topic,
            message_encoding=encoding,
            schema_id=schema,
            metadata=dict(metadata),
        )
        self._add(_record(self._channels[number]))
        return number

    def add_messages(
        self,
        channel: int,
        log_times_ns: Iterable[int],
        data: Iterable[bytes],
        publish_times_ns: Iterable[int],
        sequences: Iterable[int],
    ) -> None:
        """Add messages of one channel.

        Args:
            channel: its number.
            log_times_ns: times of reception.
            data: the messages.
            publish_times_ns: times of publication.
            sequences: the publisher's counter, below 2^32.
        """
        pack, head, most = _MESSAGE.pack, _MESSAGE.size, self._chunk_bytes
        fields = head - _HEAD
        size, places, parts = self._size, self._places_of(channel), self._parts
        first, last = self._chunk_first_ns, self._chunk_last_ns
        for log_ns, content, publish_ns, sequence in zip(
            log_times_ns, data, publish_times_ns, sequences, strict=True
        ):
            length = len(content)
            places.append(log_ns)
            places.append(size)
            parts.append(pack(_OPCODE, fields + length, channel, sequence, log_ns, publish_ns))
            parts.append(content)
            size += head + length
            if log_ns < first:
                first = log_ns
            if log_ns > last:
                last = log_ns
            if size > most:
                self._size, self._chunk_first_ns, self._chunk_last_ns = size, first, last
                self._finish_chunk()
                size, places, parts = self._size, self._places_of(channel), self._parts
                first, last = self._chunk_first_ns, self._chunk_last_ns
        self._size, self._chunk_first_ns, self._chunk_last_ns = size, first, last
        if not places:
            del self._places[channel]

    def _places_of(self, channel: int) -> array[int]:
        """Return the places of a channel's messages in the present chunk."""
        return self._places.setdefault(channel, array("Q"))

    def add_metadata(self, name: str, data: Mapping[str, str]) -> None:
        """Write a metadata record, outside of the chunks."""
        offset, record = self._stream.tell(), _record(Metadata(name=name, metadata=dict(data)))
        self._metadata.append(MetadataIndex(offset=offset, length=len(record), name=name))
        self._stream.write(record)

    def flush(self) -> None:
        """Write the chunk that is being filled, if it holds a message."""
        self._finish_chunk()
        self._stream.flush()

    def finish(self) -> None:
        """Write what is left, the summary and the end of the file."""
        self._finish_chunk()
        self._stream.write(_record(DataEnd(0)))
        start = self._stream.tell()
        summary, offsets = bytearray(), bytearray()
        for opcode, records in self._summary():
            begin = len(summary)
            for record in records:
                summary += record
            offsets += _record(
                SummaryOffset(
                    group_opcode=opcode,
                    group_start=start + begin,
                    group_length=len(summary) - begin,
                )
            )
        offset_start = start + len(summary)
        summary += offsets
        self._stream.write(bytes(summary))
        head = struct.pack("<BQQQ", Opcode.FOOTER, 8 + 8 + 4, start, offset_start)
        footer = Footer(
            summary_start=start,
            summary_offset_start=offset_start,
            summary_crc=zlib.crc32(head, zlib.crc32(summary)),
        )
        self._stream.write(_record(footer))
        self._stream.write(MAGIC)

    def _summary(self) -> Iterable[tuple[int, Iterable[bytes]]]:
        """Return the groups of the summary section, in the order of the file."""
        statistics = Statistics(
            attachment_count=0,
            channel_count=len(self._channels),
            channel_message_counts=self.written,
            chunk_count=self._chunk_count,
            message_count=sum(self.written.values()),
            metadata_count=len(self._metadata),
            message_start_time=self._first_ns if self.written else 0,
            message_end_time=self._last_ns,
            schema_count=len(self._schemas),
        )
        return (
            (Opcode.SCHEMA, map(_record, self._schemas.values())),
            (Opcode.CHANNEL, map(_record, self._channels.values())),
            (Opcode.STATISTICS, (_record(statistics),)),
            (Opcode.CHUNK_INDEX, (bytes(self._chunk_indexes),)),
            (Opcode.ATTACHMENT_INDEX, ()),
            (Opcode.METADATA_INDEX, map(_record, self._metadata)),
        )

    def _add(self, record: bytes) -> None:
        """Add a record that is no message to the chunk."""
        self._parts.append(record)
        self._size += len(record)
        if self._size > self._chunk_bytes:
            self._finish_chunk()

    def _finish_chunk(self) -> None:
        """Compress and write the chunk and its index; one without messages waits for some."""
        if not self._places:
            return
        first_ns, last_ns = self._chunk_first_ns, self._chunk_last_ns
        content = b"".join(self._parts)
        packed = self._compress(content)
        offset = self._stream.tell()
        head = _CHUNK.pack(
            Opcode.CHUNK,
            _CHUNK.size - _HEAD + len(packed),
            first_ns,
            last_ns,
            len(content),
            zlib.crc32(content),
            len(_COMPRESSION),
            _COMPRESSION.encode(),
            len(packed),
        )
        # What fails from here on is told, and the file is then left as it is.
        self._stream.write(head + packed)
        index_start = self._stream.tell()
        index, offsets = bytearray(), {}
        for channel, places in self._places.items():
            offsets[channel] = index_start + len(index)
            entries = places.tobytes()  # little-endian, as every machine that ROS has wheels for
            index += _MESSAGE_INDEX.pack(
                Opcode.MESSAGE_INDEX,
                _MESSAGE_INDEX.size - _HEAD + len(entries),
                channel,
                len(entries),
            )
            index += entries
        self._stream.write(bytes(index))
        for channel, places in self._places.items():
            self.written[channel] = self.written.get(channel, 0) + len(places) // 2
        self._chunk_indexes += _record(
            ChunkIndex(
                message_start_time=first_ns,
                message_end_time=last_ns,
                chunk_start_offset=offset,
                chunk_length=len(head) + len(packed),
                message_index_offsets=offsets,
                message_index_length=len(index),
                compression=_COMPRESSION,
                compressed_size=len(packed),
                uncompressed_size=len(content),
            )
        )
        self._chunk_count += 1
        self.whole_end = self._stream.tell()
        self._first_ns = min(self._first_ns, first_ns)
        self._last_ns = max(self._last_ns, last_ns)
        self._empty_chunk()

    def _empty_chunk(self) -> None:
        self._parts, self._size, self._places = [], 0, {}
        self._chunk_first_ns, self._chunk_last_ns = _NO_TIME, 0

    def take_back(self) -> None:
        """Forget what is in no whole chunk, after a write failed and the stream was cut there.

        Schemas and channels come again: a chunk that was lost may have had them.
        """
        self._empty_chunk()
        self._metadata = []
        for record in (*self._schemas.values(), *self._channels.values()):
            self._add(_record(record))


def _record(record: object) -> bytes:
    """Return the bytes of one of the package's records."""
    builder = RecordBuilder()
    record.write(builder)  # type: ignore[attr-defined]
    content: bytes = builder.end()
    return content
