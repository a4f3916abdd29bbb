"""What every bag offers, whatever its storage: topics, messages in order, columns of a topic."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from hc_logger.definitions import TypeDefinition
from hc_logger.limits import check_in_memory
from hc_logger.mcap_chunk import Messages

_LONG_MESSAGE = 4096
_TIMES_BYTES = 16


class Message(NamedTuple):
    """One recorded message: topic, log and publish time (ns), CDR bytes, publisher's counter."""

    topic: str
    log_time: int
    publish_time: int
    data: bytes
    sequence: int = 0


class Topic(NamedTuple):
    """One topic of a bag: name, definition of its type, offered QoS profiles."""

    name: str
    definition: TypeDefinition
    qos_profiles: list[dict[str, Any]]


class Columns(NamedTuple):
    """All messages of one topic that have one length, stacked.

    Attributes:
        log_time: (n,) int64 ns.
        data: (n, length) uint8.
        order: (n,) int64, place of each among all messages of the topic.
    """

    log_time: NDArray[np.int64]
    data: NDArray[np.uint8]
    order: NDArray[np.int64]


BagType = TypeVar("BagType", bound="Bag")


class Bag(ABC):
    """A bag opened for reading.

    Attributes:
        path: as given.
        paths: its files.
        topics: topics by name, sorted; of a bag of several arms those of one, and the common ones.
        custom_data: texts of the metadata.
        namespace: of the arm, as /left; empty for names without.
    """

    path: Path
    paths: list[Path]
    topics: dict[str, Topic]
    custom_data: dict[str, str]
    namespace: str = ""

    @property
    @abstractmethod
    def problems(self) -> list[str]:
        """One line for each thing that could not be read so far."""

    @property
    def being_recorded(self) -> list[str]:
        """Those of the problems that say only that somebody is writing the bag: none is damage."""
        return []

    @property
    def damage(self) -> list[str]:
        """The problems without those of a bag that is being recorded."""
        growing = self.being_recorded
        return [problem for problem in self.problems if problem not in growing]

    @abstractmethod
    def time_range(self) -> tuple[int, int] | None:
        """Return first and last log time (ns) as the bag states them; None without messages."""

    @abstractmethod
    def messages(
        self,
        topics: Collection[str] | None = None,
        start_ns: int | None = None,
        end_ns: int | None = None,
    ) -> Iterator[Message]:
        """Yield messages by log time.

        Args:
            topics: names of the wanted topics; None for all.
            start_ns: first log time.
            end_ns: last log time.
        """

    @abstractmethod
    def chunks(self) -> Iterator[tuple[Messages, dict[int, str]]]:
        """Yield all messages, many at once, with the topic names of their channel numbers."""

    @abstractmethod
    def close(self) -> None:
        """Close all files."""

    @property
    def complete(self) -> bool:
        """True if every file has its end and nothing damaged has been met so far."""
        return not self.problems

    def columns(self, topic: str) -> list[Columns]:
        """Return all messages of a topic as byte matrices, one for each message length.

        Messages stand in the order of their log times.

        Raises:
            BagError: if they are more than may be kept in memory.
        """
        blocks: dict[int, list[Columns]] = {}
        count = size = 0
        for messages, names in self.chunks():
            numbers = [i for i, name in names.items() if name == topic]
            rows = np.flatnonzero(np.isin(messages.channel, numbers))
            for length in np.unique(messages.length[rows]).tolist():
                same = rows[messages.length[rows] == length]
                size += len(same) * (length + _TIMES_BYTES)
                check_in_memory(size, f"{topic} of {self.path}")
                data = _rows(messages.buffer, messages.offset[same], length)
                order = count + np.searchsorted(rows, same)
                blocks.setdefault(length, []).append(Columns(messages.log_time[same], data, order))
            count += len(rows)
        stacked = [
            Columns(*(np.concatenate(part) for part in zip(*parts, strict=True)))
            for parts in blocks.values()
        ]
        return _ordered(stacked)

    def __enter__(self: BagType) -> BagType:
        return self

    def __exit__(
        self,
        exc_type: type[BaseException] | None,
        exc: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()


def _rows(buffer: NDArray[np.uint8], offset: NDArray[np.int64], length: int) -> NDArray[np.uint8]:
    """Return (n, length): what stands at each offset."""
    if length < _LONG_MESSAGE:
        short: NDArray[np.uint8] = buffer[offset[:, None] + np.arange(length)]
        return short
    # One index a byte would be eight times as large as the messages.
    rows = np.empty((len(offset), length), np.uint8)
    for row, start in zip(rows, offset.tolist(), strict=True):
        row[:] = buffer[start : start + length]
    return rows


def _ordered(blocks: list[Columns]) -> list[Columns]:
    """Replace the order in the file by the order in time, over all blocks of a topic."""
    if not blocks:
        return []
    log_time = np.concatenate([block.log_time for block in blocks])
    order = np.concatenate([block.order for block in blocks])
    rank = np.empty(len(order), np.int64)
    rank[np.lexsort((order, log_time))] = np.arange(len(order))
    result = []
    start = 0
    for block in blocks:
        own = rank[start : start + len(block.order)]
        start += len(block.order)
        sorting = np.argsort(own)
        if np.all(sorting[:-1] < sorting[1:]):
            result.append(block._replace(order=own))
        else:
            result.append(
                Columns(
                    block.log_time[sorting],
                    block.data[sorting],
                    own[sorting],
                )
            )
    return result
