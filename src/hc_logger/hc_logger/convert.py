"""Conversion between CSV recordings and bags, and of other people's bags, block by block."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hc_logger.bag import Bag, Columns
from hc_logger.bag_sensors import has_sensors, how_to_read
from hc_logger.csv_file import CsvReader, write_csv
from hc_logger.definitions import installed_definition
from hc_logger.errors import BagError, WrongOptionError
from hc_logger.foreign import open_bag
from hc_logger.layout import encode, records, stamps
from hc_logger.recording import SAMPLE_FIELDS, sample_topic, stamps_from_seconds
from hc_logger.sample_arrays import DISPLACEMENT, FORCE, STAMP, sample_blocks
from hc_logger.selection import TopicSelection, full_name
from hc_logger.tactile_samples import how_to_read_taxels, rows_of_taxel, tactile_topic
from hc_logger.type_names import SAMPLE_TYPE, SAMPLES_TYPE, TACTILE_TYPE
from hc_logger.writer import BagWriter, os_errors
from hc_msgs_py.topics import FRAME_INDENTER_TIP, SAMPLE
from hc_msgs_py.units import METRE_IN_MM, NANOSECONDS

CSV_EPOCH_NS = 1_000_000_000 * NANOSECONDS
"""Stamp of second 0 of a CSV file in a bag: fixed (September 2001), so that the same file always
gives the same bag."""
CSV_SOURCE = "csv_source"
"""Key of the bag's custom data that names the CSV file it was made from."""
UNIX_TIMES = "csv_times"
"""Key beside it where the file tells seconds since 1970, which are the stamps then."""
BLOCK_MESSAGES = 16384

Progress = Callable[[float], None]
"""Called with the done share, 0 to 1."""

SAMPLE_PROFILE = {
    "history": "keep_last",
    "depth": 2000,
    "reliability": "best_effort",
    "durability": "volatile",
    "deadline": {"sec": 9223372036, "nsec": 854775807},
    "lifespan": {"sec": 9223372036, "nsec": 854775807},
    "liveliness": "automatic",
    "liveliness_lease_duration": {"sec": 9223372036, "nsec": 854775807},
    "avoid_ros_namespace_conventions": False,
}
"""Offered QoS of a sample topic that no publisher wrote: that of qos.SAMPLE_QOS."""


def nothing(_share: float) -> None:
    """Take note of nothing: the default progress."""


class SampleWriter:
    """Writes samples, whole arrays at a time, into the topic indenter/sample of a bag."""

    def __init__(self, writer: BagWriter) -> None:
        self._writer = writer
        self._definition = installed_definition(SAMPLE_TYPE)
        self._topic = writer.add_topic(SAMPLE, SAMPLE_TYPE, qos_profiles=[SAMPLE_PROFILE])
        self._latest = -(2**63)

    def write(
        self,
        stamps_ns: NDArray[np.int64],
        sequence: NDArray[np.uint64],
        displacement_mm: NDArray[np.float64],
        force_n: NDArray[np.float64],
    ) -> None:
        """Write samples.

        The log time never goes back, so that a player keeps the order where stamps do.

        Raises:
            BagError: if a stamp is outside what a message and a log time can hold (1970 to 2038).
        """
        if not len(stamps_ns):
            return
        seconds = stamps_ns // NANOSECONDS
        if seconds.min() < 0 or seconds.max() >= 2**31:
            raise BagError("a time is outside what a bag can hold: its stamps are of 1970 to 2038")
        data = encode(
            self._definition,
            FRAME_INDENTER_TIP,
            header__stamp__sec=seconds,
            header__stamp__nanosec=stamps_ns % NANOSECONDS,
            sequence=sequence,
            displacement=displacement_mm / METRE_IN_MM,
            force=force_n,
        )
        log_time = np.maximum(np.maximum.accumulate(stamps_ns), self._latest)
        self._latest = int(log_time[-1])
        for time, stamp, row in zip(log_time.tolist(), stamps_ns.tolist(), data, strict=True):
            self._writer.write(self._topic, time, row.tobytes(), stamp)


