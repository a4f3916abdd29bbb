"""Reads one MCAP file, whole, cut off or damaged, chunk by chunk.

The mcap package's readers refuse a file without its end and make one Python object per message.
This one goes through the file's records from the front, so it needs no index; where the records
cannot be followed it looks for the next chunk. One chunk at a time is in memory. (The package's
StreamReader reads every chunk's content to step over it, ten times slower, and tells no positions.)
"""

from __future__ import annotations

import re
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, NamedTuple

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Metadata, Schema

from hc_logger.csv_open import is_text
from hc_logger.errors import BagError
from hc_logger.limits import largest_chunk
from hc_logger.mcap_chunk import (
    CHUNK_HEAD,
    RECORD_HEAD,
    DamageError,
    Messages,
    parse,
    unpack,
    unpack_cut,
)
from hc_logger.new_file import is_being_written
from hc_logger.other_files import what_it_is

MAGIC = b"\x89MCAP0\r\n"
LOOSE_BYTES = 1024 * 1024
"""Messages outside chunks are read in runs of about this size."""
SEARCH_BYTES = 16 * 1024 * 1024
LAST_STANDARD_OPCODE = 0x0F
FIRST_PRIVATE_OPCODE = 0x80
_CHUNK_PATTERN = re.compile(
    rb"\x06(?=.{36}(?:\x00\x00\x00\x00|\x03\x00\x00\x00lz4|\x04\x00\x00\x00zstd))", re.DOTALL
)
"""A chunk's opcode, and the name of its compression where it must stand."""
_PATTERN_BYTES = 64
_UNREADABLE = (struct.error, UnicodeDecodeError, McapError, IndexError)
"""What the mcap package raises for a record that is no such record."""
_FOOTER = struct.Struct("<QQI")


