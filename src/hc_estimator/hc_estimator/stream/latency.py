"""How long ago a sample was taken, also after the clock was set while its source went on.

Stamps and latency are by the system's clock. When it is set (a machine that slept, a time server),
a source either goes with it or stamps on as before, and then every estimate would seem to come by
the step too late, for ever.
"""

from __future__ import annotations

CLOCK_STEP_NS = 100_000_000
"""Latencies within this need no second look; the clock is slewed by less between two of them."""


class LatencyClock:
    """Takes the difference between a stamp and now by the clock of the stamps."""

    def __init__(self) -> None:
        self._offset_ns: int | None = None  # stamps' clock against the steady one

    def latency_ns(self, stamp_ns: int, now_ns: int, steady_ns: int) -> int:
        """Return the latency of a sample [ns].

        Where the system's clock was set since the stamps agreed with it last, there are two
        answers: that of stamps that go with it, and of stamps that do not. The smaller is meant.

        Args:
            stamp_ns: stamp of the sample.
            now_ns: the same moment by the system's clock.
            steady_ns: and by one that nobody sets.
        """
        latency = now_ns - stamp_ns
        if -CLOCK_STEP_NS < latency < CLOCK_STEP_NS or self._offset_ns is None:
            self._offset_ns = now_ns - steady_ns
            return latency
        before = steady_ns + self._offset_ns - stamp_ns
        return before if abs(before) < abs(latency) else latency
