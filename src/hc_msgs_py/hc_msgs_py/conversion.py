"""Messages to plain data and back, in the core's units (mm, mm/s, N, s).

Functions named fill_* write into an existing message. The streams of a thousand messages a second
do without message objects: wire.py.
"""

from __future__ import annotations

from array import array
from typing import Any, NamedTuple

from hc_msgs.msg import EstimatorConfiguration, IndenterSample
from rclpy.parameter import Parameter

from hc_msgs_py.topics import FRAME_INDENTER_TIP
from hc_msgs_py.units import METRE_IN_MM, nanoseconds_from_stamp, set_stamp

__all__ = [
    "Configuration",
    "Sample",
    "configuration_from_message",
    "fill_event",
    "fill_force",
    "fill_sample",
    "message_from_configuration",
    "new_sample_message",
    "sample_from_message",
]

LONGEST_REASON = 255
PARAMETER_FIELDS = ("stiffness", "damping", "displacement_exponent", "velocity_exponent")


class Sample(NamedTuple):
    """One reading of the sensors in the core's units."""

    stamp_ns: int
    sequence: int
    displacement_mm: float
    force_n: float


class Configuration(NamedTuple):
    """A configuration of the estimator as plain data."""

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


def new_sample_message(frame_id: str = FRAME_INDENTER_TIP) -> Any:
    """Return an empty IndenterSample with its frame set."""
    message = IndenterSample()
    message.header.frame_id = frame_id
    return message


def fill_sample(
    message: Any, stamp_ns: int, sequence: int, displacement_mm: float, force_n: float
) -> None:
    """Write one reading into an IndenterSample."""
    set_stamp(message.header.stamp, stamp_ns)
    message.sequence = sequence
    message.displacement = displacement_mm / METRE_IN_MM
    message.force = force_n


def sample_from_message(message: Any) -> Sample:
    """Return an IndenterSample as plain data."""
    return Sample(
        nanoseconds_from_stamp(message.header.stamp),
        message.sequence,
        message.displacement * METRE_IN_MM,
        message.force,
    )


def fill_force(message: Any, stamp_ns: int, force_n: float) -> None:
    """Write a force along z into a geometry_msgs/WrenchStamped; the frame stays as it is."""
    set_stamp(message.header.stamp, stamp_ns)
    message.wrench.force.z = force_n


def fill_event(
    message: Any,
    kind: int,
    stamp_ns: int,
    sequence: int,
    configuration_revision: int,
    reason: str,
) -> None:
    """Write an event into an EstimatorEvent; a reason that is too long is cut."""
    set_stamp(message.header.stamp, stamp_ns)
    message.sequence = sequence
    message.configuration_revision = configuration_revision
    message.kind = kind
    message.reason = (
        reason if len(reason) <= LONGEST_REASON else reason[: LONGEST_REASON - 3] + "..."
    )


def message_from_configuration(configuration: Configuration) -> Any:
    """Return a configuration as an EstimatorConfiguration; parameters sorted by name."""
    message = EstimatorConfiguration()
    set_stamp(message.header.stamp, configuration.stamp_ns)
    message.revision = configuration.revision
    message.valid_from_sequence = configuration.valid_from_sequence
    set_stamp(message.time_origin, configuration.time_origin_ns)
    message.cause = configuration.cause
    message.filter = configuration.filter
    message.state_space = configuration.state_space
    message.contact_model = configuration.contact_model
    message.software_version = configuration.software_version
    message.parameters = [
        Parameter(name, value=value).to_parameter_msg()
        for name, value in sorted(configuration.parameters.items())
    ]
    return message


def configuration_from_message(message: Any) -> Configuration:
    """Return an EstimatorConfiguration as plain data."""
    return Configuration(
        nanoseconds_from_stamp(message.header.stamp),
        message.revision,
        message.valid_from_sequence,
        nanoseconds_from_stamp(message.time_origin),
        message.cause,
        message.filter,
        message.state_space,
        message.contact_model,
        message.software_version,
        {p.name: _plain(Parameter.from_parameter_msg(p).value) for p in message.parameters},
    )


def _plain(value: Any) -> Any:
    """Return array.array, which rclpy gives for number lists, as a list."""
    return list(value) if isinstance(value, array) else value
