"""Why two sensors of a bag give no pairs: stamps that stand still, or of two clocks.

A bag says when it received each message as well, by one clock for all of them: how far the stamps
of either sensor are from that shows how far its clock is from the other's.
"""

from __future__ import annotations

import statistics
from collections.abc import Sequence

from hc_msgs_py.units import NANOSECONDS

_FEW = 3
_DIGITS = 3


def why_no_pairs(
    topics: tuple[str, str],
    stamps_ns: tuple[Sequence[int], Sequence[int]],
    received_ns: tuple[Sequence[int], Sequence[int]],
    longest_wait_ns: int,
    force_offset_s: float,
) -> str:
    """Say what the stamps show; empty where they show nothing.

    Args:
        topics: of the forces and of the positions.
        stamps_ns: of their readings, as they are used.
        received_ns: when the bag received each of them.
        longest_wait_ns: so long a reading waits for those of the other sensor.
        force_offset_s: what the stamps of the forces are shifted by already.
    """
    for topic, stamps in zip(topics, stamps_ns, strict=True):
        if len(stamps) > _FEW and min(stamps) == max(stamps):
            return (
                f"all {len(stamps)} readings of {topic} have one stamp, "
                f"{stamps[0] / NANOSECONDS:.9g} s: its driver does not stamp what it measures; "
                "stamp in the driver, for what is in the bag cannot be put together"
            )
    if not all(stamps_ns):
        return ""
    force, position = (
        statistics.median(s - r for s, r in zip(stamps, received, strict=True))
        for stamps, received in zip(stamps_ns, received_ns, strict=True)
    )
    ahead_s = (force - position) / NANOSECONDS
    if abs(ahead_s) * NANOSECONDS <= longest_wait_ns:
        return ""
    way = "ahead of" if ahead_s > 0.0 else "behind"
    return (
        f"the stamps of {topics[0]} are {abs(ahead_s):.{_DIGITS}f} s {way} those of {topics[1]} "
        "that came at the same time: two clocks; set one by the other (PTP, chrony), or "
        f"--input force.time_offset={round(force_offset_s - ahead_s, _DIGITS):.10g}, good to some "
        "milliseconds"
    )
