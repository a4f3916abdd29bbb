"""Reads one MCAP file, whole, cut off or damaged, chunk by chunk.

The mcap package's readers refuse a file without its end and make one Python object per message.
This one goes through the file's records from the front (so it needs no index), unpacks one chunk
at a time, and lets a compiled loop find the messages in it: memory stays at the size of a chunk
and a million messages take well under a second. Record layout: the MCAP specification, version 0.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, NamedTuple

import lz4.frame  # type: ignore[import-untyped]
import numba
import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Metadata, Schema
from numpy.typing import NDArray

from hc_logger.errors import BagError

MAGIC = b"\x89MCAP0\r\n"
RECORD_HEAD = struct.Struct("<BQ")
CHUNK_HEAD = struct.Struct("<QQQI")
LARGEST_CHUNK = 2**31
"""A length beyond this is taken for damage, not for a chunk."""
LOOSE_BYTES = 1024 * 1024
"""Messages outside chunks are read in runs of about this size."""


class ChunkPlace(NamedTuple):
    """Where a chunk (or a run of messages outside chunks) stands in the file."""

    offset: int
    length: int
    start_ns: int
    end_ns: int
    loose: bool


class Messages(NamedTuple):
    """The messages of one chunk, in the order of the file.

    Attributes:
        buffer: (bytes,) uint8, the unpacked chunk.
        channel: (n,) int64 channel numbers.
        log_time: (n,) int64 ns.
        publish_time: (n,) int64 ns.
        offset: (n,) int64, where each message's data starts in the buffer.
        length: (n,) int64, how long it is.
    """

    buffer: NDArray[np.uint8]
    channel: NDArray[np.int64]
    log_time: NDArray[np.int64]
    publish_time: NDArray[np.int64]
    offset: NDArray[np.int64]
    length: NDArray[np.int64]


class DamagedChunk(NamedTuple):
    """A chunk that cannot be used, and why."""

    place: ChunkPlace
    reason: str


@dataclass
class FileScan:
    """What one pass over a file's records found.

    Attributes:
        chunks: places of all chunks, in file order.
        schemas: by number.
        channels: by number.
        metadata: metadata records by name.
        complete: True if the file has its end.
        readable_bytes: how far the records could be followed.
        size: size of the file.
        problem: why the records could not be followed to the end, empty if they could.
    """

    chunks: list[ChunkPlace]
    schemas: dict[int, Schema]
    channels: dict[int, Channel]
    metadata: dict[str, dict[str, str]]
    complete: bool = False
    readable_bytes: int = 0
    size: int = 0
    problem: str = ""


def _walk(buffer: NDArray[np.uint8]) -> NDArray[np.int64]:
    """Return (records, 3) opcode, start of content, length of content of every whole record."""
    size = buffer.size
    count = 0
    position = np.int64(0)
    places = np.empty((0, 3), np.int64)
    for attempt in range(2):  # first count, then fill
        if attempt == 1:
            places = np.empty((count, 3), np.int64)
            count = 0
            position = np.int64(0)
        while position + 9 <= size:
            length = np.int64(0)
            for k in range(8):
                length |= np.int64(buffer[position + 1 + k]) << np.int64(8 * k)
            if length < 0 or length > size - position - 9:
                break
            if attempt == 1:
                places[count, 0] = buffer[position]
                places[count, 1] = position + 9
                places[count, 2] = length
            count += 1
            position += 9 + length
    return places


try:
    walk_records = numba.njit(cache=True)(_walk)
except RuntimeError:  # no folder for numba's cache can be written: compiled anew in each process
    walk_records = numba.njit(_walk)

_MESSAGE_HEAD = np.dtype(
    [("channel", "<u2"), ("sequence", "<u4"), ("log_time", "<i8"), ("publish_time", "<i8")]
)


class McapFile:
    """One MCAP file opened for reading.

    Attributes:
        path: the file.
        scan: what the first pass found. Where the file has no end with a list of its channels,
            the chunks were unpacked once to find them.
    """

    def __init__(self, path: Path) -> None:
        """Open a file and go through its records once.

        Raises:
            BagError: if it is missing, empty or not an MCAP file.
        """
        self.path = path
        try:
            self._stream: BinaryIO = open(path, "rb")  # noqa: SIM115 - kept open
        except OSError as error:
            raise BagError(f"cannot read {path}: {error.strerror}") from error
        magic = self._stream.read(len(MAGIC))
        if magic != MAGIC:
            self._stream.close()
            raise BagError(
                f"{path} is empty: its recorder wrote nothing"
                if not magic
                else f"{path} is not an MCAP file"
            )
        self.damaged: list[DamagedChunk] = []
        self._checked: set[int] = set()
        self.scan = FileScan([], {}, {}, {})
        self._scan()
        if not self.scan.complete or (self.scan.chunks and not self.scan.channels):
            for place in self.scan.chunks:
                self.read_chunk(place)

    def close(self) -> None:
        """Close the file."""
        self._stream.close()

    def _scan(self) -> None:
        scan = self.scan
        stream = self._stream
        scan.size = stream.seek(0, 2)
        position = len(MAGIC)
        loose_start = loose_first = loose_last = -1
        while True:
            stream.seek(position)
            head = stream.read(RECORD_HEAD.size)
            if len(head) < RECORD_HEAD.size:
                break
            opcode, length = RECORD_HEAD.unpack(head)
            after = position + RECORD_HEAD.size + length
            if loose_start >= 0 and (
                opcode != Opcode.MESSAGE or position - loose_start > LOOSE_BYTES
            ):
                scan.chunks.append(
                    ChunkPlace(loose_start, position - loose_start, loose_first, loose_last, True)
                )
                loose_start = -1
            if opcode == 0 or after > scan.size:
                scan.problem = f"cut off or damaged at byte {position} of {scan.size}"
                break
            if opcode == Opcode.CHUNK and length >= CHUNK_HEAD.size:
                start, end, _, _ = CHUNK_HEAD.unpack(stream.read(CHUNK_HEAD.size))
                scan.chunks.append(ChunkPlace(position, after - position, start, end, False))
            elif opcode == Opcode.MESSAGE:
                time = struct.unpack("<6xq", stream.read(14))[0]
                if loose_start < 0:
                    loose_start, loose_first, loose_last = position, time, time
                loose_first, loose_last = min(loose_first, time), max(loose_last, time)
            elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.METADATA):
                self._keep(opcode, stream.read(length))
            elif opcode == Opcode.FOOTER:
                scan.complete = stream.seek(after) == after and stream.read(8) == MAGIC
                if not scan.complete:
                    scan.problem = "the closing mark after the last record is missing"
                position = after
                break
            position = after
        scan.readable_bytes = position
        if not scan.complete and not scan.problem:
            scan.problem = f"cut off after byte {position}"
        if loose_start >= 0:
            scan.chunks.append(
                ChunkPlace(loose_start, position - loose_start, loose_first, loose_last, True)
            )

    def _keep(self, opcode: int, content: bytes) -> None:
        """Keep a schema, channel or metadata record."""
        stream = ReadDataStream(BytesIO(content))
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(stream)
            self.scan.schemas.setdefault(schema.id, schema)
        elif opcode == Opcode.CHANNEL:
            channel = Channel.read(stream)
            self.scan.channels.setdefault(channel.id, channel)
        else:
            metadata = Metadata.read(stream)
            self.scan.metadata[metadata.name] = metadata.metadata

    def read_chunk(self, place: ChunkPlace) -> Messages | None:
        """Unpack a chunk and find its messages.

        A chunk that is damaged (checksum, compression, structure) is noted in `damaged` once.

        Returns:
            The messages, or None if the chunk is damaged.
        """
        self._stream.seek(place.offset)
        raw = self._stream.read(place.length)
        try:
            content = raw if place.loose else _unpack(raw)
            buffer = np.frombuffer(content, np.uint8)
            records = walk_records(buffer)
            end = int(records[-1, 1] + records[-1, 2]) if len(records) else 0
            if end != buffer.size:
                raise ValueError("its records do not fill it")
            messages = _messages(buffer, records)
            if place.offset not in self._checked:
                for opcode, start, length in records[records[:, 0] != Opcode.MESSAGE].tolist():
                    if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                        self._keep(opcode, content[start : start + length])
        except (
            ValueError,
            IndexError,
            struct.error,
            RuntimeError,
            zstandard.ZstdError,
            EOFError,
        ) as error:
            if place.offset not in self._checked:
                self._checked.add(place.offset)
                self.damaged.append(DamagedChunk(place, str(error)))
            return None
        self._checked.add(place.offset)
        return messages

    def chunks(self) -> Iterator[Messages]:
        """Yield the messages of all sound chunks in the order of the file."""
        for place in self.scan.chunks:
            messages = self.read_chunk(place)
            if messages is not None:
                yield messages


def _unpack(raw: bytes) -> bytes:
    """Return the records of a chunk record.

    Raises:
        ValueError, RuntimeError or zstandard.ZstdError: if it is damaged.
    """
    position = RECORD_HEAD.size
    _, _, unpacked_size, checksum = CHUNK_HEAD.unpack_from(raw, position)
    position += CHUNK_HEAD.size
    (name_length,) = struct.unpack_from("<I", raw, position)
    compression = raw[position + 4 : position + 4 + name_length].decode("utf-8")
    position += 4 + name_length
    (packed_size,) = struct.unpack_from("<Q", raw, position)
    packed = raw[position + 8 : position + 8 + packed_size]
    if len(packed) != packed_size or unpacked_size > LARGEST_CHUNK:
        raise ValueError("its stated size is impossible")
    if compression == "zstd":
        content = zstandard.ZstdDecompressor().decompress(packed, max_output_size=unpacked_size)
    elif compression == "lz4":
        content = lz4.frame.decompress(packed)
    elif compression == "":
        content = packed
    else:
        raise ValueError(f"its compression {compression!r} is not known")
    if len(content) != unpacked_size:
        raise ValueError(f"it unpacks to {len(content)} instead of {unpacked_size} bytes")
    if checksum and zlib.crc32(content) != checksum:
        raise ValueError("its checksum is wrong")
    return content


def _messages(buffer: NDArray[np.uint8], records: NDArray[np.int64]) -> Messages:
    rows = records[records[:, 0] == Opcode.MESSAGE]
    start, length = rows[:, 1], rows[:, 2]
    size = _MESSAGE_HEAD.itemsize
    if len(rows) and int(length.min()) < size:
        raise ValueError("it holds a message that is too short")
    heads = buffer[start[:, None] + np.arange(size)].view(_MESSAGE_HEAD).reshape(-1)
    return Messages(
        buffer,
        heads["channel"].astype(np.int64),
        heads["log_time"],
        heads["publish_time"],
        start + size,
        length - size,
    )
