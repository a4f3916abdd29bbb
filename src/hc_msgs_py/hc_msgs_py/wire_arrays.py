"""Many samples and many estimates straight to and from bytes (CDR), without an object for each.

Messages of arrays (hc_msgs/IndenterSamples, HuntCrossleyEstimates, TactileSample, TactileEstimate)
and many messages of one sample at once. As in wire.py the layout follows from the message
definition, and a test compares with rclpy's own serialisation.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from hc_msgs.msg import HuntCrossleyEstimate, IndenterSample, IndenterSamples
from numpy.typing import NDArray
from rclpy._rclpy_pybind11 import RMWError
from rclpy.serialization import deserialize_message, serialize_message

from hc_msgs_py.cdr import ENCAPSULATION
from hc_msgs_py.estimate_fields import LENGTHS, PARAMETERS, estimate_fields
from hc_msgs_py.topics import FRAME_INDENTER_TIP
from hc_msgs_py.units import METRE_IN_MM, NANOSECONDS
from hc_msgs_py.wire import SampleDecoder

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

_TYPES = {
    "boolean": "?",
    "uint8": "u1",
    "uint32": "<u4",
    "int64": "<i8",
    "uint64": "<u8",
    "double": "<f8",
}
_LITTLE_ENDIAN = np.frombuffer(ENCAPSULATION[:2], np.uint8)
_FRAME_LENGTH_START = 12
MOST_SAMPLES = 1024
"""Of an IndenterSamples or a HuntCrossleyEstimates: the bound of their arrays."""


class Samples(NamedTuple):
    """Readings in the core's units, an element each, in the order in which they came."""

    stamps_ns: IntArray
    sequences: NDArray[np.uint64]
    displacements_mm: FloatArray
    forces_n: FloatArray


@functools.lru_cache(maxsize=512)
def record_layout(message_type: Any, frame_bytes: int, count: int) -> np.dtype[Any]:
    """Return the layout of a message whose sequences all have `count` elements, or a multiple.

    A sequence whose bound is k times the smallest has k elements for each of `count`.

    Fields are encapsulation, sec, nanosec, frame_length and frame (bytes), then those of the
    message by name; of a sequence `NAME_length` stands before NAME.

    Args:
        message_type: class of a message that is a std_msgs/Header, numbers, and arrays or
            sequences of numbers.
        frame_bytes: length of frame_id with its closing zero.
        count: elements of every sequence with the smallest bound, at least 1.

    Raises:
        ValueError: if the message has other parts.
    """
    widths = _widths(message_type)
    fields: list[tuple[str, Any, int]] = [
        ("encapsulation", (np.uint8, 4), 0),
        ("sec", "<i4", 4),
        ("nanosec", "<u4", 8),
        ("frame_length", "<u4", _FRAME_LENGTH_START),
        ("frame", (np.uint8, frame_bytes), _FRAME_LENGTH_START + 4),
    ]
    position = _FRAME_LENGTH_START + frame_bytes  # counted from the end of the encapsulation

    def place(name: str, kind: str, size: int, elements: int | None) -> None:
        nonlocal position
        position += -position % size
        fields.append((name, kind if elements is None else (kind, (elements,)), position + 4))
        position += size * (1 if elements is None else elements)

    definition = list(message_type.get_fields_and_field_types().items())
    if definition[0] != ("header", "std_msgs/Header"):
        raise ValueError(f"{message_type.__name__} does not begin with a std_msgs/Header")
    for name, kind in definition[1:]:
        sequence = kind.startswith("sequence<")
        element, _, fixed = kind.removeprefix("sequence<").partition("," if sequence else "[")
        if element not in _TYPES:
            raise ValueError(f"{message_type.__name__}.{name} is {kind}, which is no number")
        dtype = _TYPES[element]
        size = np.dtype(dtype).itemsize
        if sequence:
            place(f"{name}_length", "<u4", 4, None)
            place(name, dtype, size, count * widths[name])
        else:
            place(name, dtype, size, int(fixed[:-1]) if fixed else None)
    names, formats, offsets = zip(*fields, strict=True)
    return np.dtype(
        {"names": names, "formats": formats, "offsets": offsets, "itemsize": position + 4}
    )


