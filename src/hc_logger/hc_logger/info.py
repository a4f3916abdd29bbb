"""What a bag holds: topics with counts, rates and gaps, in one pass and little memory."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hc_logger.bag import Bag
from hc_logger.convert import Progress, nothing
from hc_logger.definitions import TypeDefinition
from hc_logger.errors import BagError
from hc_logger.foreign import open_bag
from hc_logger.layout import record_dtype
from hc_logger.mcap_chunk import Messages
from hc_logger.type_names import SAMPLE_TYPE, TACTILE_TYPES
from hc_msgs_py.cdr import FRAME_LENGTH_OFFSET, FRAME_OFFSET, aligned
from hc_msgs_py.histogram import DurationHistogram

GAP_FACTOR = 5.0
"""An interval of more than so many times the usual one is called a gap. Usual is the median or the
mean, whichever is larger: where messages come in bunches the median says nothing."""
_SEQUENCE_FIELD = "sequence"
MOST_UNORDERED = 0.01
"""Share of the messages; where more numbers do not grow, or jump far, they are no count."""
LONGEST_COUNTED_GAP = 1_000_000
"""A jump of the numbers beyond this is no loss: somebody counts otherwise, or not at all."""


@dataclass
class TopicInfo:
    """What a bag holds of one topic.

    Attributes:
        name: topic name.
        type_name: message type.
        type_hash: RIHS01 hash, empty if the bag does not say.
        message_count: messages that could be read.
        rate_hz: (count - 1) / (last - first log time); None with fewer than two messages.
        median_interval_s: between log times, to 1 %; None with fewer than two messages.
        longest_interval_s: largest interval between log times.
        gaps: intervals longer than five times the median or mean, whichever is larger.
        lost: numbers missing in the messages' own field `sequence`; None if they have none, or if
            the numbers are no count: those of two publishers, or random ones.
        repeated_or_backward: messages whose sequence does not grow, or jumps far; None if they
            have none.
        displacement_hz: rate of the samples that hold a displacement; None for other types.
        force_hz: rate of the samples that hold a force; None for other types.
    """

    name: str
    type_name: str
    type_hash: str
    message_count: int = 0
    rate_hz: float | None = None
    median_interval_s: float | None = None
    longest_interval_s: float | None = None
    gaps: int = 0
    lost: int | None = None
    repeated_or_backward: int | None = None
    displacement_hz: float | None = None
    force_hz: float | None = None

    @property
    def is_no_count(self) -> bool:
        """True if the messages have numbers, and they do not count the messages."""
        return self.lost is None and self.repeated_or_backward is not None


@dataclass
class BagInfo:
    """What `hc bag info` says of a bag.

    Attributes:
        path: the bag.
        files: names of its files.
        size_bytes: their size.
        start_ns: first log time.
        duration_s: last minus first log time.
        message_count: messages that could be read.
        topics: by name.
        custom_data: texts of the metadata.
        problems: what could not be read, one line each.
    """

    path: Path
    files: list[str]
    size_bytes: int
    start_ns: int
    duration_s: float
    message_count: int
    topics: list[TopicInfo]
    custom_data: dict[str, str]
    problems: list[str]


@dataclass
class _Pass:
    """Running figures of one topic."""

    definition: TypeDefinition
    count: int = 0
    first: int = 0
    last: int = 0
    intervals: DurationHistogram = field(default_factory=DurationHistogram)
    sequence: int | None = None
    lost: int = 0
    unordered: int = 0
    readings: NDArray[np.int64] = field(default_factory=lambda: np.zeros(2, np.int64))


def bag_info(path: str | os.PathLike[str], *, progress: Progress = nothing) -> BagInfo:
    """Look through a bag once.

    Args:
        path: bag of any kind, whole or cut off.
        progress: told the done share.

    Raises:
        BagError: if it is missing or no bag.
    """
    with open_bag(path) as reader:
        passes = {name: _Pass(topic.definition) for name, topic in reader.topics.items()}
        sequenced = {n: _sequence_offset(t.definition) for n, t in reader.topics.items()}
        first, last = reader.time_range() or (0, 0)
        for messages, names in reader.chunks():
            if len(messages.log_time):
                progress((int(messages.log_time[-1]) - first) / max(last - first, 1))
            for channel in np.unique(messages.channel).tolist():
                name = names.get(channel)
                if name is not None:
                    rows = np.flatnonzero(messages.channel == channel)
                    _add(passes[name], messages.log_time[rows])
                    if sequenced[name]:
                        numbers, after = _sequences(messages, rows)
                        _add_sequence(passes[name], numbers)
                        if passes[name].definition.name == SAMPLE_TYPE:
                            _add_readings(passes[name], messages, after)
        topics = [_topic(reader, name, p, sequenced[name]) for name, p in passes.items()]
        filled = [p for p in passes.values() if p.count]
        start = min((p.first for p in filled), default=0)
        end = max((p.last for p in filled), default=0)
        return BagInfo(
            reader.path,
            [path.name for path in reader.paths],
            sum(path.stat().st_size for path in reader.paths),
            start,
            (end - start) * 1e-9,
            sum(p.count for p in filled),
            topics,
            reader.custom_data,
            reader.problems,
        )


def counts(messages: int, repeated_or_backward: int) -> bool:
    """True if the numbers of so many messages may be a count, so that missing ones were lost."""
    return repeated_or_backward <= 2 + MOST_UNORDERED * messages


def _add(one: _Pass, times: NDArray[np.int64]) -> None:
    if one.count:
        times = np.concatenate([[one.last], times])
    else:
        one.first = int(times[0])
        one.count = 1
    one.count += len(times) - 1
    one.last = int(times.max())
    one.first = min(one.first, int(times.min()))
    ordered = np.sort(times)
    one.intervals.add_many(ordered[1:] - ordered[:-1])


def _sequence_offset(definition: TypeDefinition) -> bool:
    """Return True if messages of this type begin with a header and a uint64 that counts them.

    In messages with many samples it counts those, unless they are of one instant.
    """
    try:
        names = record_dtype(definition, 1, int(definition.name in TACTILE_TYPES)).names or ()
    except BagError:  # not of fixed size, so none of the suite's other streams
        return False
    return names[:4] == (
        "header.stamp.sec",
        "header.stamp.nanosec",
        "header.frame_id",
        _SEQUENCE_FIELD,
    )


def _sequences(
    messages: Messages, rows: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the field sequence of those messages that are not damaged, and where it ends."""
    rows = rows[messages.length[rows] >= FRAME_OFFSET]
    offset, size = messages.offset[rows], messages.length[rows]
    lengths = _words(messages.buffer, offset + FRAME_LENGTH_OFFSET, "<u4").astype(np.int64)
    position = aligned(FRAME_OFFSET + lengths, 8)
    whole = position + 8 <= size
    place = offset[whole] + position[whole]
    return _words(messages.buffer, place, "<i8").astype(np.int64), place + 8


