"""One pass over the records of an MCAP file: where its chunks are, and what it tells of itself.

It begins at the front and needs no index; where the records cannot be followed it looks for the
next chunk. (The package's StreamReader reads every chunk's content to step over it, ten times
slower, and tells no positions.)
"""

from __future__ import annotations

import re
import struct
import zlib
from dataclasses import dataclass, field
from io import BytesIO
from typing import BinaryIO, NamedTuple

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Metadata, Schema

from hc_logger.limits import largest_chunk
from hc_logger.mcap_chunk import CHUNK_HEAD, RECORD_HEAD, DamageError, parse, unpack_cut

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
UNREADABLE = (struct.error, UnicodeDecodeError, McapError, IndexError)
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

    def keep(self, opcode: int, content: bytes) -> None:
        """Keep a schema, channel or metadata record.

        Raises:
            one of UNREADABLE: if it is none.
        """
        stream = ReadDataStream(BytesIO(content))
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(stream)
            self.schemas.setdefault(schema.id, schema)
        elif opcode == Opcode.CHANNEL:
            channel = Channel.read(stream)
            self.channels.setdefault(channel.id, channel)
        else:
            metadata = Metadata.read(stream)
            self.metadata[metadata.name] = metadata.metadata


def scan_file(stream: BinaryIO) -> FileScan:
    """Go through the records of a file once.

    Args:
        stream: the file, which begins with MAGIC; its position is changed.
    """
    one_pass = _Pass(stream)
    one_pass.run()
    return one_pass.scan


class _Pass:
    """The pass: follows the records, and notes what it finds in `scan`."""

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream
        self.scan = FileScan()

    def run(self) -> None:
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
                self.scan.keep(opcode, stream.read(length))
            except UNREADABLE:
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
