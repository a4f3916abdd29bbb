"""The index of a file's chunks, packed while the file is being written.

The mcap package keeps one object with a dictionary for every chunk until the file ends: at twenty
chunks a second and a dozen topics 40 kB a second, 140 MB an hour. Here each entry is turned at once
into the bytes that it becomes in the file, and these are compressed block by block.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator

from mcap.data_stream import RecordBuilder
from mcap.records import ChunkIndex

BLOCK_BYTES = 64 * 1024


class PackedRecords:
    """Records as they stand in the file.

    Attributes:
        content: their bytes.
    """

    def __init__(self, content: bytes) -> None:
        self.content = content

    def write(self, builder: RecordBuilder) -> None:
        """Write them, as a record of the mcap package writes itself."""
        builder.write(self.content)


class PackedChunkIndex:
    """Takes the place of the list of `ChunkIndex` in the mcap package's `Writer`."""

    def __init__(self) -> None:
        self._blocks: list[bytes] = []
        self._open = bytearray()

    def append(self, index: ChunkIndex) -> None:
        """Add the entry of one chunk."""
        builder = RecordBuilder()
        index.write(builder)
        self._open += builder.end()
        if len(self._open) >= BLOCK_BYTES:
            self._blocks.append(zlib.compress(bytes(self._open)))
            self._open = bytearray()

    def __iter__(self) -> Iterator[PackedRecords]:
        """Yield all entries in order, some hundred at a time."""
        for block in self._blocks:
            yield PackedRecords(zlib.decompress(block))
        yield PackedRecords(bytes(self._open))

    def memory_bytes(self) -> int:
        """Return how many bytes are kept."""
        return sum(map(len, self._blocks)) + len(self._open)
