"""What an estimator needs of a recording, from a CSV file or a bag: time, displacement, force.

Units are those of the core (s, mm, N). Bad rows are kept and counted: the estimator rejects them
one by one, and whoever reads the recording should know how many there are.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hc_logger.bag import Bag
from hc_logger.csv_file import read_csv
from hc_logger.decoder import decoder
from hc_logger.errors import BagError
from hc_logger.foreign import open_bag
from hc_logger.layout import records, stamps
from hc_logger.selection import full_name
from hc_msgs_py.topics import CONFIGURATION, ESTIMATE, SAMPLE
from hc_msgs_py.units import METRE_IN_MM, NANOSECONDS

SAMPLE_TYPE = "hc_msgs/msg/IndenterSample"
ESTIMATE_TYPE = "hc_msgs/msg/HuntCrossleyEstimate"
CONFIGURATION_TYPE = "hc_msgs/msg/EstimatorConfiguration"

_PARAMETER_FIELDS = (
    "",
    "bool_value",
    "integer_value",
    "double_value",
    "string_value",
    "byte_array_value",
    "bool_array_value",
    "integer_array_value",
    "double_array_value",
    "string_array_value",
)
"""Field of rcl_interfaces/ParameterValue by its type number."""


class RecordedConfiguration(NamedTuple):
    """One hc_msgs/EstimatorConfiguration of a bag as plain data."""

    log_time_ns: int
    stamp_ns: int
    revision: int
    valid_from_sequence: int
    time_origin_ns: int
    cause: int
    filter: str
    state_space: str
    contact_model: str
    software_version: str
    parameters: dict[str, Any]


class Findings(NamedTuple):
    """What is unusual about the rows of a recording.

    Attributes:
        not_finite: rows with NaN or infinity.
        repeated: rows with the same time as the row before.
        backward: rows with a time before that of the row before.
        problems: what of a bag could not be read, one line each.
    """

    not_finite: int
    repeated: int
    backward: int
    problems: tuple[str, ...]

    def lines(self) -> list[str]:
        """Return one line for each finding, none for a clean recording."""
        texts = (
            (self.not_finite, "with NaN or infinity"),
            (self.repeated, "with the time of the row before"),
            (self.backward, "with a time before that of the row before"),
        )
        counted = [
            f"{count} {'row' if count == 1 else 'rows'} {text}: the estimator rejects them"
            for count, text in texts
            if count
        ]
        return counted + list(self.problems)


@dataclass(frozen=True)
class Recording:
    """A recording of force and displacement.

    Attributes:
        path: where it comes from.
        is_bag: True for a bag, False for a CSV file.
        time_s: (n,) s. Of a bag: since its first sample. Of a CSV file: as it stands there.
        stamps: (n,) int64 ns. Of a bag: the header stamps. Of a CSV file: its times in ns, a time
            that is not finite taken as that of the row before.
        sequence: (n,) uint64, the samples' counter; row numbers of a CSV file.
        displacement_mm: (n,) mm.
        force_n: (n,) N.
        findings: bad rows and unreadable parts.
    """

    path: Path
    is_bag: bool
    time_s: NDArray[np.float64]
    stamps: NDArray[np.int64]
    sequence: NDArray[np.uint64]
    displacement_mm: NDArray[np.float64]
    force_n: NDArray[np.float64]
    findings: Findings

    @cached_property
    def estimates(self) -> NDArray[Any]:
        """Recorded hc_msgs/HuntCrossleyEstimate messages as records; empty where there are none.

        Fields have the message's names, numbers the message's units.

        Raises:
            BagError: if the recording is not a bag, or has several topics of estimates.
        """
        with self._bag() as reader:
            topic = only_topic(reader, ESTIMATE_TYPE, ESTIMATE)
            if topic is None:
                return np.empty(0, [("sequence", "<u8")])
            return records(reader.topics[topic].definition, reader.columns(topic))

    @cached_property
    def configurations(self) -> list[RecordedConfiguration]:
        """Recorded configurations of the estimator in order; empty where there are none.

        Raises:
            BagError: if the recording is not a bag, or has several topics of configurations.
        """
        with self._bag() as reader:
            topic = only_topic(reader, CONFIGURATION_TYPE, CONFIGURATION)
            if topic is None:
                return []
            decode = decoder(reader.topics[topic].definition)
            return [_configuration(m.log_time, decode(m.data)) for m in reader.messages({topic})]

    def _bag(self) -> Bag:
        if not self.is_bag:
            raise BagError(f"{self.path} is a CSV file: it holds no estimates")
        return open_bag(self.path)


def read_recording(path: str | os.PathLike[str], *, topic: str = "") -> Recording:
    """Read a CSV file, a bag folder or an MCAP file, whole or cut off.

    Args:
        path: a file that ends in .csv, a bag folder, or an .mcap file.
        topic: topic of the samples in a bag; empty takes the only one.

    Raises:
        BagError: if there is nothing to read; the text says what to do.
    """
    path = Path(path)
    if path.is_dir() or path.suffix.lower() == ".mcap":
        return _read_bag(path, topic)
    if not path.exists():
        raise BagError(f"{path} does not exist")
    if path.suffix.lower() != ".csv":
        raise BagError(f"{path} is neither a CSV file (.csv) nor a bag (a folder, or .mcap)")
    rows = np.concatenate([np.empty((0, 3)), *read_csv(path)])
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
        findings_of(rows, np.diff(time_s), ()),
    )


def _read_bag(path: Path, topic: str) -> Recording:
    with open_bag(path) as reader:
        name = topic or only_topic(reader, SAMPLE_TYPE, SAMPLE)
        if name and not name.startswith("/"):
            name = "/" + name
        if not name or name not in reader.topics:
            what = f"no topic {name}" if name else f"no topic of type {SAMPLE_TYPE}"
            has = ", ".join(reader.topics) or "nothing"
            raise BagError(f"{path} has {what}; it has {has}{_because(reader)}")
        table = records(reader.topics[name].definition, reader.columns(name))
        if not len(table):
            raise BagError(f"{path}: no sample on {name}{_because(reader)}")
        problems = tuple(reader.problems)
    stamp = stamps(table)
    time_s = (stamp - stamp[0]) * 1e-9
    displacement_mm = table["displacement"] * METRE_IN_MM
    rows = np.column_stack([displacement_mm, table["force"]])
    return Recording(
        path,
        True,
        time_s,
        stamp,
        table["sequence"].copy(),
        displacement_mm,
        table["force"].copy(),
        findings_of(rows, np.diff(stamp), problems),
    )


def _because(reader: Bag) -> str:
    return f" ({'; '.join(reader.problems)})" if reader.problems else ""


def only_topic(bag: Bag, type_name: str, usual: str) -> str | None:
    """Return the topic of a type: the usual one if it is there, else the only one, else None.

    Raises:
        BagError: if there are several and none is the usual one.
    """
    names = [t.name for t in bag.topics.values() if t.definition.name == type_name]
    if full_name(usual) in names:
        return full_name(usual)
    if len(names) > 1:
        raise BagError(
            f"{bag.path} has several topics of type {type_name}: {', '.join(names)}; name one"
        )
    return names[0] if names else None


def stamps_from_seconds(time_s: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return times in whole ns; one that is not finite is taken as that of the row before."""
    usable = np.isfinite(time_s)
    if not usable.any():
        return np.zeros(len(time_s), np.int64)
    last = np.maximum.accumulate(np.where(usable, np.arange(len(time_s)), -1))
    last[last < 0] = int(np.argmax(usable))
    return np.rint(time_s[last] * NANOSECONDS).astype(np.int64)


