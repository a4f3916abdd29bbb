"""Times of reception that go on evenly when the system clock is set.

A player spaces messages by their times of reception. A clock that is set (by hand, or by a first
contact with a time server) would tear a hole into a bag or fold it over itself. Header stamps and
times of publication are recorded as they are; only the times of reception are held steady, and
the bag's metadata says how often and by how much.
"""

from __future__ import annotations

import time
from collections.abc import Callable

SMALLEST_JUMP_NS = 10_000_000


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
        self._difference = wall() - monotonic()
        self._offset = 0
        self._before: list[int] = []  # offsets that messages of this batch may still need
        self._now = self._last_batch = wall()
        self.jumps_ns: list[int] = []

    def update(self) -> None:
        """Begin a batch of messages: look whether the clock was set since the last one."""
        self._last_batch = self._now
        self._before = []
        self._look()

    def _look(self) -> None:
        wall = self._wall()
        difference = wall - self._monotonic()
        jump = difference - self._difference
        if abs(jump) >= SMALLEST_JUMP_NS:
            self.jumps_ns.append(jump)
            self._before.append(self._offset)
            self._offset += jump
            self._difference = difference
        self._now = wall - self._offset

    def steady(self, received_ns: int) -> int:
        """Return a time of reception as if the clock had never been set.

        In the batch in which a jump is noticed some messages came before and some after it: each
        gets the correction that puts it nearer to now. A message from the future, or from before
        the last batch, makes it look again: the clock may have been set since the batch began.
        """
        steady = received_ns - self._offset
        if not self._last_batch <= steady <= self._now:
            self._look()
            candidates = [received_ns - offset for offset in (self._offset, *self._before)]
            return min(candidates, key=lambda time: abs(time - self._now))
        return steady
