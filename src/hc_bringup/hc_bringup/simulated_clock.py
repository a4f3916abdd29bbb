"""Whether sensors are stamped by the time of a simulation, which /clock tells.

An estimator that does not follow it takes their stamps for those of another computer's clock.
"""

from __future__ import annotations

import time
from typing import Any, Final

from hc_bringup.graph import Graph
from hc_msgs_py.interface_class import interface_class
from hc_msgs_py.qos import SAMPLE_QOS
from hc_msgs_py.units import nanoseconds_from_stamp

_CLOCK: Final = "rosgraph_msgs/msg/Clock"
_APART_NS: Final = 2_000_000_000
"""Stamps nearer to this computer's clock than that are used rightly without /clock."""


class ClockListener:
    """Listens to /clock, and is given the stamps of the sensors."""

    def __init__(self, graph: Graph) -> None:
        """Begin to listen."""
        self._graph = graph
        self._clock_ns: int | None = None
        self._off_ns: tuple[int, int] | None = None  # a stamp from /clock, and from this computer's
        self._subscription = graph.node.create_subscription(
            interface_class(_CLOCK), "/clock", self._take, SAMPLE_QOS
        )

    def _take(self, message: Any) -> None:
        self._clock_ns = nanoseconds_from_stamp(message.clock)

    def stamped(self, stamp_ns: int) -> None:
        """Take in the stamp of a reading that has just come."""
        if self._clock_ns is not None:
            self._off_ns = abs(stamp_ns - self._clock_ns), abs(stamp_ns - time.time_ns())

    @property
    def is_followed(self) -> bool:
        """Whether the stamps are of that clock and not of this computer's."""
        if self._off_ns is None:
            return False
        off_clock_ns, off_computer_ns = self._off_ns
        return off_computer_ns > max(_APART_NS, off_clock_ns)

    def close(self) -> None:
        """Listen no more."""
        self._graph.node.destroy_subscription(self._subscription)