class ChunkPlace(NamedTuple):
    """Where a chunk (or a run of messages outside chunks) stands in the file.

    Of one that is cut off these are what is there of it.
    """

    offset: int
    length: int
    start_ns: int
    end_ns: int
    loose: bool
    cut: bool = False


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
        size: size of the file in bytes.
        unreadable: byte ranges (from, to) where the records could not be followed.
        cut_chunk: what is said of a chunk in which the file ends and of which a part can be read.
    """

    chunks: list[ChunkPlace] = field(default_factory=list)
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    complete: bool = False
    size: int = 0
    unreadable: list[tuple[int, int]] = field(default_factory=list)
    cut_chunk: str = ""


class McapFile:
    """One MCAP file opened for reading.

    Attributes:
        path: the file.
        scan: what the first pass found. Where the file has no end with a list of its channels,
            the chunks were unpacked once to find them.
        damaged: chunks that were met and cannot be used.
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
            if magic and is_text(path):
                raise BagError(f"{path} is a table in text: make a bag of it with hc bag convert")
            raise BagError(
                f"{path} is empty: its recorder wrote nothing"
                if not magic
                else f"{path} {what_it_is(path) or 'is not an MCAP file'}"
            )
        self.damaged: list[DamagedChunk] = []
        self._checked: set[int] = set()
        self.scan = FileScan()
        being_written = is_being_written(self._stream.fileno())
        self._scan()
        self._is_growing = being_written and not self.scan.complete
        if not self.scan.complete or (self.scan.chunks and not self.scan.channels):
            self._collect_from_chunks()

    def _collect_from_chunks(self) -> None:
        """Take the descriptions of the topics from the chunks, which have checksums.

        What stood at the end of the file serves only for what a damaged chunk does not tell.
        """
        scan = self.scan
        schemas, scan.schemas = scan.schemas, {}
        channels, scan.channels = scan.channels, {}
        for place in scan.chunks:
            self.read_chunk(place)
        if self.damaged or not scan.channels:
            scan.schemas = schemas | scan.schemas
            scan.channels = channels | scan.channels

    def close(self) -> None:
        """Close the file."""
        self._stream.close()

    def problems(self) -> list[str]:
        """Return one line for each thing that could not be read so far."""
        scan = self.scan
        lines = []
        for start, end in scan.unreadable:
            if end < scan.size or scan.complete:
                lines.append(f"damaged from byte {start} to {end} of {scan.size}")
            elif not self._is_growing:
                lines.append(f"cut off at byte {start} of {end}, or being recorded")
        if self._is_growing:
            lines.append(f"is being recorded: its first {scan.size} bytes were read")
        elif scan.cut_chunk:
            lines.append(scan.cut_chunk)
        elif not scan.complete and not lines:
            lines.append(f"cut off after byte {scan.size}, or being recorded: its end is missing")
        lines += [
            f"the chunk at byte {damage.place.offset} is damaged ({damage.reason})"
            for damage in self.damaged
        ]
        return lines

    def _scan(self) -> None:
        """Follow the records; look for the next chunk where that fails."""
        scan = self.scan
        scan.size = self._stream.seek(0, 2)
        position = before = len(MAGIC)
        while position < scan.size:
            after = self._scan_record(position)
            if after is None:
                # the length that led here may be the damaged one: look from inside that record
                found = self._find_chunk(min(before + RECORD_HEAD.size, position + 1))
                if found is None:
                    if not self._scan_cut_chunk(position):
                        scan.unreadable.append((position, scan.size))
                    return
                scan.unreadable.append((position, found))
                before, position = found, found
                continue
            if scan.complete:
                return
            before, position = position, after

    def _scan_cut_chunk(self, position: int) -> bool:
        """Take note of a chunk at a position that ends behind the file; False if it is none.

        Nor is one of which no message can be read.
        """
        self._stream.seek(position)
        head = self._stream.read(RECORD_HEAD.size + _PATTERN_BYTES)
        if len(head) < RECORD_HEAD.size:
            return False
        opcode, length = RECORD_HEAD.unpack_from(head)
        place = _chunk_place(head[RECORD_HEAD.size :], position, length)
        there = self.scan.size - position
        if opcode != Opcode.CHUNK or place is None or not there < place.length:
            return False
        try:
            if there > largest_chunk():
                raise DamageError("it is larger than the limit")
            self._stream.seek(position)
            messages, _ = parse(unpack_cut(self._stream.read(there)), whole=False)
        except DamageError:
            return False
        count = len(messages.log_time)
        if count:
            first, last = int(messages.log_time.min()), int(messages.log_time.max())
            self.scan.chunks.append(ChunkPlace(position, there, first, last, False, cut=True))
            self.scan.cut_chunk = (
                f"cut off at byte {self.scan.size}, within the chunk from byte {position} to "
                f"{position + place.length}: the first {count} messages of it can be read"
            )
        return count > 0

    def _scan_record(self, position: int) -> int | None:
        """Take note of the record at a position; return where it ends, None if it is damaged."""
        scan, stream = self.scan, self._stream
        stream.seek(position)
        head = stream.read(RECORD_HEAD.size)
        if len(head) < RECORD_HEAD.size:
            return None
        opcode, length = RECORD_HEAD.unpack(head)
        after: int = position + RECORD_HEAD.size + length
        standard = 0 < opcode <= LAST_STANDARD_OPCODE
        if after > scan.size or not (standard or opcode >= FIRST_PRIVATE_OPCODE):
            return None
        if opcode == Opcode.CHUNK:
            place = _chunk_place(stream.read(_PATTERN_BYTES), position, length)
            if place is None:
                return None
            if place.offset not in {known.offset for known in scan.chunks[-1:]}:
                scan.chunks.append(place)
        elif opcode == Opcode.MESSAGE:
            return self._scan_loose(position, after)
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.METADATA):
            try:
                self._keep(opcode, stream.read(length))
            except _UNREADABLE:
                return None
        elif opcode == Opcode.FOOTER:
            content = stream.read(length)
            if stream.read() != MAGIC or not self._summary_is_sound(position, content):
                return None
            scan.complete = True
        return after

    def _summary_is_sound(self, footer: int, content: bytes) -> bool:
        """Check the checksum of everything from the summary to the footer, if there is one."""
        if len(content) < _FOOTER.size:
            return False
        start, _, checksum = _FOOTER.unpack_from(content)
        if not checksum or not start:
            return True
        if start >= footer:
            return False
        self._stream.seek(start)
        end = footer + RECORD_HEAD.size + _FOOTER.size - 4
        return bool(zlib.crc32(self._stream.read(end - start)) == checksum)

    def _scan_loose(self, position: int, after: int) -> int:
        """Add a message outside chunks to the run of such messages before it."""
        (time,) = struct.unpack("<6xq8x", self._stream.read(22).ljust(22, b"\0"))
        chunks = self.scan.chunks
        last = chunks[-1] if chunks else None
        if (
            last is not None
            and last.loose
            and last.offset + last.length == position
            and last.length < LOOSE_BYTES
        ):
            chunks[-1] = ChunkPlace(
                last.offset,
                after - last.offset,
                min(last.start_ns, time),
                max(last.end_ns, time),
                True,
            )
        else:
            chunks.append(ChunkPlace(position, after - position, time, time, True))
        return after

    def _find_chunk(self, position: int) -> int | None:
        """Return where the next chunk record begins that agrees with itself."""
        known = self.scan.chunks[-1].offset if self.scan.chunks else -1
        while position < self.scan.size:
            self._stream.seek(position)
            block = self._stream.read(SEARCH_BYTES + _PATTERN_BYTES)
            for match in _CHUNK_PATTERN.finditer(block):
                offset = position + match.start()
                if match.start() >= SEARCH_BYTES:
                    break
                raw = block[match.start() : match.start() + RECORD_HEAD.size + _PATTERN_BYTES]
                _, length = RECORD_HEAD.unpack_from(raw)
                end = offset + RECORD_HEAD.size + length
                place = _chunk_place(raw[RECORD_HEAD.size :], offset, length)
                if place is not None and end <= self.scan.size and offset > known:
                    return offset
            position += SEARCH_BYTES
        return None

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
        first_time = place.offset not in self._checked
        self._checked.add(place.offset)
        try:
            take = unpack_cut if place.cut else unpack
            content = raw if place.loose else take(raw)
            messages, others = parse(content, whole=not place.cut)
            if first_time:
                described = np.isin(others[:, 0], (Opcode.SCHEMA, Opcode.CHANNEL))
                for opcode, start, length in others[described].tolist():
                    self._keep(opcode, content[start : start + length])
        except (DamageError, *_UNREADABLE) as error:
            if first_time:
                self.damaged.append(DamagedChunk(place, str(error)))
            return None
        return messages

    def chunks(self) -> Iterator[Messages]:
        """Yield the messages of all sound chunks in the order of the file."""
        for place in self.scan.chunks:
            messages = self.read_chunk(place)
            if messages is not None:
                yield messages

    def indexed_counts(self, place: ChunkPlace) -> dict[int, int]:
        """Return how many messages of each channel the index after a chunk lists.

        It tells what was in a chunk that cannot be read; empty where there is no index.
        """
        counts: dict[int, int] = {}
        position = place.offset + place.length
        while True:
            self._stream.seek(position)
            head = self._stream.read(RECORD_HEAD.size + 6)
            if len(head) < RECORD_HEAD.size + 6:
                return counts
            opcode, length = RECORD_HEAD.unpack_from(head)
            channel, size = struct.unpack_from("<HI", head, RECORD_HEAD.size)
            if opcode != Opcode.MESSAGE_INDEX or size != length - 6:
                return counts
            counts[channel] = size // 16
            position += RECORD_HEAD.size + length


def _chunk_place(head: bytes, position: int, length: int) -> ChunkPlace | None:
    """Return a chunk's place from the first bytes of its content; None if they disagree.

    The lengths must add up: 28 bytes, the compression's name, its records, each with a length.
    """
    if len(head) < CHUNK_HEAD.size + 12:
        return None
    start, end, _, _ = CHUNK_HEAD.unpack_from(head)
    (name_length,) = struct.unpack_from("<I", head, CHUNK_HEAD.size)
    if name_length > 16 or len(head) < CHUNK_HEAD.size + 12 + name_length:
        return None
    (packed_size,) = struct.unpack_from("<Q", head, CHUNK_HEAD.size + 4 + name_length)
    if CHUNK_HEAD.size + 12 + name_length + packed_size != length:
        return None
    return ChunkPlace(position, RECORD_HEAD.size + length, start, end, False)
