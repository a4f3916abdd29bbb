"""A recording of force and displacement as plain data, and what a bag recorded beside it."""

from __future__ import annotations

import shlex
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hc_estimator.stream.repeats import channels_held_by
from hc_estimator.stream.vocabulary import (
    ALONG_SENSOR_AXES,
    CHANNEL_DELAY,
    CONTACT_FRAME,
    CONTACT_POSITION_STD,
    recorded_less,
)
from hc_logger.bag import Bag
from hc_logger.decoder import decoder
from hc_logger.definitions import damaged_definition
from hc_logger.errors import BagError
from hc_logger.estimate_arrays import estimates_of_bag, log_times, merged
from hc_logger.events import ReadingChange, events_of, reading_changes
from hc_logger.findings import Findings
from hc_logger.foreign import open_bag
from hc_logger.layout import FLAG, INTEGER, REAL, records
from hc_logger.selection import full_name
from hc_logger.type_names import (
    CONFIGURATION_TYPE,
    ESTIMATE_TYPE,
    ESTIMATES_TYPE,
)
from hc_msgs_py.topics import CONFIGURATION, ESTIMATE, ESTIMATES
from hc_msgs_py.units import NANOSECONDS

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
_PARAMETERS = ("stiffness", "damping", "displacement_exponent", "velocity_exponent")
_ESTIMATE_FIELDS = {
    "sequence": INTEGER,
    "configuration_revision": INTEGER,
    "force_predicted": REAL,
    "nis": REAL,
    "change_detected": FLAG,
    "model_mismatch": FLAG,
    **dict.fromkeys(_PARAMETERS, REAL),
    **dict.fromkeys((f"{name}_std" for name in _PARAMETERS), REAL),
}
"""Of hc_msgs/HuntCrossleyEstimate, what every version of it has."""


