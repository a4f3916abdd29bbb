"""Several messages of one type at once, as bytes: for what is known some samples ahead.

As in wire.py no layout is written down here: that of stamped messages follows from their
definition, that of others from what rclpy makes of one of them.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from rclpy.serialization import serialize_message

from hc_msgs_py.cdr import ENCAPSULATION, HEAD
from hc_msgs_py.topics import FRAME_INDENTER_TIP
from hc_msgs_py.units import NANOSECONDS
from hc_msgs_py.wire_arrays import record_layout

IntArray = NDArray[np.int64]

_FIRST_MARK: Final = 1.2345678901234567e100
"""A number that no message holds, and after it those of the other places."""


class StampedMessages:
    """Makes messages that are a std_msgs/Header, numbers and arrays of fixed size."""

    def __init__(self, message_type: Any, frame_id: str = FRAME_INDENTER_TIP) -> None:
        """Fix the type and the frame.

        Raises:
            ValueError: if the message has other parts.
        """
        frame = np.frombuffer(frame_id.encode() + b"\0", np.uint8)
        one = np.zeros(1, record_layout(message_type, len(frame), 1))
        one["encapsulation"] = np.frombuffer(ENCAPSULATION, np.uint8)
        one["frame_length"] = len(frame)
        one["frame"] = frame
        self._table = one

    def encode(self, stamps_ns: IntArray, fields: Iterable[tuple[str, ArrayLike]]) -> list[bytes]:
        """Return a message for each stamp.

        Args:
            stamps_ns: of the headers [ns], shape (n,).
            fields: names and values of all fields, shape (n,) or (n, elements), or one for all.
        """
        count = len(stamps_ns)
        if len(self._table) != count:
            self._table = np.repeat(self._table[:1], count)
        table = self._table
        table["sec"], table["nanosec"] = np.divmod(stamps_ns, NANOSECONDS)
        for name, values in fields:
            table[name] = values
        data, size = table.tobytes(), table.itemsize
        return [data[i : i + size] for i in range(0, len(data), size)]


class PatternMessages:
    """Makes messages of any type that differ in their stamp and in some numbers alone."""

    def __init__(self, places: int, fill: Callable[[Sequence[float]], Any]) -> None:
        """Find the places.

        Args:
            places: how many float64 differ.
            fill: returns a message that begins with a std_msgs/Header and has given numbers in
                these places, each once.
        """
        marks = [_FIRST_MARK * (1.0 + place) for place in range(places)]
        data = bytes(serialize_message(fill(marks)))
        offsets = [data.index(struct.pack("<d", mark)) for mark in marks]
        layout = np.dtype(
            {
                "names": ["sec", "nanosec", *map(str, range(places))],
                "formats": ["<i4", "<u4", *["<f8"] * places],
                "offsets": [HEAD, HEAD + 4, *offsets],
                "itemsize": len(data),
            }
        )
        self._layout = layout
        self._bytes = np.frombuffer(data, np.uint8).reshape(1, -1).copy()

    def encode(self, stamps_ns: IntArray, numbers: Sequence[ArrayLike]) -> list[bytes]:
        """Return a message for each stamp.

        Args:
            stamps_ns: of the headers [ns], shape (n,).
            numbers: of each place, shape (n,).
        """
        count = len(stamps_ns)
        if len(self._bytes) != count:
            self._bytes = np.repeat(self._bytes[:1], count, axis=0)
        table: NDArray[Any] = self._bytes.view(self._layout).reshape(count)
        table["sec"], table["nanosec"] = np.divmod(stamps_ns, NANOSECONDS)
        for place, values in enumerate(numbers):
            table[str(place)] = values
        return [row.tobytes() for row in self._bytes]
