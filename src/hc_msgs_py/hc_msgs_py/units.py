"""The one place where SI (topics) and millimetres (core, CSV, command line) meet, and stamps.

Forces are newtons on both sides. Times are whole nanoseconds until the last moment: seconds since
1970 in a float64 resolve only 0.24 us, which is visible in the step of a 1 kHz signal.
"""

from __future__ import annotations

from typing import Any, Final

METRE_IN_MM: Final = 1000.0
NANOSECONDS: Final = 1_000_000_000
DAY_S: Final = 86_400.0


def sent_mm(value: float) -> float:
    """Return a length in mm as somebody reads it who got it over a topic in metres.

    The last bit may differ from what was sent.
    """
    return value / METRE_IN_MM * METRE_IN_MM


def nanoseconds_from_stamp(stamp: Any) -> int:
    """Return a builtin_interfaces/Time as whole nanoseconds."""
    return int(stamp.sec) * NANOSECONDS + int(stamp.nanosec)


def set_stamp(stamp: Any, nanoseconds: int) -> None:
    """Write whole nanoseconds into an existing builtin_interfaces/Time (no allocation)."""
    stamp.sec, stamp.nanosec = divmod(nanoseconds, NANOSECONDS)
