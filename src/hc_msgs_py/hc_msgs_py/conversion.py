"""Messages to plain data and back, in the core's units (mm, mm/s, N, s).

Functions named fill_* write into an existing message. The streams of a thousand messages a second
do without message objects: wire.py.
"""

from __future__ import annotations

from array import array
from typing import Any, NamedTuple, Protocol

import numpy as np
from hc_msgs.msg import EstimatorConfiguration, IndenterSample
from numpy.typing import NDArray
from rclpy.parameter import Parameter

from hc_msgs_py.topics import FRAME_INDENTER_TIP
from hc_msgs_py.units import METRE_IN_MM, nanoseconds_from_stamp, set_stamp

__all__ = [
    "Configuration",
    "Sample",
    "configuration_from_message",
    "fill_contact",
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


class _ContactLike(Protocol):
    """What fill_contact reads; hc_estimator.online.contacts.ContactSummary has it.

    Units mm, mm/s, N, N mm; times in ns.
    """

    number: int
    start_ns: int
    end_ns: int
    first_sequence: int
    last_sequence: int
    samples: int
    rejected: int
    tissue_changes: int
    model_mismatch: bool
    peak_force: float
    peak_displacement: float
    peak_speed: float
    energy_in: float
    energy_loss: float
    position_m: tuple[float, float, float]
    position_frame_id: str

    @property
    def parameters(self) -> NDArray[np.float64]:
        """K, B, n, p, shape (4,)."""

    @property
    def covariance(self) -> NDArray[np.float64]:
        """Covariance of the parameters, shape (4, 4)."""

    @property
    def identifiability(self) -> NDArray[np.float64]:
        """Of the parameters, shape (4,)."""

    @property
    def duration_s(self) -> float:
        """Time from the first to the last sample."""

    @property
    def force_rmse(self) -> float:
        """Root mean square of measured minus predicted force."""


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


def fill_contact(message: Any, contact: _ContactLike, configuration_revision: int) -> None:
    """Write the summary of a contact into a ContactSummary, in SI but for the parameters."""
    set_stamp(message.header.stamp, contact.end_ns)
    set_stamp(message.start, contact.start_ns)
    message.contact = contact.number
    message.first_sequence = contact.first_sequence
    message.last_sequence = contact.last_sequence
    message.samples = contact.samples
    message.rejected = contact.rejected
    message.tissue_changes = contact.tissue_changes
    message.configuration_revision = configuration_revision
    message.duration = contact.duration_s
    deviations = np.sqrt(np.diagonal(contact.covariance))
    for i, name in enumerate(PARAMETER_FIELDS):
        setattr(message, name, float(contact.parameters[i]))
        setattr(message, f"{name}_std", float(deviations[i]))
        setattr(message, f"{name}_identifiability", float(contact.identifiability[i]))
    message.peak_force = contact.peak_force
    message.peak_displacement = contact.peak_displacement / METRE_IN_MM
    message.peak_speed = contact.peak_speed / METRE_IN_MM
    message.energy_in = contact.energy_in / METRE_IN_MM
    message.energy_loss = contact.energy_loss / METRE_IN_MM
    message.force_rmse = contact.force_rmse
    message.position_x, message.position_y, message.position_z = contact.position_m
    message.position_frame_id = contact.position_frame_id
    message.model_mismatch = contact.model_mismatch
    message.covariance = contact.covariance.reshape(16)


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
