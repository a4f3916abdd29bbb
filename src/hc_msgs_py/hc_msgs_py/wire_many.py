"""Several messages of one type as records: for what is known some samples ahead.

As in wire.py no layout is written down here: that of stamped messages follows from their
definition, that of others from what rclpy makes of one of them. Whoever knows the numbers writes
them into the records: a compiled function, say.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from rclpy.serialization import serialize_message

from hc_msgs_py.cdr import ENCAPSULATION, HEAD
from hc_msgs_py.topics import FRAME_INDENTER_TIP
from hc_msgs_py.wire_arrays import record_layout

_FIRST_MARK: Final = 1.2345678901234567e100
"""A number that no message holds, and after it those of the other places."""


class Records:
    """Messages of one type, all alike until somebody writes into them."""

    def __init__(self, layout: np.dtype[Any], data: bytes) -> None:
        """Take the layout of the places, which is as long as a message, and the bytes of one."""
        self._layout, self._one = layout, data
        self._table: NDArray[Any] = np.frombuffer(bytearray(data), layout)

    def table(self, count: int) -> NDArray[Any]:
        """Return records to be filled, shape (count,): those of the last call if as many."""
        if len(self._table) != count:
            self._table = np.frombuffer(bytearray(self._one * count), self._layout)
        return self._table

    def messages(self, count: int) -> list[bytes]:
        """Return the bytes of the first records of the last table."""
        data, size = self._table.tobytes(), len(self._one)
        return [data[i : i + size] for i in range(0, count * size, size)]


class StampedMessages(Records):
    """Messages that are a std_msgs/Header, numbers and arrays of fixed size; fields by name."""

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
        super().__init__(one.dtype, one.tobytes())


class PatternMessages(Records):
    """Messages of any type that differ in their stamp (sec, nanosec) and some numbers ("0" ...)."""

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
        super().__init__(layout, data)
