"""The inside of an MCAP chunk: unpacking, checksum, and all its messages at once.

A compiled loop follows the records; everything else is whole-array numpy, so that a million
messages take well under a second. Record layout: the MCAP specification, version 0.
"""

from __future__ import annotations

import struct
import zlib
from pathlib import Path
from typing import NamedTuple

import lz4.frame  # type: ignore[import-untyped]
import numpy as np
import zstandard
from mcap.opcode import Opcode
from numpy.typing import NDArray

from hc_logger.limits import MOST_RECORDS, why_not_unpack
from hc_msgs_py.compilation import KernelCompiler

RECORD_HEAD = struct.Struct("<BQ")
CHUNK_HEAD = struct.Struct("<QQQI")


class DamageError(Exception):
    """A chunk that cannot be used, and why."""


class Messages(NamedTuple):
    """The messages of one chunk, in the order of the file.

    Attributes:
        buffer: (bytes,) uint8, the unpacked chunk.
        channel: (n,) int64 channel numbers.
        log_time: (n,) int64 ns.
        publish_time: (n,) int64 ns.
        sequence: (n,) uint32, the publisher's counter, 0 where it was not recorded.
        offset: (n,) int64, where each message's data starts in the buffer.
        length: (n,) int64, how long it is.
    """

    buffer: NDArray[np.uint8]
    channel: NDArray[np.int64]
    log_time: NDArray[np.int64]
    publish_time: NDArray[np.int64]
    sequence: NDArray[np.uint32]
    offset: NDArray[np.int64]
    length: NDArray[np.int64]


def _walk(buffer: NDArray[np.uint8], most: int) -> NDArray[np.int64]:
    """Return (records, 3) opcode, start of content, length of content of every whole record.

    Of more than `most` records, so many are returned.
    """
    size = buffer.size
    count = 0
    position = np.int64(0)
    places = np.empty((0, 3), np.int64)
    for attempt in range(2):  # first count, then fill
        if attempt == 1:
            places = np.empty((count, 3), np.int64)
            count = 0
            position = np.int64(0)
        while position + 9 <= size and count < most:
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


walk_records = KernelCompiler(lambda: (Path(__file__),))(_walk)

_MESSAGE_HEAD = np.dtype(
    [("channel", "<u2"), ("sequence", "<u4"), ("log_time", "<i8"), ("publish_time", "<i8")]
)


def parse(content: bytes, *, whole: bool = True) -> tuple[Messages, NDArray[np.int64]]:
    """Find the messages among the records of an unpacked chunk.

    Args:
        content: the records.
        whole: False: the last record may be cut off, and is left out then.

    Returns:
        The messages, and (records, 3) opcode, start and length of everything else.

    Raises:
        DamageError: if the records do not fill the chunk.
    """
    buffer = np.frombuffer(content, np.uint8)
    records = walk_records(buffer, MOST_RECORDS)
    end = int(records[-1, 1] + records[-1, 2]) if len(records) else 0
    if end != buffer.size and whole:
        raise DamageError(f"its records do not fill it, or are more than {MOST_RECORDS}")
    is_message = records[:, 0] == Opcode.MESSAGE
    return _messages(buffer, records[is_message]), records[~is_message]


def _messages(buffer: NDArray[np.uint8], rows: NDArray[np.int64]) -> Messages:
    start, length = rows[:, 1], rows[:, 2]
    size = _MESSAGE_HEAD.itemsize
    if len(rows) and int(length.min()) < size:
        raise DamageError("it holds a message that is too short")
    heads = buffer[start[:, None] + np.arange(size)].view(_MESSAGE_HEAD).reshape(-1)
    return Messages(
        buffer,
        heads["channel"].astype(np.int64),
        heads["log_time"],
        heads["publish_time"],
        heads["sequence"],
        start + size,
        length - size,
    )


class _Packed(NamedTuple):
    """What a chunk record says of its records, and those as they are packed."""

    compression: bytes
    unpacked_size: int
    checksum: int
    packed_size: int
    packed: bytes


def _packed(raw: bytes) -> _Packed:
    try:
        position = RECORD_HEAD.size
        _, _, unpacked_size, checksum = CHUNK_HEAD.unpack_from(raw, position)
        position += CHUNK_HEAD.size
        (name_length,) = struct.unpack_from("<I", raw, position)
        compression = raw[position + 4 : position + 4 + name_length]
        position += 4 + name_length
        (packed_size,) = struct.unpack_from("<Q", raw, position)
    except struct.error:
        raise DamageError("its head is cut off") from None
    packed = raw[position + 8 : position + 8 + packed_size]
    refusal = why_not_unpack(packed_size, unpacked_size)
    if refusal:
        raise DamageError(refusal)
    return _Packed(compression, unpacked_size, checksum, packed_size, packed)


def unpack_cut(raw: bytes) -> bytes:
    """Return what can be unpacked of a chunk record whose end is missing.

    Compressions work in blocks, of 128 KiB at most: the one in which it is cut is lost. There is no
    checksum of a part.

    Raises:
        DamageError: if nothing can be.
    """
    head = _packed(raw)
    try:
        if head.compression == b"zstd":
            with zstandard.ZstdDecompressor().stream_reader(head.packed) as stream:
                begin: bytes = stream.read(head.unpacked_size)
            return begin
    except zstandard.ZstdError as error:
        raise DamageError(f"it cannot be unpacked: {error}") from None
    return _decompress(head.compression, head.packed, head.unpacked_size)


def unpack(raw: bytes) -> bytes:
    """Return the records inside a chunk record (its nine bytes of head included).

    Raises:
        DamageError: if it is cut, or its compression or checksum is wrong.
    """
    compression, unpacked_size, checksum, packed_size, packed = _packed(raw)
    if len(packed) != packed_size:
        raise DamageError("its stated size is impossible")
    content = _decompress(compression, packed, unpacked_size)
    if len(content) != unpacked_size:
        raise DamageError(f"it unpacks to {len(content)} instead of {unpacked_size} bytes")
    if checksum and zlib.crc32(content) != checksum:
        raise DamageError("its checksum is wrong")
    return content


def _decompress(compression: bytes, packed: bytes, size: int) -> bytes:
    """Return the content of a chunk; never more than `size` bytes and one are made of it.

    Raises:
        DamageError: if it cannot be unpacked.
    """
    try:
        if compression == b"zstd":
            stated = zstandard.get_frame_parameters(packed).content_size
            # The library takes the frame's own word for how much memory is needed.
            if stated not in (size, zstandard.CONTENTSIZE_UNKNOWN):
                raise DamageError(f"its frame states {stated} instead of {size} bytes")
            unpacked: bytes = zstandard.ZstdDecompressor().decompress(
                packed, max_output_size=max(size, 1)
            )
            return unpacked
        if compression == b"lz4":
            stream = lz4.frame.LZ4FrameDecompressor()
            content: bytes = stream.decompress(packed, max_length=size + 1)
            return content
    except (zstandard.ZstdError, RuntimeError, EOFError) as error:
        raise DamageError(f"it cannot be unpacked: {error}") from None
    if compression == b"":
        return packed
    raise DamageError(f"its compression {compression!r} is not known")
