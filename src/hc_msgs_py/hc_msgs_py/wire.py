"""The messages of the 1 kHz streams straight to and from their bytes on the wire (CDR).

rclpy makes a message object of every sample that it takes and reads one field by field when it
publishes. Where a thousand a second go both ways that is a good part of a node's processor time,
so the nodes of the suite publish and take bytes. The layout is not written down here: it follows
from the message definition, and a test compares with rclpy's own serialisation.
"""

from __future__ import annotations

import functools
import struct
from collections.abc import Callable, Iterable, Sequence
from typing import Any

from hc_msgs.msg import IndenterSample, IndenterTruth
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


def publish_bytes(publisher: Any, messages: Iterable[bytes]) -> None:
    """Publish serialised messages, without the looks of rclpy at what each of them is."""
    handle = publisher.handle
    with handle:
        for data in messages:
            handle.publish_raw(data)


class StampedEncoder:
    """Makes the bytes of one type of message; the frame is the same until it is changed."""

    def __init__(self, message_type: Any, frame_id: str) -> None:
        self._message_type = message_type
        self.set_frame(frame_id)

    def set_frame(self, frame_id: str) -> None:
        """Name the frame of the messages made from now on."""
        self._frame = frame_id.encode() + b"\0"
        layout = stamped_layout(self._message_type, len(self._frame))
        self._pack: Callable[..., bytes] = layout.pack


class SampleEncoder(StampedEncoder):
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


class TruthEncoder(StampedEncoder):
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
