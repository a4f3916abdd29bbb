"""Reads one MCAP file, whole, cut off or damaged, chunk by chunk.

The mcap package's readers refuse a file without its end and make one Python object per message.
This one finds the chunks by a pass over the file (mcap_scan.py). One chunk at a time is in memory.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, NamedTuple

import numpy as np
from mcap.opcode import Opcode

from hc_logger.csv_open import is_text
from hc_logger.errors import BagError
from hc_logger.mcap_chunk import RECORD_HEAD, DamageError, Messages, parse, unpack, unpack_cut
from hc_logger.mcap_scan import MAGIC, UNREADABLE, ChunkPlace, scan_file
from hc_logger.new_file import is_being_written
from hc_logger.other_files import what_it_is


class DamagedChunk(NamedTuple):
    """A chunk that cannot be used, and why."""

    place: ChunkPlace
    reason: str


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
        being_written = is_being_written(self._stream.fileno())
        self.scan = scan_file(self._stream)
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
        growing = self.being_recorded()
        lines = []
        for start, end in scan.unreadable:
            if end < scan.size or scan.complete:
                lines.append(f"damaged from byte {start} to {end} of {scan.size}")
            elif not growing:
                lines.append(f"cut off at byte {start} of {end}, or being recorded")
        if growing:
            lines.append(growing)
        elif scan.cut_chunk:
            lines.append(scan.cut_chunk)
        elif not scan.complete and not lines:
            lines.append(f"cut off after byte {scan.size}, or being recorded: its end is missing")
        lines += [
            f"the chunk at byte {damage.place.offset} is damaged ({damage.reason})"
            for damage in self.damaged
        ]
        return lines

    def being_recorded(self) -> str:
        """Return the line of the problems that says that somebody is writing the file, if so."""
        if not self._is_growing:
            return ""
        return f"is being recorded: its first {self.scan.size} bytes were read"

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
                    self.scan.keep(opcode, content[start : start + length])
        except (DamageError, *UNREADABLE) as error:
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
