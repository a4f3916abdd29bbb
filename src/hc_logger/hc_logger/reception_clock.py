"""Times of reception that go on evenly when the system clock is set.

A player spaces messages by their times of reception. A clock that is set (by hand, or by a first
contact with a time server) would tear a hole into a bag or fold it over itself. Header stamps and
times of publication are recorded as they are; only the times of reception are held steady, and
the bag's metadata says how often and by how much.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

SMALLEST_JUMP_NS = 10_000_000
LONGEST_WAIT_NS = 30_000_000_000
"""A message may have waited for so long, if the recorder stood still; longer is no time of it."""
_READINGS = 5
_CLOSE_NS = 1_000_000
"""Readings of both clocks that are further apart are taken again: the process was held up."""


class ReceptionClock:
    """Corrects times of reception for jumps of the system clock.

    Attributes:
        jumps_ns: each jump so far.
    """

    def __init__(
        self,
        wall: Callable[[], int] = time.time_ns,
        monotonic: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        """Start with the system clock as it is.

        Args:
            wall: the system clock in ns.
            monotonic: a clock that nobody sets, in ns.
        """
        self._wall = wall
        self._monotonic = monotonic
        self._now, self._difference = self._read()
        self._offset = 0
        self._before: list[int] = []  # offsets that messages of this batch may still need
        self._older: list[tuple[int, int]] = []  # the same, longer ago: until when, offset
        self._last_batch = self._now
        self.jumps_ns: list[int] = []

    def update(self) -> None:
        """Begin a batch of messages: look whether the clock was set since the last one."""
        self._last_batch = self._now
        self._older += [(self._now + LONGEST_WAIT_NS, offset) for offset in self._before]
        self._before = []
        self._look()
        self._older = [(until, offset) for until, offset in self._older if until > self._now]

    def _read(self) -> tuple[int, int]:
        """Return the system clock, and by how much it is ahead of the other one [ns]."""
        best: tuple[int, int, int] | None = None
        for _ in range(_READINGS):
            before, wall, after = self._monotonic(), self._wall(), self._monotonic()
            if best is None or after - before < best[0]:
                best = (after - before, wall, wall - before)
            if after - before < _CLOSE_NS:
                break
        assert best is not None
        return best[1:]

    def _look(self) -> None:
        wall, difference = self._read()
        jump = difference - self._difference
        if abs(jump) >= SMALLEST_JUMP_NS:
            self.jumps_ns.append(jump)
            self._before.append(self._offset)
            self._offset += jump
            self._difference = difference
        self._now = wall - self._offset

    def steady_all(self, received_ns: Sequence[int]) -> list[int]:
        """Return what `steady` does for each; at once where none is in doubt."""
        if max(received_ns) - self._offset > self._now:
            self._look()  # some came since this batch began
        earliest, latest = self._last_batch + self._offset, self._now + self._offset
        if earliest <= min(received_ns) and max(received_ns) <= latest:
            return [time - self._offset for time in received_ns]
        return [self.steady(time) for time in received_ns]

    def steady(self, received_ns: int) -> int:
        """Return a time of reception as if the clock had never been set.

        In the batch in which a jump is noticed some messages came before and some after it: each
        gets the correction that puts it nearer to now. A message from the future, or from before
        the last batch, makes it look again: the clock may have been set since the batch began.

        After the recorder stood still a message may come from before an older jump; or the clock
        was set and set back meanwhile, so that no correction fits: it was received by now, then.
        """
        steady = received_ns - self._offset
        if self._last_batch <= steady <= self._now:
            return steady
        self._look()
        for offsets in ((self._offset, *self._before), tuple(o for _, o in self._older)):
            times = [received_ns - offset for offset in offsets]
            nearest = min(times, key=lambda time: abs(time - self._now), default=0)
            if self._now - LONGEST_WAIT_NS <= nearest <= self._now + SMALLEST_JUMP_NS:
                return nearest
        return self._now
