"""Reads what an estimator needs of a recording: time, displacement, force, from CSV or bag.

Units are those of the core (s, mm, N). Bad rows are kept and counted: the estimator rejects them
one by one, and whoever reads the recording should know how many there are.
"""

from __future__ import annotations

import os
import shlex
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hc_logger.bag import Bag
from hc_logger.bag_sensors import has_sensors, how_to_read
from hc_logger.csv_file import CsvReader
from hc_logger.csv_open import TEXT_SUFFIXES, is_text
from hc_logger.csv_options import CsvOptions
from hc_logger.decoder import decoder
from hc_logger.errors import ArrayAloneError, BagError
from hc_logger.estimate_arrays import log_times
from hc_logger.findings import findings_of
from hc_logger.foreign import open_bag
from hc_logger.layout import INTEGER, REAL, records, stamps
from hc_logger.limits import check_in_memory
from hc_logger.other_files import check_there, what_it_is
from hc_logger.recorded import Recording, only_topic
from hc_logger.sample_arrays import DISPLACEMENT, FORCE, SEQUENCE, STAMP, all_samples
from hc_logger.selection import full_name
from hc_logger.tactile_samples import how_to_read_taxels
from hc_logger.type_names import SAMPLE_TYPE, SAMPLES_TYPE
from hc_msgs_py.topics import SAMPLE, SAMPLES
from hc_msgs_py.units import METRE_IN_MM, NANOSECONDS

__all__ = ["Recording", "read_recording", "stamps_from_seconds"]


SAMPLE_FIELDS = {"sequence": INTEGER, "displacement": REAL, "force": REAL}
"""Of hc_msgs/IndenterSample."""
SET_FORWARD_NS = 10_000_000_000
"""By so much a recorder that stood still takes no two messages closer together than they were."""
_FARTHEST_S = 2.0**62 / NANOSECONDS


def read_recording(
    path: str | os.PathLike[str],
    *,
    topic: str = "",
    namespace: str = "",
    csv_options: CsvOptions | None = None,
) -> Recording:
    """Read a CSV file, a bag folder or an MCAP file, whole or cut off.

    Args:
        path: a file that ends in .csv (or another ending of text, or .csv.gz), a bag folder, or an
            .mcap file.
        topic: topic of the samples in a bag; empty takes the only one.
        namespace: of the arm in a bag of several, as /left; empty takes that of the samples.
        csv_options: what is known of how a CSV file is written; None finds out.

    Raises:
        BagError: if there is nothing to read; the text says what to do.
    """
    path = Path(path)
    if path.is_dir() or path.suffix.lower() == ".mcap":
        return _read_bag(path, topic, namespace)
    check_there(path)
    if not is_text(path):
        if path.is_file() and (said := what_it_is(path)):
            raise BagError(f"{path} {said}")
        raise BagError(
            f"{path} is neither a CSV file (.csv) nor a bag (a folder, or .mcap); a table in text "
            f"ends in one of {' '.join(TEXT_SUFFIXES)}"
        )
    reader = CsvReader(path, csv_options)
    blocks = [np.empty((0, 3))]
    size = 0
    for block in reader.blocks():
        size += block.nbytes
        check_in_memory(size, str(path))
        blocks.append(block)
    rows = np.concatenate(blocks)
    if not len(rows):
        raise BagError(f"{path} has no rows")
    time_s, displacement_mm, force_n = np.ascontiguousarray(rows.T)
    stamp = stamps_from_seconds(time_s)
    return Recording(
        path,
        False,
        time_s,
        stamp,
        np.arange(len(rows), dtype=np.uint64),
        displacement_mm,
        force_n,
        findings_of(rows, _steps(time_s), ())._replace(notes=reader.notes),
    )


def _steps(time_s: NDArray[np.float64]) -> NDArray[np.float64]:
    with np.errstate(invalid="ignore", over="ignore"):  # infinity is counted as such
        return np.diff(time_s)


