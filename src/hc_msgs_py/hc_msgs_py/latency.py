"""Which differences between a stamp and now are latencies, and which are those of two clocks."""

from __future__ import annotations

from typing import Final

from hc_msgs_py.units import NANOSECONDS

AHEAD_S: Final = 0.01
"""A stamp further ahead is of another clock."""
NO_LATENCY_S: Final = 1e3
"""What is so old does not come late: its stamps are of a simulation, a recording, another clock."""
_AHEAD_NS: Final = round(AHEAD_S * NANOSECONDS)
_NO_LATENCY_NS: Final = round(NO_LATENCY_S * NANOSECONDS)


def is_latency(latency_ns: int) -> bool:
    """Whether a sample can have been on its way for so long [ns]."""
    return -_AHEAD_NS <= latency_ns < _NO_LATENCY_NS