def _words(buffer: NDArray[np.uint8], offset: NDArray[np.int64], kind: str) -> NDArray[Any]:
    size = np.dtype(kind).itemsize
    words: NDArray[Any] = buffer[offset[:, None] + np.arange(size)].view(kind).reshape(-1)
    return words


def _add_sequence(one: _Pass, sequence: NDArray[np.int64]) -> None:
    if not len(sequence):
        return
    if one.sequence is not None:
        sequence = np.concatenate([[one.sequence], sequence])
    one.sequence = int(sequence[-1])
    steps = np.diff(sequence)
    onward = (steps > 0) & (steps <= LONGEST_COUNTED_GAP + 1)
    one.lost += int((steps[onward] - 1).sum())
    one.unordered += int(np.count_nonzero(~onward))


def _add_readings(one: _Pass, messages: Messages, place: NDArray[np.int64]) -> None:
    """Count displacements and forces of samples whose sequence ends there: NaN is none."""
    place = place[place + 16 <= len(messages.buffer)]
    for i in range(2):
        values = _words(messages.buffer, place + 8 * i, "<f8")
        one.readings[i] += np.count_nonzero(~np.isnan(values))


def _topic(reader: Bag, name: str, one: _Pass, sequenced: bool) -> TopicInfo:
    definition = reader.topics[name].definition
    info = TopicInfo(name, definition.name, definition.type_hash, one.count)
    if one.count > 1 and one.last > one.first:
        info.rate_hz = (one.count - 1) / ((one.last - one.first) * 1e-9)
    if one.count > 1:
        median_ns = one.intervals.quantile_ns(0.5)
        info.median_interval_s = median_ns * 1e-9
        info.longest_interval_s = one.intervals.maximum_s
        usual_ns = max(median_ns, (one.last - one.first) / (one.count - 1), 1.0)
        info.gaps = int(one.intervals.between(np.array([GAP_FACTOR * usual_ns]))[1])
    if sequenced:
        info.lost = one.lost if counts(one.count, one.unordered) else None
        info.repeated_or_backward = one.unordered
    if definition.name == SAMPLE_TYPE and info.rate_hz is not None:
        shares = one.readings / one.count
        info.displacement_hz, info.force_hz = (info.rate_hz * shares).tolist()
    return info
