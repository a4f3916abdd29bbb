"""Offset of the other side's clock from the exchange of times in the datagrams, as NTP does it.

Four times belong to an exchange: t1 a datagram leaves here, t2 it arrives there, t3 an answer
leaves there, t4 it arrives here; t1 and t4 by this clock, t2 and t3 by the other one.

    delay = (t4 - t1) - (t3 - t2),    offset = ((t2 - t1) + (t3 - t4)) / 2

Whatever the two ways share the delay, the offset is wrong by at most half of it (RFC 5905). The
exchange with the shortest delay of the last seconds is therefore believed (the clock filter of
NTP); from it on the bound grows by what two clocks may drift apart.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

MEMORY_NS = 10_000_000_000
BIN_NS = 500_000_000
"""Of each such piece of time the best exchange is remembered."""
DRIFT = 1e-4
"""Two ordinary clocks drift apart by less than 100 ppm."""
JUMP_NS = 1_000_000
"""Exchanges that contradict the bounds by more than this: a clock was set, all is forgotten."""


class _Exchange(NamedTuple):
    at_ns: int
    offset_ns: float
    delay_ns: int


class ClockOffset:
    """Follows the offset of the other side's clock, other minus own.

    Attributes:
        exchanges: complete exchanges so far.
        steps: times that a clock was set meanwhile.
        round_trip_ns: delay of the newest exchange there and back, the other side's wait excluded.
    """

    def __init__(self) -> None:
        self.exchanges = 0
        self.steps = 0
        self.round_trip_ns = 0
        self._bins: deque[_Exchange] = deque()
        self._best: _Exchange | None = None
        self._since_ns: int | None = None

    @property
    def known(self) -> bool:
        """Whether there was an exchange."""
        return self._best is not None

    @property
    def offset_ns(self) -> float:
        """The other clock less this one [ns]; 0 before an exchange."""
        return 0.0 if self._best is None else self._best.offset_ns

    def bound_ns(self, now_ns: int) -> float:
        """How wrong the offset may be at most [ns]; infinite before an exchange."""
        if self._best is None:
            return float("inf")
        return self._bound(self._best, now_ns)

    def was_set(self, now_ns: int) -> None:
        """Hear that this clock was set: what was known, and what is under way, is of another."""
        self.steps += 1
        self._bins.clear()
        self._best = None
        self._since_ns = now_ns

    def add(self, t1_ns: int, t2_ns: int, t3_ns: int, t4_ns: int) -> None:
        """Take in an exchange; one whose delay is negative is none, nor one of another clock."""
        delay = (t4_ns - t1_ns) - (t3_ns - t2_ns)
        if delay < 0 or t4_ns < t1_ns or (self._since_ns is not None and t1_ns < self._since_ns):
            return
        new = _Exchange(t4_ns, 0.5 * ((t2_ns - t1_ns) + (t3_ns - t4_ns)), delay)
        self.exchanges += 1
        self.round_trip_ns = delay
        best = self._best
        if best is not None:
            apart = abs(new.offset_ns - best.offset_ns)
            if apart > self._bound(best, t4_ns) + 0.5 * delay + JUMP_NS or t4_ns < best.at_ns:
                self.steps += 1
                self._bins.clear()
        bins = self._bins
        if bins and t4_ns // BIN_NS == bins[-1].at_ns // BIN_NS:
            if delay < bins[-1].delay_ns:
                bins[-1] = new
        else:
            bins.append(new)
        while bins[0].at_ns < t4_ns - MEMORY_NS:
            bins.popleft()
        self._best = min(bins, key=lambda one: self._bound(one, t4_ns))

    def _bound(self, one: _Exchange, now_ns: int) -> float:
        return 0.5 * one.delay_ns + DRIFT * max(now_ns - one.at_ns, 0)
