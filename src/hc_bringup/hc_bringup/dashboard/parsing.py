"""CDR messages of fixed size as record arrays, as they come from the taps."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from hc_bringup.dashboard.taps import Arrival
from hc_logger.definitions import installed_definition
from hc_logger.layout import record_dtype, stamps
from hc_msgs_py.cdr import ENCAPSULATION, FRAME_LENGTH_OFFSET

_LENGTH: Final = struct.Struct("<I")


class RecordParser:
    """Reads messages of one type that is a header and fields of fixed size.

    Attributes:
        damaged: messages that were no such thing and were left out.
    """

    def __init__(self, type_name: str) -> None:
        self._definition = installed_definition(type_name)
        self.damaged = 0

    def parse(self, arrivals: Sequence[Arrival]) -> tuple[NDArray[Any], NDArray[np.int64]]:
        """Return records without their frame_id, and their stamps [ns]."""
        groups: list[tuple[int, list[bytes]]] = []
        for data, _received in arrivals:
            frame = self._frame_bytes(data)
            if frame is None:
                self.damaged += 1
                continue
            if not groups or groups[-1][0] != frame:
                groups.append((frame, []))
            # Some middlewares fill a message up to whole words.
            groups[-1][1].append(data[: record_dtype(self._definition, frame).itemsize])
        empty = record_dtype(self._definition, 1)
        kept = [name for name in empty.names or () if name != "header.frame_id"]
        target = np.dtype([(name, empty[name]) for name in kept])
        parts = [np.empty(0, target)]
        for frame, messages in groups:
            view = np.frombuffer(b"".join(messages), record_dtype(self._definition, frame))
            part = np.empty(len(view), target)
            for name in kept:
                part[name] = view[name]
            parts.append(part)
        table = np.concatenate(parts)
        return table, stamps(table)

    def _frame_bytes(self, data: bytes) -> int | None:
        """Return the length of a message's frame_id, or None if it is not of this type."""
        if len(data) < FRAME_LENGTH_OFFSET + 4 or data[:2] != ENCAPSULATION[:2]:
            return None
        frame = int(_LENGTH.unpack_from(data, FRAME_LENGTH_OFFSET)[0])
        if not 0 < frame <= len(data):
            return None
        return frame if record_dtype(self._definition, frame).itemsize <= len(data) else None
