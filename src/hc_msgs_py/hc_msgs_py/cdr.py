"""Where CDR, the encoding of ROS 2 messages, puts things: the suite's one place that knows it.

Every number is aligned to its own size, counted from the end of the 4-byte encapsulation; a text is
its length (with the closing zero, uint32) and its bytes. What stands here serves the streams of the
nodes (wire.py), whole recordings as arrays (hc_logger.layout) and a look into a bag
(hc_logger.info). Free of ROS.
"""

from __future__ import annotations

from typing import Any, Final

ENCAPSULATION: Final = bytes((0, 1, 0, 0))
"""Plain CDR, little-endian: what every DDS on this kind of machine sends."""
LITTLE_ENDIAN: Final = ENCAPSULATION[:2]
"""The two option bytes that follow are free."""
HEAD: Final = len(ENCAPSULATION)
FRAME_LENGTH_OFFSET: Final = HEAD + 8
"""Place of the length of frame_id in a message that begins with a std_msgs/Header."""
FRAME_OFFSET: Final = FRAME_LENGTH_OFFSET + 4

NUMBERS: Final = {
    "bool": "?",
    "boolean": "?",
    "byte": "B",
    "char": "B",
    "octet": "B",
    "int8": "b",
    "uint8": "B",
    "int16": "h",
    "uint16": "H",
    "int32": "i",
    "uint32": "I",
    "int64": "q",
    "uint64": "Q",
    "float": "f",
    "float32": "f",
    "double": "d",
    "float64": "d",
}
"""Code of every number for struct and numpy, by its names in definitions and in rosidl classes."""


def aligned(position: Any, size: int) -> Any:
    """Return where a number of that many bytes begins, at the position or after it.

    Args:
        position: in the message, its encapsulation included; a number or an array.
        size: of the number.
    """
    return position + -(position - HEAD) % size
