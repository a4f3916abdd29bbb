"""Estimates that came many in a message, one by one, under the names that each has alone.

For who takes estimates one by one and is told them in hc_msgs/HuntCrossleyEstimates. Many at a
time, as a table, are read by hc_bringup.dashboard.parsing and hc_logger.estimate_arrays.
"""

from __future__ import annotations

from typing import Any

from hc_msgs.msg import HuntCrossleyEstimates

from hc_msgs_py.wire_arrays import ArraysDecoder


class OneOfMany:
    """One estimate of a message, with the fields of hc_msgs/HuntCrossleyEstimate but its header.

    `computation_time` and `latency` are those of the whole message.

    Attributes:
        stamp_ns: stamp of its sample [ns].
    """

    __slots__ = ("_index", "_record", "stamp_ns")

    def __init__(self, record: Any, index: int, stamp_ns: int) -> None:
        self._record, self._index, self.stamp_ns = record, index, stamp_ns

    def __getattr__(self, name: str) -> Any:
        """Return a field: a number, or an array of numbers.

        Raises:
            AttributeError: if the message has no such field.
        """
        try:
            values = self._record[name]
        except ValueError:
            raise AttributeError(f"an estimate has no {name}") from None
        if not values.shape:
            return values.item()
        width = len(values) // len(self._record["sequence"])
        mine = values[self._index * width : (self._index + 1) * width]
        return mine[0].item() if width == 1 else mine


class EstimatesReader:
    """Reads HuntCrossleyEstimates messages.

    Attributes:
        undecodable: messages that were none.
    """

    def __init__(self) -> None:
        self.undecodable = 0
        self._decoder = ArraysDecoder(HuntCrossleyEstimates)

    def read(self, data: bytes) -> list[OneOfMany]:
        """Return the estimates in a serialised message, in the order of their samples."""
        try:
            first_ns, record = self._decoder.decode(data)
        except ValueError:
            self.undecodable += 1
            return []
        offsets_ns = record["time_offset"].tolist()
        return [OneOfMany(record, i, first_ns + ns) for i, ns in enumerate(offsets_ns)]