class RecordedConfiguration(NamedTuple):
    """One hc_msgs/EstimatorConfiguration of a bag as plain data."""

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
        contact_position_std_mm: standard deviation of the position that displacements count from,
            where it was looked for in this recording; else 0.
        namespace: that the samples' topic is in, as /left; empty for that of one arm.
        found_zeros: position.zero [mm] and force.zero [N] that were looked for in this recording
            and are taken off; empty where none were.
        set_forward_ns: stamps of samples of a bag before which the clock was set forward: they lie
            further behind the one before than the two came one after the other.
    """

    path: Path
    is_bag: bool
    time_s: NDArray[np.float64]
    stamps: NDArray[np.int64]
    sequence: NDArray[np.uint64]
    displacement_mm: NDArray[np.float64]
    force_n: NDArray[np.float64]
    findings: Findings
    contact_position_std_mm: float = 0.0
    namespace: str = ""
    found_zeros: dict[str, float] = field(default_factory=dict)
    set_forward_ns: tuple[int, ...] = ()

    @cached_property
    def estimates(self) -> NDArray[Any]:
        """Recorded estimates as records of hc_msgs/HuntCrossleyEstimate; empty without any.

        Fields have the message's names, numbers the message's units. Estimates that were recorded
        in hc_msgs/HuntCrossleyEstimates are among them, each once.

        Raises:
            BagError: if the recording is not a bag, or has several topics of estimates.
        """
        with self._bag() as reader:
            tables = []
            topic = only_topic(reader, ESTIMATE_TYPE, ESTIMATE)
            if topic is not None:
                columns = reader.columns(topic)
                table = records(reader.topics[topic].definition, columns, _ESTIMATE_FIELDS)
                tables.append((table, log_times(columns)))
            topic = only_topic(reader, ESTIMATES_TYPE, ESTIMATES)
            if topic is not None:
                tables.append(estimates_of_bag(reader, topic))
            return merged(tables)

    @cached_property
    def configurations(self) -> list[RecordedConfiguration]:
        """Recorded configurations of the estimator in order; empty where there are none.

        Raises:
            BagError: if the recording is not a bag, or has several topics of configurations.
        """
        with self._bag() as reader:
            return configurations_of(reader)

    @cached_property
    def reading_changes(self) -> list[ReadingChange]:
        """When the sensors were read otherwise from then on, in order; empty for a CSV file.

        Raises:
            BagError: if the recorded events are damaged.
        """
        if not self.is_bag:
            return []
        with self._bag() as reader:
            changes = reading_changes(events_of(reader) or [])
        if not len(self.stamps):
            return []
        # Not before there were samples, nor after the last one.
        return [c for c in changes if self.stamps[0] <= c.stamp_ns < self.stamps[-1]]

    @cached_property
    def surface_std_mm(self) -> float:
        """How well the position is known that displacements count from: a standard deviation [mm].

        As it was looked for in this recording, or as the estimator of the bag was told last: a
        surface that was found to 17 um makes K uncertain by 2 %. 0 where nobody said anything.

        Raises:
            BagError: if the bag has several topics of configurations.
        """
        if self.contact_position_std_mm or not self.is_bag or not self.configurations:
            return self.contact_position_std_mm
        return float(self.configurations[-1].parameters.get(CONTACT_POSITION_STD, 0.0))

    @cached_property
    def channel_delay(self) -> float | str:
        """By how much the force is late, as the estimator of the bag was told last [s], or "auto".

        Raises:
            BagError: if the bag has several topics of configurations.
        """
        if not self.is_bag or not self.configurations:
            return "auto"
        value = self.configurations[-1].parameters.get(CHANNEL_DELAY, "auto")
        return value if value == "auto" else float(value)

    def taken_off_already(self, setting: str) -> float:
        """What a bag's samples are recorded less, by a setting of the node, as it was set last.

        Args:
            setting: its name; the value is in its unit.

        Raises:
            BagError: if the bag has several topics of configurations.
        """
        if not self.is_bag or not self.configurations:
            return 0.0
        return float(self.configurations[-1].parameters.get(recorded_less(setting), 0.0))

    @cached_property
    def is_along_sensor_axes(self) -> bool:
        """Whether a node made a bag's samples of poses and wrenches, along one axis of each.

        Raises:
            BagError: if the bag has several topics of configurations.
        """
        if not self.is_bag or not self.configurations:
            return False
        return self.configurations[-1].parameters.get(CONTACT_FRAME) == ALONG_SENSOR_AXES

    @cached_property
    def counted_once(self) -> tuple[str, ...]:
        """Channels ("displacement", "force") whose repeated readings were left out.

        When it was read, or by the node that made the samples, as it was set last.

        Raises:
            BagError: if the bag has several topics of configurations.
        """
        once = self.findings.counted_once
        if self.is_bag and self.configurations:
            once += channels_held_by(self.configurations[-1].parameters)
        return once

    def _bag(self) -> Bag:
        if not self.is_bag:
            raise BagError(f"{self.path} is a CSV file: it holds no estimates")
        return open_bag(self.path, self.namespace)


def configurations_of(bag: Bag) -> list[RecordedConfiguration]:
    """Return the recorded configurations of the estimator in order; empty where there are none.

    Raises:
        BagError: if there are several topics of configurations, or one is damaged.
    """
    topic = only_topic(bag, CONFIGURATION_TYPE, CONFIGURATION)
    if topic is None:
        return []
    definition = bag.topics[topic].definition
    decode = decoder(definition)
    try:
        return [_configuration(decode(m.data)) for m in bag.messages({topic})]
    except (AttributeError, TypeError, ValueError) as error:
        raise BagError(damaged_definition(definition)) from error


def only_topic(bag: Bag, type_name: str, usual: str) -> str | None:
    """Return the topic of a type: the usual one if it is there, else the only one, else None.

    Raises:
        BagError: if there are several and none is the usual one.
    """
    names = [t.name for t in bag.topics.values() if t.definition.name == type_name]
    if (expected := full_name(usual, bag.namespace)) in names:
        return expected
    if len(names) > 1:
        # What belongs to one of them is in its namespace.
        own = names[0].removesuffix(full_name(usual))
        pattern = f"{own}/*" if own != names[0] else names[0]
        raise BagError(
            f"{bag.path} has several topics of type {type_name}: {', '.join(names)}; make a bag of "
            f"one: hc bag filter BAG NEW --topics {shlex.quote(pattern)}"
        )
    return names[0] if names else None


def _configuration(message: Any) -> RecordedConfiguration:
    return RecordedConfiguration(
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