def csv_to_bag(
    source: str | os.PathLike[str],
    target: str | os.PathLike[str],
    *,
    reader: CsvReader | None = None,
    progress: Progress = nothing,
) -> int:
    """Convert a CSV recording into a bag with the topic indenter/sample.

    Stamps are CSV_EPOCH_NS plus the time in the file, or the time itself where its first one is
    such a stamp already (seconds since 1970); a time that is not finite gets the stamp of the row
    before (the estimator rejects both).

    Args:
        source: CSV file.
        target: bag folder; must not exist.
        reader: of the source; None finds out how it is written.
        progress: told the done share.

    Returns:
        Number of samples.

    Raises:
        BagError: if the source is bad or the target exists; no target is left behind then.
    """
    source = Path(source)
    reader = reader or CsvReader(source)
    blocks = reader.blocks()
    first = next(blocks, None)  # a bad file is found before the target is made
    if first is None or not len(first):
        raise BagError(f"{source} has no rows")
    size = max(source.stat().st_size, 1)  # of a compressed one nobody knows how long it gets
    written = 0
    carried = np.zeros(0)
    custom_data, epoch_ns = {CSV_SOURCE: source.name}, CSV_EPOCH_NS
    if stamps_from_seconds(first[:, 0])[0] >= CSV_EPOCH_NS:
        custom_data[UNIX_TIMES], epoch_ns = "since 1970", 0
    with (
        os_errors(f"cannot write {target}"),
        BagWriter(target, custom_data=custom_data) as writer,
    ):
        samples = SampleWriter(writer)
        block: NDArray[np.float64] | None = first
        while block is not None:
            time_s = np.concatenate([carried, block[:, 0]])
            stamp = (stamps_from_seconds(time_s) + epoch_ns)[len(carried) :]
            usable = time_s[np.isfinite(time_s)]
            carried = usable[-1:]
            sequence = np.arange(written, written + len(block), dtype=np.uint64)
            samples.write(stamp, sequence, block[:, 1], block[:, 2])
            written += len(block)
            progress(min(1.0, reader.characters / size))
            block = next(blocks, None)
    return written


def bag_to_csv(
    source: str | os.PathLike[str],
    target: str | os.PathLike[str],
    *,
    topic: str = "",
    taxel: int | None = None,
    progress: Progress = nothing,
) -> tuple[int, list[str]]:
    """Convert the samples of a bag into a CSV recording; its time 0 is the first sample.

    A bag that csv_to_bag() made gets back the times of its CSV file.

    Args:
        source: bag folder or MCAP file, whole or cut off.
        target: CSV file; must not exist.
        topic: topic of the samples; empty takes the only one.
        taxel: of a tactile array, counted row by row from 0; None for samples of an indenter.
        progress: told the done share.

    Returns:
        Number of rows, and one line for each thing one should know: parts of the bag that could
        not be read, or whose sensors were taken.

    Raises:
        BagError: if the source has no samples or the target exists.
    """
    with open_bag(source) as reader:
        if taxel is not None:
            return _taxel_to_csv(reader, target, topic, taxel), reader.problems
        name = full_name(topic) if topic else sample_topic(reader)
        if name is None and has_sensors(reader):
            from hc_logger.sensors import read_sensors  # loads the estimator package

            recording = read_sensors(source)
            columns = (recording.time_s, recording.displacement_mm, recording.force_n)
            return write_csv(target, [np.column_stack(columns)]), recording.findings.lines()
        if name is None or name not in reader.topics:
            what = f"no topic {name}" if name else f"no topic of type {SAMPLE_TYPE}"
            has = ", ".join(reader.topics) or "nothing"
            lacks = "" if topic else how_to_read_taxels(reader) or how_to_read(reader)
            raise BagError(f"{source} has {what}; it has {has}{lacks}")
        if reader.topics[name].definition.name == TACTILE_TYPE:
            raise WrongOptionError(f"{name} has no samples of one tool{how_to_read_taxels(reader)}")
        count = write_csv(target, _rows(reader, name, progress))
        return count, reader.problems


def _taxel_to_csv(reader: Bag, target: str | os.PathLike[str], topic: str, taxel: int) -> int:
    """Write one taxel of a bag as a CSV recording; returns the number of rows.

    Raises:
        BagError: if the bag has no array's samples, or none with such a taxel.
    """
    name = full_name(topic) if topic else tactile_topic(reader)
    if (
        name is None
        or name not in reader.topics
        or reader.topics[name].definition.name != TACTILE_TYPE
    ):
        has = ", ".join(reader.topics) or "nothing"
        what = f"{name} is no topic" if name else "no topic is"
        raise WrongOptionError(
            f"--taxel is for a bag with samples of a tactile array, and {what} of type "
            f"{TACTILE_TYPE} in {reader.path}; it has {has}"
        )
    return write_csv(target, rows_of_taxel(reader, name, taxel))


