"""Estimates and contacts as messages: the node's own results in SI, the estimates as bytes.

K, B, n and p keep the units of the literature (docs/design.md).
"""

from __future__ import annotations

import struct
from typing import Any

import numpy as np
from hc_msgs.msg import HuntCrossleyEstimate

from hc_estimator import Estimate
from hc_estimator.estimate import (
    CHANGE_DETECTED,
    CHANNEL_DELAY,
    CHANNEL_DELAY_STD,
    CONTACT,
    CONTACT_POSITION,
    CONTACT_POSITION_STD,
    COVARIANCE,
    DISPLACEMENT,
    DISPLACEMENT_NOISE_STD,
    FORCE_NOISE_STD,
    FORCE_PREDICTED,
    FORCE_RECONSTRUCTED,
    FORCE_ZERO,
    FORCE_ZERO_STD,
    HYPOTHESIS,
    HYPOTHESIS_SCORES,
    IDENTIFIABILITY,
    INNOVATION,
    MODEL_MISMATCH,
    NIS,
    PARAMETERS,
    REJECTED,
    VELOCITY,
)
from hc_estimator.stream.contacts import ContactSummary
from hc_msgs_py.cdr import ENCAPSULATION
from hc_msgs_py.conversion import PARAMETER_FIELDS
from hc_msgs_py.topics import FRAME_INDENTER_TIP
from hc_msgs_py.units import METRE_IN_MM, NANOSECONDS, set_stamp
from hc_msgs_py.wire import StampedEncoder


class EstimateEncoder(StampedEncoder):
    """Makes HuntCrossleyEstimate messages."""

    def __init__(self, frame_id: str = FRAME_INDENTER_TIP) -> None:
        super().__init__(HuntCrossleyEstimate, frame_id)
        self._pack_covariance = struct.Struct("<16d").pack
        self._pack_scores = struct.Struct("<6d").pack

    def encode(
        self,
        estimate: Estimate,
        stamp_ns: int,
        sequence: int,
        force_measured_n: float,
        configuration_revision: int,
        computation_time_s: float,
        latency_s: float,
    ) -> bytes:
        """Return an estimate as a serialised HuntCrossleyEstimate, in SI but for the parameters."""
        frame = self._frame
        values = estimate.values
        innovation = values[INNOVATION : INNOVATION + 2]
        return self._pack(
            ENCAPSULATION,
            *divmod(stamp_ns, NANOSECONDS),
            len(frame),
            frame,
            sequence,
            configuration_revision,
            *values[PARAMETERS : PARAMETERS + 4],
            *estimate.parameters_std.tolist(),
            *values[IDENTIFIABILITY : IDENTIFIABILITY + 4],
            values[DISPLACEMENT] / METRE_IN_MM,
            values[VELOCITY] / METRE_IN_MM,
            force_measured_n,
            values[FORCE_PREDICTED],
            values[FORCE_RECONSTRUCTED],
            innovation[0] / METRE_IN_MM,
            innovation[1],
            values[NIS],
            values[FORCE_NOISE_STD],
            values[DISPLACEMENT_NOISE_STD] / METRE_IN_MM,
            values[CHANNEL_DELAY],
            values[CHANNEL_DELAY_STD],
            values[CONTACT_POSITION] / METRE_IN_MM,
            values[CONTACT_POSITION_STD] / METRE_IN_MM,
            values[FORCE_ZERO],
            values[FORCE_ZERO_STD],
            computation_time_s,
            latency_s,
            values[CONTACT] != 0.0,
            values[CHANGE_DETECTED] != 0.0,
            values[MODEL_MISMATCH] != 0.0,
            int(values[REJECTED]),
            int(values[HYPOTHESIS]),
            self._pack_covariance(*values[COVARIANCE : COVARIANCE + 16]),
            self._pack_scores(*values[HYPOTHESIS_SCORES : HYPOTHESIS_SCORES + 6]),
        )


def fill_contact(message: Any, contact: ContactSummary, configuration_revision: int) -> None:
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
