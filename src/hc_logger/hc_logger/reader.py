"""A bag (folder or single MCAP file, whole or cut off) as one stream of messages.

Damage never ends a reading: what cannot be read is skipped and named in `problems`.
"""

from __future__ import annotations

import os
import re
from bisect import bisect_left, insort
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import Any

from hc_logger.bag import Bag, Message, Topic
from hc_logger.definitions import TypeDefinition, same_definition
from hc_logger.errors import BagError, MetadataError
from hc_logger.mcap_chunk import Messages
from hc_logger.mcap_file import McapFile
from hc_logger.mcap_scan import ChunkPlace
from hc_logger.metadata import (
    FILE_NAME,
    is_compressed,
    parse_yaml,
    read_information,
    recorded_custom_data,
    recorded_hashes,
    recorded_profiles,
)
from hc_logger.other_files import check_there

_OTHER_ENCODINGS = {"ros1": ", as of ROS 1: export them as a CSV"}


def bag_files(path: Path, *, trust_metadata: bool = True) -> tuple[list[Path], list[str]]:
    """Return the MCAP files of a bag in order, and the names of those that are not there.

    Args:
        path: bag folder or MCAP file.
        trust_metadata: False: take the files that are there, whatever metadata.yaml says.

    Raises:
        BagError: if there is none, or the bag is of another storage, or compressed by rosbag2.
    """
    if path.is_file():
        return [path], []
    check_there(path)
    information = read_information(path) if trust_metadata else None
    if information is not None and information["storage_identifier"] != "mcap":
        raise BagError(
            f"{path} is stored as {information['storage_identifier']}; "
            "convert it with: hc bag convert SOURCE TARGET"
        )
    if information is not None and is_compressed(information):
        raise BagError(
            f"{path} is compressed, each {information['compression_mode'].lower()} by itself; "
            "convert it with: hc bag convert SOURCE TARGET"
        )
    found = sorted(path.glob("*.mcap"), key=_natural)
    if information is not None and information["relative_file_paths"]:
        listed = [path / name for name in information["relative_file_paths"]]
        outside = [file.name for file in listed if path.resolve() not in file.resolve().parents]
        if outside:
            raise MetadataError(
                f"{path}: {outside[0]}, named in {FILE_NAME}, is not in the bag's folder"
            )
        missing = [file.name for file in listed if not file.is_file()]
        if not missing:
            return listed, []
        if not found:
            raise BagError(f"{path}: {missing[0]}, named in {FILE_NAME}, is missing")
        # A file under a name that is not listed may be one of the missing ones, renamed.
        others = {file.name for file in found} - {file.name for file in listed}
        return found, missing if len(missing) > len(others) else []
    if not found:
        raise BagError(f"{path} holds no bag (no .mcap file in it)")
    return found, []


def _natural(path: Path) -> list[Any]:
    return [int(part) if part.isdecimal() else part for part in re.split(r"(\d+)", path.name)]


