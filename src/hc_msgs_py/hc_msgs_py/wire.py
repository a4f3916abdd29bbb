"""The messages of the 1 kHz streams straight to and from their bytes on the wire (CDR).

rclpy makes a message object of every sample that it takes and reads one field by field when it
publishes. Where a thousand a second go both ways that is a good part of a node's processor time,
so the nodes of the suite publish and take bytes. The layout is not written down here: it follows
from the message definition, and a test compares with rclpy's own serialisation.
"""

from __future__ import annotations

import functools
import struct
from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np
from hc_msgs.msg import HuntCrossleyEstimate, IndenterSample, IndenterTruth
from numpy.typing import NDArray
from rclpy._rclpy_pybind11 import RMWError
from rclpy.serialization import deserialize_message

from hc_msgs_py.cdr import (
    ENCAPSULATION,
    FRAME_LENGTH_OFFSET,
    FRAME_OFFSET,
    LITTLE_ENDIAN,
    NUMBERS,
    aligned,
)
from hc_msgs_py.conversion import Sample, sample_from_message
from hc_msgs_py.topics import FRAME_INDENTER_TIP
from hc_msgs_py.units import METRE_IN_MM, NANOSECONDS

_HEADER = "<4siII"  # encapsulation, sec, nanosec, length of frame_id with its closing zero


@functools.lru_cache(maxsize=64)
def stamped_layout(message_type: Any, frame_bytes: int) -> struct.Struct:
    """Return the layout of a message that is a std_msgs/Header and fields of fixed size.

    Its values are the encapsulation, sec, nanosec, the length of frame_id, frame_id (bytes, with
    the closing zero), then the fields in their order. An array is one value: its bytes.

    Args:
        message_type: class of the message.
        frame_bytes: length of frame_id with its closing zero.

    Raises:
        ValueError: if the message has other parts.
    """
    layout = f"{_HEADER}{frame_bytes}s"
    end = FRAME_OFFSET + frame_bytes
    fields = list(message_type.get_fields_and_field_types().items())
    if fields[0] != ("header", "std_msgs/Header"):
        raise ValueError(f"{message_type.__name__} does not begin with a std_msgs/Header")
    for name, kind in fields[1:]:
        element, _, count = kind.partition("[")
        if element not in NUMBERS or count == "]":
            raise ValueError(f"{message_type.__name__}.{name} is {kind}, which has no fixed place")
        code = NUMBERS[element]
        size = struct.calcsize(f"<{code}")
        length = size * (int(count[:-1]) if count else 1)
        start = aligned(end, size)
        layout += "x" * (start - end) + (f"{length}s" if count else code)
        end = start + length
    return struct.Struct(layout)


class _Encoder:
    """Makes the bytes of one type of message; the frame is the same until it is changed."""

    def __init__(self, message_type: Any, frame_id: str) -> None:
        self._message_type = message_type
        self.set_frame(frame_id)

    def set_frame(self, frame_id: str) -> None:
        """Name the frame of the messages made from now on."""
        self._frame = frame_id.encode() + b"\0"
        layout = stamped_layout(self._message_type, len(self._frame))
        self._pack: Callable[..., bytes] = layout.pack


class SampleEncoder(_Encoder):
    """Makes IndenterSample messages."""

    def __init__(self, frame_id: str = FRAME_INDENTER_TIP) -> None:
        super().__init__(IndenterSample, frame_id)

    def encode(self, stamp_ns: int, sequence: int, displacement_mm: float, force_n: float) -> bytes:
        """Return one reading as a serialised IndenterSample."""
        frame = self._frame
        return self._pack(
            ENCAPSULATION,
            *divmod(stamp_ns, NANOSECONDS),
            len(frame),
            frame,
            sequence,
            displacement_mm / METRE_IN_MM,
            force_n,
        )


class TruthEncoder(_Encoder):
    """Makes IndenterTruth messages."""

    def __init__(self, frame_id: str = FRAME_INDENTER_TIP) -> None:
        super().__init__(IndenterTruth, frame_id)

    def encode(
        self,
        stamp_ns: int,
        sequence: int,
        displacement_mm: float,
        velocity_mm_s: float,
        force_n: float,
        parameters: Sequence[float],
        contact: bool,
    ) -> bytes:
        """Return the rig's true state as a serialised IndenterTruth; parameters are K, B, n, p."""
        frame = self._frame
        return self._pack(
            ENCAPSULATION,
            *divmod(stamp_ns, NANOSECONDS),
            len(frame),
            frame,
            sequence,
            displacement_mm / METRE_IN_MM,
            velocity_mm_s / METRE_IN_MM,
            force_n,
            *parameters,
            contact,
        )