def _read_bag(path: Path, topic: str, namespace: str) -> Recording:
    set_forward: tuple[int, ...] = ()
    with open_bag(path, namespace) as reader:
        name = full_name(topic) if topic else sample_topic(reader)
        if name is None and has_sensors(reader):
            from hc_logger.sensors import read_sensors  # loads the estimator package

            return read_sensors(path)
        if name is None or name not in reader.topics:
            what = f"no topic {name}" if name else f"no topic of type {SAMPLE_TYPE}"
            has = ", ".join(reader.topics) or "nothing"
            taxels = "" if topic else how_to_read_taxels(reader)
            if not topic:
                has += taxels or how_to_read(reader)
            kind = ArrayAloneError if taxels else BagError
            raise kind(f"{path} has {what}; it has {has}{_because(reader)}")
        definition = reader.topics[name].definition
        if definition.name == SAMPLES_TYPE:
            table = all_samples(reader, name)
            stamp = table[STAMP].copy()
        else:
            columns = reader.columns(name)
            table = records(definition, columns, SAMPLE_FIELDS)
            stamp = stamps(table)
            set_forward = _set_forward(stamp, log_times(columns))
        if not len(table):
            raise BagError(f"{path}: no sample on {name}{_because(reader)}")
        problems, growing = tuple(reader.damage), tuple(reader.being_recorded)
        notes = () if topic or namespace else _others(reader, name)
    time_s = (stamp - stamp[0]) * 1e-9
    displacement_mm = table[DISPLACEMENT] * METRE_IN_MM
    rows = np.column_stack([displacement_mm, table[FORCE]])
    return Recording(
        path,
        True,
        time_s,
        stamp,
        table[SEQUENCE].copy(),
        displacement_mm,
        table[FORCE].copy(),
        findings_of(rows, np.diff(stamp), problems)._replace(being_recorded=growing, notes=notes),
        namespace=_namespace_of(name),
        set_forward_ns=set_forward,
    )


def _set_forward(stamp: NDArray[np.int64], received: NDArray[np.int64]) -> tuple[int, ...]:
    """Return the stamps before which the clock of a bag's samples was set forward [ns].

    Args:
        stamp: of each sample [ns], shape (n,).
        received: when it came [ns], shape (n,).
    """
    if not len(stamp):
        return ()
    ahead = np.diff(stamp) - np.diff(received)
    jumps = (ahead > SET_FORWARD_NS) & (ahead > 0.5 * np.diff(stamp))
    return tuple(stamp[1:][jumps].tolist())


def _others(bag: Bag, read: str) -> tuple[str, ...]:
    """Say which samples of a bag are not read, those of a second estimator or arm: a line each."""
    types = (SAMPLE_TYPE, SAMPLES_TYPE)
    others = [t.name for t in bag.topics.values() if t.definition.name in types and t.name != read]
    usual = (full_name(SAMPLE), full_name(SAMPLES))
    spaces = {
        name.removesuffix(end): name
        for name in others
        for end in usual
        if name.endswith(end) and name not in usual
    }
    return tuple(
        f"read is {read}, and not {name} (hc bag filter {shlex.quote(str(bag.path))} NEW --topics "
        f"{shlex.quote(f'{space}/*')} makes a bag of that)"
        for space, name in sorted(spaces.items())
        if space != _namespace_of(read)
    )


def _namespace_of(topic: str) -> str:
    """Return the namespace of a topic of samples that is called as usual, else nothing."""
    for usual in (full_name(SAMPLE), full_name(SAMPLES)):
        if topic.endswith(usual):
            return topic.removesuffix(usual)
    return ""


def sample_topic(bag: Bag) -> str | None:
    """Return the topic of the samples, one a message or many; None if there is none.

    Raises:
        BagError: if there are several and none is the usual one.
    """
    return only_topic(bag, SAMPLE_TYPE, SAMPLE) or only_topic(bag, SAMPLES_TYPE, SAMPLES)


def first_stamp_ns(bag: Bag) -> int:
    """Return the stamp of a bag's first sample [ns], from which times count; 0 without any.

    Raises:
        BagError: if there are several topics of samples and none is the usual one, or the first
            message is damaged.
    """
    topic = sample_topic(bag)
    message = None if topic is None else next(bag.messages({topic}), None)
    if topic is None or message is None:
        return 0
    stamp = decoder(bag.topics[topic].definition)(message.data).header.stamp
    return int(stamp.sec) * NANOSECONDS + int(stamp.nanosec)


def has_samples(path: str | os.PathLike[str]) -> bool:
    """Whether a bag holds samples, so that no topic of a sensor has to be read.

    Raises:
        BagError: if it cannot be read, or has several such topics and none is the usual one.
    """
    path = Path(path)
    check_there(path)
    with open_bag(path) as bag:
        return sample_topic(bag) is not None


def _because(reader: Bag) -> str:
    return f" ({'; '.join(reader.problems)})" if reader.problems else ""


def stamps_from_seconds(time_s: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return times in whole ns; one that is not finite is taken as that of the row before.

    Times beyond 146 years are held there.
    """
    usable = np.isfinite(time_s)
    if not usable.any():
        return np.zeros(len(time_s), np.int64)
    last = np.maximum.accumulate(np.where(usable, np.arange(len(time_s)), -1))
    last[last < 0] = int(np.argmax(usable))
    held = np.clip(time_s[last], -_FARTHEST_S, _FARTHEST_S)
    whole = np.floor(held)  # apart, for a float64 holds not all ns of seconds since 1970
    rest = np.rint((held - whole) * NANOSECONDS).astype(np.int64)
    stamps: NDArray[np.int64] = whole.astype(np.int64) * NANOSECONDS + rest
    return stamps