class BagReader(Bag):
    """Reads a bag of MCAP files.

    Attributes:
        path: as given.
        paths: its files.
        files: the same, opened.
        topics: topics by name, sorted.
        custom_data: texts of the metadata.
    """

    def __init__(self, path: str | os.PathLike[str], *, trust_metadata: bool = True) -> None:
        """Open a bag.

        Args:
            path: bag folder or MCAP file.
            trust_metadata: False: read its files alone, as if there were no metadata.yaml.

        Raises:
            BagError: if it is missing, empty, or no MCAP bag.
        """
        self.path = Path(path)
        self._unreadable: list[str] = []
        self._trust_metadata = trust_metadata
        self.paths, missing = bag_files(self.path, trust_metadata=trust_metadata)
        self._unreadable += [f"{name}, named in {FILE_NAME}, is missing" for name in missing]
        self.files = self._open(self.paths)
        information = self._read_information()
        self._hashes = recorded_hashes(information)
        self.topics = {}
        self._names: list[dict[int, str]] = []
        for file in self.files:
            self._names.append(self._collect_topics(file))
        self.topics = dict(sorted(self.topics.items()))
        self.custom_data = recorded_custom_data(information)

    def _open(self, paths: list[Path]) -> list[McapFile]:
        files = []
        for path in paths:
            try:
                files.append(McapFile(path))
            except BagError as error:
                if len(paths) == 1:
                    raise
                self._unreadable.append(str(error))
        if not files:
            raise BagError("; ".join(self._unreadable))
        return files

    def _collect_topics(self, file: McapFile) -> dict[int, str]:
        names = {}
        for channel in file.scan.channels.values():
            schema = file.scan.schemas.get(channel.schema_id)
            if schema is None or channel.message_encoding != "cdr":
                why = (
                    "the description of its type is lost"
                    if channel.message_encoding == "cdr"
                    else f"its messages are {channel.message_encoding[:40]!r}, not 'cdr'"
                    + _OTHER_ENCODINGS.get(channel.message_encoding, "")
                )
                self._leave_out(channel.topic, why)
                continue
            definition = TypeDefinition(
                schema.name,
                schema.data.decode("utf-8", "replace"),
                channel.metadata.get("topic_type_hash") or self._hashes.get(channel.topic, ""),
            )
            known = self.topics.get(channel.topic)
            if known is None:
                profiles = recorded_profiles(channel.metadata.get("offered_qos_profiles", ""))
                self.topics[channel.topic] = Topic(channel.topic, definition, profiles)
            elif not same_definition(known.definition, definition):
                why = f"some of its messages are of another type ({definition.name})"
                self._leave_out(channel.topic, why)
                continue
            names[channel.id] = channel.topic
        return names

    def _leave_out(self, topic: str, why: str) -> None:
        line = f"{topic} cannot be read: {why}"
        if line not in self._unreadable:
            self._unreadable.append(line)

    def _read_information(self) -> Mapping[str, Any]:
        """Return the metadata: of the folder, else the copy that a finished file holds."""
        in_folder = self._trust_metadata and self.path.is_dir()
        information = read_information(self.path) if in_folder else None
        if information is None:
            text = self.files[-1].scan.metadata.get("rosbag2", {}).get("serialized_metadata", "")
            information = parse_yaml(text)
        return information if isinstance(information, dict) else {}

    @property
    def problems(self) -> list[str]:
        """One line for each thing that could not be read so far."""
        lines = list(self._unreadable)
        for file in self.files:
            lines += [f"{file.path.name}: {problem}" for problem in file.problems()]
        return lines

    @property
    def being_recorded(self) -> list[str]:
        """Of each file that somebody is writing, how much of it was read."""
        growing = ((file.path.name, file.being_recorded()) for file in self.files)
        return [f"{name}: {line}" for name, line in growing if line]

    def _places(self) -> list[tuple[ChunkPlace, int]]:
        """Return all chunks with the number of their file, by the time of their first message."""
        places = [(p, i) for i, file in enumerate(self.files) for p in file.scan.chunks]
        return sorted(places, key=lambda entry: entry[0].start_ns)  # stable: file order

    def time_range(self) -> tuple[int, int] | None:
        """Return first and last log time (ns) as the chunks state them; None without messages."""
        places = [p for file in self.files for p in file.scan.chunks]
        places = [p for p in places if p.end_ns] or places  # one without a message says 0 to 0
        if not places:
            return None
        return min(p.start_ns for p in places), max(p.end_ns for p in places)

    def chunks(self) -> Iterator[tuple[Messages, dict[int, str]]]:
        """Yield the messages of each sound chunk and the topic names of its channel numbers."""
        for file, names in zip(self.files, self._names, strict=True):
            for messages in file.chunks():
                yield messages, names

    def messages(
        self,
        topics: Collection[str] | None = None,
        start_ns: int | None = None,
        end_ns: int | None = None,
    ) -> Iterator[Message]:
        """Yield messages by log time; those of one time in the order of the file.

        Args:
            topics: names of the wanted topics; None for all.
            start_ns: first log time.
            end_ns: last log time.
        """
        places = self._places()
        first = -(2**63) if start_ns is None else start_ns
        last = 2**63 - 1 if end_ns is None else end_ns
        if start_ns is not None or end_ns is not None:  # else what a damaged head says hides none
            places = [(p, i) for p, i in places if p.end_ns >= first and p.start_ns <= last]
        # What begins before the chunk that comes next, of each chunk, in the order of the file.
        carried: list[tuple[tuple[int, int], list[Message]]] = []
        for k, (place, number) in enumerate(places):
            messages = self.files[number].read_chunk(place)
            if messages is not None:
                own = self._list(messages, self._names[number], topics, first, last)
                own.sort(key=_log_time)
                insort(carried, ((number, place.offset), own), key=_place)
            bound = places[k + 1][0].start_ns if k + 1 < len(places) else None
            # what comes before the first message of the next chunk is complete
            ready: list[Message] = []
            left = []
            for where, waiting in carried:
                cut = len(waiting) if bound is None else bisect_left(waiting, bound, key=_log_time)
                ready += waiting[:cut]
                if cut < len(waiting):
                    left.append((where, waiting[cut:]))
            if len(carried) > 1:
                ready.sort(key=_log_time)
            carried = left
            yield from ready

    @staticmethod
    def _list(
        messages: Messages,
        names: dict[int, str],
        topics: Collection[str] | None,
        first: int,
        last: int,
    ) -> list[Message]:
        wanted = {i: n for i, n in names.items() if topics is None or n in topics}
        buffer = messages.buffer.tobytes()
        return [
            Message(wanted[channel], log, publish, buffer[offset : offset + length], sequence)
            for channel, log, publish, offset, length, sequence in zip(
                messages.channel.tolist(),
                messages.log_time.tolist(),
                messages.publish_time.tolist(),
                messages.offset.tolist(),
                messages.length.tolist(),
                messages.sequence.tolist(),
                strict=True,
            )
            if channel in wanted and first <= log <= last
        ]

    def close(self) -> None:
        """Close all files."""
        for file in self.files:
            file.close()


def _log_time(message: Message) -> int:
    return message.log_time


def _place(entry: tuple[tuple[int, int], list[Message]]) -> tuple[int, int]:
    return entry[0]
