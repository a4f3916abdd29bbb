"""CDR messages of fixed size, and of many estimates, as record arrays, as the taps have them."""

from __future__ import annotations

import itertools
import struct
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from hc_bringup.dashboard.taps import Arrival
from hc_logger.definitions import installed_definition
from hc_logger.errors import BagError
from hc_logger.estimate_arrays import dtype_of_bytes, each_estimate
from hc_logger.layout import record_dtype, stamps
from hc_logger.type_names import ESTIMATE_TYPE, ESTIMATES_TYPE
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


class EstimatesParser:
    """Reads hc_msgs/HuntCrossleyEstimates as records of hc_msgs/HuntCrossleyEstimate.

    Attributes:
        damaged: messages that were no such thing and were left out.
        counts: estimates of each message that was parsed last.
    """

    def __init__(self) -> None:
        self._definition = installed_definition(ESTIMATES_TYPE)
        whole = record_dtype(installed_definition(ESTIMATE_TYPE), 1)
        kept = [name for name in whole.names or () if name != "header.frame_id"]
        self._nothing = np.empty(0, np.dtype([(name, whole[name]) for name in kept]))
        self.damaged = 0
        self.counts: list[int] = []

    def parse(self, arrivals: Sequence[Arrival]) -> tuple[NDArray[Any], NDArray[np.int64]]:
        """Return the estimates as records without their frame_id, and their stamps [ns]."""
        self.counts = []
        parts = [self._nothing]
        for dtype, group in itertools.groupby(arrivals, self._dtype):
            messages = [arrival.data for arrival in group]
            each = 0
            if dtype is not None:
                data = b"".join(message[: dtype.itemsize] for message in messages)
                try:
                    parts.append(each_estimate(np.frombuffer(data, dtype)))
                    each = len(parts[-1]) // len(messages)
                except BagError:
                    dtype = None
            self.damaged += 0 if dtype is not None else len(messages)
            self.counts += [each] * len(messages)
        table = np.concatenate(parts)
        return table, stamps(table)

    def _dtype(self, arrival: Arrival) -> np.dtype[Any] | None:
        try:
            return dtype_of_bytes(self._definition, np.frombuffer(arrival.data, np.uint8))
        except BagError:
            return None
