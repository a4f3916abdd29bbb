"""Messages to plain data and back, in the core's units (mm, mm/s, N, s).

Functions named fill_* write into an existing message, because a node that publishes a thousand
messages a second should not make a thousand objects.
"""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np
from hc_msgs.msg import EstimatorConfiguration, HuntCrossleyEstimate, IndenterSample, IndenterTruth
from numpy.typing import NDArray
from rclpy.parameter import Parameter

from hc_msgs_py.topics import FRAME_INDENTER_TIP
from hc_msgs_py.units import METRE_IN_MM, nanoseconds_from_stamp, set_stamp

__all__ = [
    "Configuration",
    "Sample",
    "configuration_from_message",
    "fill_contact",
    "fill_estimate",
    "fill_event",
    "fill_force",
    "fill_sample",
    "fill_truth",
    "message_from_configuration",
    "new_estimate_message",
    "new_sample_message",
    "new_truth_message",
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


class _EstimateLike(Protocol):
    """What fill_estimate reads; hc_estimator.Estimate has it. Units mm, mm/s, N."""

    @property
    def parameters(self) -> NDArray[np.float64]: ...
    @property
    def parameters_std(self) -> NDArray[np.float64]: ...
    @property
    def covariance(self) -> NDArray[np.float64]: ...
    @property
    def identifiability(self) -> NDArray[np.float64]: ...
    @property
    def innovation(self) -> NDArray[np.float64]: ...
    @property
    def displacement(self) -> float: ...
    @property
    def velocity(self) -> float: ...
    @property
    def force_predicted(self) -> float: ...
    @property
    def force_reconstructed(self) -> float: ...
    @property
    def nis(self) -> float: ...
    @property
    def force_noise_std(self) -> float: ...
    @property
    def displacement_noise_std(self) -> float: ...
    @property
    def contact(self) -> bool: ...
    @property
    def change_detected(self) -> bool: ...
    @property
    def model_mismatch(self) -> bool: ...
    @property
    def rejected(self) -> int: ...


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


def new_truth_message(frame_id: str = FRAME_INDENTER_TIP) -> Any:
    """Return an empty IndenterTruth with its frame set."""
    message = IndenterTruth()
    message.header.frame_id = frame_id
    return message


def new_estimate_message() -> Any:
    """Return an empty HuntCrossleyEstimate."""
    return HuntCrossleyEstimate()


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


def fill_truth(
    message: Any,
    stamp_ns: int,
    sequence: int,
    displacement_mm: float,
    velocity_mm_s: float,
    force_n: float,
    parameters: Sequence[float],
    contact: bool,
) -> None:
    """Write the rig's true state into an IndenterTruth; parameters are K, B, n, p."""
    set_stamp(message.header.stamp, stamp_ns)
    message.sequence = sequence
    message.displacement = displacement_mm / METRE_IN_MM
    message.velocity = velocity_mm_s / METRE_IN_MM
    message.force = force_n
    message.stiffness = float(parameters[0])
    message.damping = float(parameters[1])
    message.displacement_exponent = float(parameters[2])
    message.velocity_exponent = float(parameters[3])
    message.contact = contact


def fill_force(message: Any, stamp_ns: int, force_n: float) -> None:
    """Write a force along z into a geometry_msgs/WrenchStamped; the frame stays as it is."""
    set_stamp(message.header.stamp, stamp_ns)
    message.wrench.force.z = force_n


def fill_estimate(
    message: Any,
    estimate: _EstimateLike,
    stamp_ns: int,
    sequence: int,
    force_measured_n: float,
    configuration_revision: int,
    computation_time_s: float,
) -> None:
    """Write an estimate into a HuntCrossleyEstimate, in SI but for the parameters themselves.

    The field latency is left to the caller, who sets it last, just before publishing.
    """
    set_stamp(message.header.stamp, stamp_ns)
    message.sequence = sequence
    message.configuration_revision = configuration_revision
    (
        message.stiffness,
        message.damping,
        message.displacement_exponent,
        message.velocity_exponent,
    ) = estimate.parameters.tolist()
    (
        message.stiffness_std,
        message.damping_std,
        message.displacement_exponent_std,
        message.velocity_exponent_std,
    ) = estimate.parameters_std.tolist()
    (
        message.stiffness_identifiability,
        message.damping_identifiability,
        message.displacement_exponent_identifiability,
        message.velocity_exponent_identifiability,
    ) = estimate.identifiability.tolist()
    innovation_displacement, innovation_force = estimate.innovation.tolist()
    message.displacement = estimate.displacement / METRE_IN_MM
    message.velocity = estimate.velocity / METRE_IN_MM
    message.force_measured = force_measured_n
    message.force_predicted = estimate.force_predicted
    message.force_reconstructed = estimate.force_reconstructed
    message.innovation_displacement = innovation_displacement / METRE_IN_MM
    message.innovation_force = innovation_force
    message.nis = estimate.nis
    message.force_noise_std = estimate.force_noise_std
    message.displacement_noise_std = estimate.displacement_noise_std / METRE_IN_MM
    message.computation_time = computation_time_s
    message.contact = estimate.contact
    message.change_detected = estimate.change_detected
    message.model_mismatch = estimate.model_mismatch
    message.rejected = int(estimate.rejected)
    message.covariance = estimate.covariance.reshape(16)


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