def _rows(reader: Bag, topic: str, progress: Progress) -> Iterator[NDArray[np.float64]]:
    definition = reader.topics[topic].definition
    if definition.name == SAMPLES_TYPE:
        yield from _rows_of_arrays(reader, topic)
        return
    first, last = reader.time_range() or (0, 1)
    origin: int | None = None
    for block in message_blocks(reader, topic):
        table = records(definition, block, SAMPLE_FIELDS)
        stamp = stamps(table)
        if origin is None:
            origin = _origin_ns(reader, stamp)
        yield np.column_stack(
            [_seconds(stamp - origin), table["displacement"] * METRE_IN_MM, table["force"]]
        )
        progress((int(block[0].log_time[-1]) - first) / max(last - first, 1))


def _origin_ns(bag: Bag, stamps_ns: NDArray[np.int64]) -> int:
    """Return the stamp [ns] of second 0 in a CSV file, given those of the first samples."""
    if CSV_SOURCE not in bag.custom_data:
        return int(stamps_ns[0])
    return 0 if UNIX_TIMES in bag.custom_data else CSV_EPOCH_NS


def _seconds(times_ns: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return times in s, also of such as are too many ns for a float64."""
    whole, rest = np.divmod(times_ns, NANOSECONDS)
    seconds: NDArray[np.float64] = whole + rest / NANOSECONDS
    return seconds


def _rows_of_arrays(reader: Bag, topic: str) -> Iterator[NDArray[np.float64]]:
    origin: int | None = None
    for table in sample_blocks(reader, topic):
        if origin is None:
            origin = _origin_ns(reader, table[STAMP])
        yield np.column_stack(
            [_seconds(table[STAMP] - origin), table[DISPLACEMENT] * METRE_IN_MM, table[FORCE]]
        )


def bag_to_bag(
    source: str | os.PathLike[str],
    target: str | os.PathLike[str],
    *,
    selection: TopicSelection | None = None,
    progress: Progress = nothing,
) -> tuple[dict[str, int], list[str]]:
    """Copy a bag of any kind (sqlite3, compressed, cut off) into a new MCAP bag.

    Args:
        source: the bag; stays as it is.
        target: folder of the new bag; must not exist.
        selection: topics to take; None takes all.
        progress: told the done share.

    Returns:
        Messages by topic, and one line for each part of the source that could not be read.

    Raises:
        BagError: if the source is no bag, has no such topic, or the target exists.
    """
    with open_bag(source) as bag:
        topics = [name for name in bag.topics if selection is None or name in selection]
        if not topics:
            raise BagError(f"{source} has no such topic; it has {', '.join(bag.topics) or 'none'}")
        with (
            os_errors(f"cannot write {target}"),
            BagWriter(target, custom_data=bag.custom_data) as writer,
        ):
            counts = copy_messages(bag, writer, topics, progress=progress)
        return counts, bag.problems


def copy_messages(
    bag: Bag, writer: BagWriter, topics: Collection[str] | None = None, *, progress: Progress
) -> dict[str, int]:
    """Write all readable messages of a bag, with all that is known of their topics.

    Returns:
        Messages by topic.
    """
    chosen = {name: t for name, t in bag.topics.items() if topics is None or name in topics}
    numbers = {
        name: writer.add_topic(
            name,
            topic.definition.name,
            qos_profiles=topic.qos_profiles,
            definition=topic.definition,
        )
        for name, topic in chosen.items()
    }
    counts = dict.fromkeys(numbers, 0)
    first, last = bag.time_range() or (0, 0)
    for count, message in enumerate(bag.messages(list(chosen))):
        writer.write(
            numbers[message.topic],
            message.log_time,
            message.data,
            message.publish_time,
            message.sequence,
        )
        counts[message.topic] += 1
        if count % 10_000 == 0:
            progress((message.log_time - first) / max(last - first, 1))
    progress(1.0)
    return counts


def message_blocks(reader: Bag, topic: str, size: int = BLOCK_MESSAGES) -> Iterator[list[Columns]]:
    """Yield the messages of a topic in time order, as columns of at most `size` messages."""
    times: list[int] = []
    data: list[bytes] = []
    for message in reader.messages({topic}):
        times.append(message.log_time)
        data.append(message.data)
        if len(times) == size:
            yield _columns(times, data)
            times, data = [], []
    if times:
        yield _columns(times, data)


def _columns(times: list[int], data: list[bytes]) -> list[Columns]:
    lengths = np.array([len(d) for d in data])
    blocks = []
    for length in np.unique(lengths).tolist():
        order = np.flatnonzero(lengths == length)
        joined = b"".join(data[i] for i in order.tolist())
        blocks.append(
            Columns(
                np.array(times, np.int64)[order],
                np.frombuffer(joined, np.uint8).reshape(len(order), length),
                order,
            )
        )
    return blocks