def findings_of(
    rows: NDArray[np.float64], steps: NDArray[Any], problems: tuple[str, ...]
) -> Findings:
    """Count the bad rows of a recording.

    Args:
        rows: (n, columns) values that must be finite.
        steps: (n - 1,) steps of time from row to row.
        problems: what could not be read, one line each.
    """
    return Findings(
        int(np.count_nonzero(~np.isfinite(rows).all(axis=1))),
        int(np.count_nonzero(steps == 0)),
        int(np.count_nonzero(steps < 0)),
        problems,
    )


def _configuration(log_time: int, message: Any) -> RecordedConfiguration:
    return RecordedConfiguration(
        log_time,
        _nanoseconds(message.header.stamp),
        message.revision,
        message.valid_from_sequence,
        _nanoseconds(message.time_origin),
        message.cause,
        message.filter,
        message.state_space,
        message.contact_model,
        message.software_version,
        {p.name: _value(p.value) for p in message.parameters},
    )


def _nanoseconds(stamp: Any) -> int:
    return int(stamp.sec) * NANOSECONDS + int(stamp.nanosec)


def _value(value: Any) -> Any:
    if not 0 < value.type < len(_PARAMETER_FIELDS):
        return None
    content = getattr(value, _PARAMETER_FIELDS[value.type])
    return content.tolist() if isinstance(content, np.ndarray) else content