def _widths(message_type: Any) -> dict[str, int]:
    """Return the sequences of a message, and how many elements each has for one of the shortest."""
    kinds = message_type.get_fields_and_field_types().items()
    bounds = {
        name: int(kind.rstrip(">").partition(",")[2] or 1)
        for name, kind in kinds
        if kind.startswith("sequence<")
    }
    return {name: bound // min(bounds.values()) for name, bound in bounds.items()}


class ArraysEncoder:
    """Makes the bytes of one type of message; the frame is the same until it is changed."""

    def __init__(self, message_type: Any, frame_id: str = FRAME_INDENTER_TIP) -> None:
        self._message_type = message_type
        self._widths = _widths(message_type)
        self.set_frame(frame_id)

    def set_frame(self, frame_id: str) -> None:
        """Name the frame of the messages made from now on."""
        self._frame = np.frombuffer(frame_id.encode() + b"\0", np.uint8)
        self._records: dict[int, NDArray[Any]] = {}

    def record(self, count: int, stamp_ns: int) -> NDArray[Any]:
        """Return a record, shape (1,), to be filled and made into bytes with `tobytes`.

        It is the same one the next time, with what was written into it.

        Args:
            count: elements of every sequence, at least 1.
            stamp_ns: the header's stamp.
        """
        record = self._records.get(count)
        if record is None:
            record = np.zeros(1, record_layout(self._message_type, len(self._frame), count))
            record["encapsulation"] = np.frombuffer(ENCAPSULATION, np.uint8)
            record["frame_length"] = len(self._frame)
            record["frame"] = self._frame
            for name, width in self._widths.items():
                record[f"{name}_length"] = count * width
            self._records[count] = record
        record["sec"], record["nanosec"] = divmod(stamp_ns, NANOSECONDS)
        return record


class ArraysDecoder:
    """Reads messages whose sequences all have the same length, or a multiple (`record_layout`).

    Attributes:
        frame_id: frame of the message read last.
    """

    def __init__(self, message_type: Any) -> None:
        self.frame_id = ""
        self._frame = b"\0"
        self._message_type = message_type
        self._lengths = {f"{name}_length": w for name, w in _widths(message_type).items()}
        self._first = next(name for name, width in self._lengths.items() if width == 1)

    def decode(self, data: bytes) -> tuple[int, Any]:
        """Return stamp [ns] and record of a serialised message; the record shares its memory.

        Raises:
            ValueError: if the bytes are no such message, or its arrays differ in length or are
                empty.
        """
        name = self._message_type.__name__
        if len(data) < _FRAME_LENGTH_START + 5:
            raise ValueError(f"{len(data)} bytes are no {name}")
        if data[:2] != ENCAPSULATION[:2]:
            data = self._little_endian(data)
        frame_bytes = int.from_bytes(data[_FRAME_LENGTH_START : _FRAME_LENGTH_START + 4], "little")
        frame = data[_FRAME_LENGTH_START + 4 : _FRAME_LENGTH_START + 4 + frame_bytes]
        if frame != self._frame:
            if frame_bytes < 1 or len(frame) < frame_bytes or frame[-1]:
                raise ValueError(f"{len(data)} bytes are no {name}")
            try:
                self.frame_id = frame[:-1].decode()
            except UnicodeDecodeError as error:
                raise ValueError(f"{len(data)} bytes are no {name}: {error}") from None
            self._frame = frame
        shortest = record_layout(self._message_type, frame_bytes, 1)
        start = shortest.fields[self._first][1]  # type: ignore[index]
        count = int.from_bytes(data[start : start + 4], "little")
        # The count is believed only where so many elements fit, before anything is made of it.
        if count < 1 or count > len(data):
            raise ValueError(f"{name} with {count} elements in {len(data)} bytes")
        layout = record_layout(self._message_type, frame_bytes, count)
        if len(data) < layout.itemsize:
            raise ValueError(f"{name} with {count} elements in {len(data)} bytes")
        record = np.frombuffer(data, layout, 1)[0]
        if any(record[length] != count * width for length, width in self._lengths.items()):
            raise ValueError(f"{name} whose arrays differ in length")
        return int(record["sec"]) * NANOSECONDS + int(record["nanosec"]), record

    def _little_endian(self, data: bytes) -> bytes:
        try:
            return bytes(serialize_message(deserialize_message(data, self._message_type)))
        except (RMWError, UnicodeDecodeError) as error:
            name = self._message_type.__name__
            raise ValueError(f"{len(data)} bytes are no {name}: {error}") from None


class SamplesEncoder:
    """Makes IndenterSamples messages."""

    def __init__(self, frame_id: str = FRAME_INDENTER_TIP) -> None:
        self._encoder = ArraysEncoder(IndenterSamples, frame_id)

    def encode(
        self,
        stamps_ns: Sequence[int] | IntArray,
        first_sequence: int,
        displacements_mm: Sequence[float] | FloatArray,
        forces_n: Sequence[float] | FloatArray,
    ) -> bytes:
        """Return samples whose numbers follow one another as a serialised IndenterSamples."""
        first = int(stamps_ns[0])
        record = self._encoder.record(len(stamps_ns), first)
        record["sequence"] = first_sequence
        record["time_offset"] = np.asarray(stamps_ns, np.int64) - first
        record["displacement"] = np.asarray(displacements_mm, np.float64) / METRE_IN_MM
        record["force"] = forces_n
        return record.tobytes()


class SamplesDecoder:
    """Reads IndenterSamples messages.

    Attributes:
        frame_id: frame of the samples read last.
    """

    def __init__(self) -> None:
        self._decoder = ArraysDecoder(IndenterSamples)
        self.frame_id = ""

    def decode(self, data: bytes) -> Samples:
        """Return the readings in a serialised IndenterSamples.

        Raises:
            ValueError: if the bytes are no such message, or it is empty.
        """
        stamp_ns, record = self._decoder.decode(data)
        self.frame_id = self._decoder.frame_id
        offsets = record["time_offset"]
        return Samples(
            stamp_ns + offsets,
            record["sequence"] + np.arange(len(offsets), dtype=np.uint64),
            record["displacement"] * METRE_IN_MM,
            record["force"],
        )


def decode_samples(decoder: SampleDecoder, messages: Sequence[bytes]) -> Samples | None:
    """Return the readings of several serialised IndenterSample messages, if all are alike.

    Args:
        decoder: has read a message of the same frame before.
        messages: the bytes of one message each.

    Returns:
        None where one has another length or frame: they are to be read one by one then.
    """
    frame = decoder.frame_id.encode() + b"\0"
    layout = record_layout(IndenterSample, len(frame), 1)
    size = layout.itemsize
    if any(len(message) != size for message in messages):
        return None
    table = np.frombuffer(b"".join(messages), layout)
    alike = (
        (table["encapsulation"][:, :2] == _LITTLE_ENDIAN).all()
        and (table["frame_length"] == len(frame)).all()
        and (table["frame"] == np.frombuffer(frame, np.uint8)).all()
    )
    if not alike:
        return None
    return Samples(
        table["sec"].astype(np.int64) * NANOSECONDS + table["nanosec"],
        table["sequence"],
        table["displacement"] * METRE_IN_MM,
        table["force"],
    )


def encode_estimates(
    series: Any,
    samples: Samples,
    frame_id: str,
    configuration_revision: int,
    computation_time_s: float,
    now_ns: int,
) -> list[bytes]:
    """Return each of many estimates as a serialised HuntCrossleyEstimate.

    Args:
        series: hc_estimator.EstimateSeries; the names of hc_estimator.Estimate with a
            leading axis.
        samples: of which they are.
        frame_id: frame of the samples.
        configuration_revision: in force.
        computation_time_s: of each of them.
        now_ns: the time of publication, by the clock of the stamps.
    """
    frame = np.frombuffer(frame_id.encode() + b"\0", np.uint8)
    layout = record_layout(HuntCrossleyEstimate, len(frame), 1)
    count = len(samples.stamps_ns)
    table = np.zeros(count, layout)
    table["encapsulation"] = np.frombuffer(ENCAPSULATION, np.uint8)
    table["sec"], table["nanosec"] = np.divmod(samples.stamps_ns, NANOSECONDS)
    table["frame_length"] = len(frame)
    table["frame"] = frame
    table["sequence"] = samples.sequences
    table["configuration_revision"] = configuration_revision
    table["computation_time"] = computation_time_s
    table["latency"] = (now_ns - samples.stamps_ns) * 1e-9
    for name, values in estimate_fields(series, samples.forces_n):
        table[name] = values
    data, size = table.tobytes(), layout.itemsize
    return [data[i : i + size] for i in range(0, count * size, size)]


def fill_estimate_arrays(
    record: NDArray[Any], series: Any, names: Sequence[str] = ("rejected", "contact")
) -> None:
    """Write parameters, their deviations and other columns of estimates into a record.

    Args:
        record: of HuntCrossleyEstimates or TactileEstimate, as ArraysEncoder gives it.
        series: hc_estimator.EstimateSeries, as many as the record's arrays have elements.
        names: fields beside the parameters; lengths become metres.
    """
    deviations = series.parameters_std
    for i, name in enumerate(PARAMETERS):
        record[name] = series.parameters[..., i]
        record[f"{name}_std"] = deviations[..., i]
    for name in names:
        values = getattr(series, name)
        record[name] = values / METRE_IN_MM if name in LENGTHS else values