class _EstimateLike(Protocol):
    """What EstimateEncoder reads; hc_estimator.Estimate has it. Units mm, mm/s, N."""

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
    def channel_delay(self) -> float: ...
    @property
    def channel_delay_std(self) -> float: ...
    @property
    def contact_position(self) -> float: ...
    @property
    def contact_position_std(self) -> float: ...
    @property
    def force_zero(self) -> float: ...
    @property
    def force_zero_std(self) -> float: ...
    @property
    def hypothesis(self) -> int: ...
    @property
    def hypothesis_scores(self) -> NDArray[np.float64]: ...
    @property
    def contact(self) -> bool: ...
    @property
    def change_detected(self) -> bool: ...
    @property
    def model_mismatch(self) -> bool: ...
    @property
    def rejected(self) -> int: ...


class EstimateEncoder(_Encoder):
    """Makes HuntCrossleyEstimate messages."""

    def __init__(self, frame_id: str = FRAME_INDENTER_TIP) -> None:
        super().__init__(HuntCrossleyEstimate, frame_id)

    def encode(
        self,
        estimate: _EstimateLike,
        stamp_ns: int,
        sequence: int,
        force_measured_n: float,
        configuration_revision: int,
        computation_time_s: float,
        latency_s: float,
    ) -> bytes:
        """Return an estimate as a serialised HuntCrossleyEstimate, in SI but for the parameters."""
        frame = self._frame
        innovation_displacement, innovation_force = estimate.innovation.tolist()
        return self._pack(
            ENCAPSULATION,
            *divmod(stamp_ns, NANOSECONDS),
            len(frame),
            frame,
            sequence,
            configuration_revision,
            *estimate.parameters.tolist(),
            *estimate.parameters_std.tolist(),
            *estimate.identifiability.tolist(),
            estimate.displacement / METRE_IN_MM,
            estimate.velocity / METRE_IN_MM,
            force_measured_n,
            estimate.force_predicted,
            estimate.force_reconstructed,
            innovation_displacement / METRE_IN_MM,
            innovation_force,
            estimate.nis,
            estimate.force_noise_std,
            estimate.displacement_noise_std / METRE_IN_MM,
            estimate.channel_delay,
            estimate.channel_delay_std,
            estimate.contact_position / METRE_IN_MM,
            estimate.contact_position_std / METRE_IN_MM,
            estimate.force_zero,
            estimate.force_zero_std,
            computation_time_s,
            latency_s,
            estimate.contact,
            estimate.change_detected,
            estimate.model_mismatch,
            estimate.rejected,
            estimate.hypothesis,
            estimate.covariance.tobytes(),
            estimate.hypothesis_scores.tobytes(),
        )


class SampleDecoder:
    """Reads IndenterSample messages.

    Attributes:
        frame_id: frame of the sample read last.
    """

    def __init__(self) -> None:
        self.frame_id = ""
        self._expect(b"\0")

    def decode(self, data: bytes) -> Sample:
        """Return the reading in a serialised IndenterSample.

        Raises:
            ValueError: if the bytes are no such message.
        """
        if data[:2] != LITTLE_ENDIAN:
            return self._decode_other(data)
        # All but the first message have the frame of the one before.
        if data[FRAME_LENGTH_OFFSET : self._frame_end] != self._frame:
            return self._decode_other(data)
        try:
            _, sec, nanosec, _, _, sequence, displacement, force = self._unpack(data)
        except struct.error:
            raise ValueError(f"{len(data)} bytes are no IndenterSample") from None
        return Sample(sec * NANOSECONDS + nanosec, sequence, displacement * METRE_IN_MM, force)

    def _decode_other(self, data: bytes) -> Sample:
        try:
            message = deserialize_message(data, IndenterSample)
        except (RMWError, UnicodeDecodeError) as error:
            raise ValueError(f"{len(data)} bytes are no IndenterSample: {error}") from None
        self.frame_id = message.header.frame_id
        self._expect(self.frame_id.encode() + b"\0")
        return sample_from_message(message)

    def _expect(self, frame: bytes) -> None:
        self._frame = struct.pack("<I", len(frame)) + frame
        self._frame_end = FRAME_LENGTH_OFFSET + len(self._frame)
        self._unpack = stamped_layout(IndenterSample, len(frame)).unpack_from
