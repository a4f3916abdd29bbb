"""Pairs two sensors with clocks and rates of their own: displacement interpolated at force stamps.

A force reading waits until positions before and after it are known, but never longer than a
bound; readings that come out of order are sorted as long as they come within a window. What could
not be paired is dropped and counted, so that the stream of samples shows a gap.
"""

from __future__ import annotations

import dataclasses
from bisect import bisect_right, insort
from typing import NamedTuple

JUMP_NS = 1_000_000_000
"""A stamp so far behind the newest of its sensor is no late message: the clock was set back."""

LONGEST_QUEUE = 10_000
"""Positions that are kept while no force comes."""


class Paired(NamedTuple):
    """A force reading with the displacement at its stamp."""

    stamp_ns: int
    sequence: int
    displacement_mm: float
    force_n: float


@dataclasses.dataclass
class PairingCounters:
    """What became of the readings that did not make a sample.

    Attributes:
        late: came after their place in the stream had passed.
        unpaired: forces without positions around them in time.
        resets: times the clock was set back.
    """

    late: int = 0
    unpaired: int = 0
    resets: int = 0


class Pairer:
    """Two streams of readings in, one stream of samples out, in the order of the stamps.

    Attributes:
        counters: what was dropped, and why.
    """

    def __init__(
        self, *, maximum_wait_ns: int, reorder_window_ns: int, maximum_gap_ns: int
    ) -> None:
        """Make a pairer.

        Args:
            maximum_wait_ns: how much newer forces may get before one that waits is dropped.
            reorder_window_ns: for how long every force waits for readings that come out of order.
            maximum_gap_ns: positions further apart than this are not interpolated.
        """
        self.maximum_wait_ns = maximum_wait_ns
        self.reorder_window_ns = reorder_window_ns
        self.maximum_gap_ns = maximum_gap_ns
        self.counters = PairingCounters()
        self._positions: list[tuple[int, float]] = []
        self._forces: list[tuple[int, float]] = []
        self._newest_position = self._newest_force = -(2**63)
        self._released = -(2**63)
        self._sequence = 0

    def add_position(self, stamp_ns: int, displacement_mm: float) -> list[Paired]:
        """Take in a displacement reading; return the samples that it completes."""
        if stamp_ns < self._newest_position - JUMP_NS:
            self.counters.resets += 1
            self.clear()
        self._newest_position = max(self._newest_position, stamp_ns)
        insort(self._positions, (stamp_ns, displacement_mm))
        return self._release()

    def add_force(self, stamp_ns: int, force_n: float) -> list[Paired]:
        """Take in a force reading; return the samples that are complete."""
        if stamp_ns < self._newest_force - JUMP_NS:
            self.counters.resets += 1
            self.clear()
        if stamp_ns <= self._released:
            self.counters.late += 1
            return []
        self._newest_force = max(self._newest_force, stamp_ns)
        insort(self._forces, (stamp_ns, force_n))
        return self._release()

    def skip(self, number: int) -> None:
        """Leave a gap in the numbers for forces that were left out before they came here."""
        self._sequence += number

    def clear(self) -> None:
        """Drop what waits: readings to come are of other sensors, or read otherwise."""
        self.counters.unpaired += len(self._forces)
        self._positions.clear()
        self._forces.clear()
        self._newest_position = self._newest_force = self._released = -(2**63)

    def _release(self) -> list[Paired]:
        """Return what is complete, oldest first."""
        result = []
        done = 0
        for stamp_ns, force_n in self._forces:
            # Each sensor's messages are sorted among themselves: the two may arrive in bursts.
            settled_ns = min(self._newest_force, self._newest_position) - self.reorder_window_ns
            expired = self._newest_force - stamp_ns > self.maximum_wait_ns
            if settled_ns < stamp_ns and not expired:
                break
            done += 1
            sequence, self._sequence = self._sequence, self._sequence + 1
            self._released = stamp_ns
            displacement = self._interpolate(stamp_ns)
            if displacement is None:
                self.counters.unpaired += 1
            else:
                result.append(Paired(stamp_ns, sequence, displacement, force_n))
        del self._forces[:done]
        self._forget_positions()
        return result

    def _interpolate(self, stamp_ns: int) -> float | None:
        """Return the displacement at a time, or None without positions around it."""
        positions = self._positions
        after = bisect_right(positions, stamp_ns, key=_stamp)
        if after == 0:
            return None
        earlier_ns, earlier = positions[after - 1]
        if earlier_ns == stamp_ns:
            return earlier
        if after == len(positions):
            return None
        later_ns, later = positions[after]
        if later_ns - earlier_ns > self.maximum_gap_ns:
            return None
        return earlier + (later - earlier) * ((stamp_ns - earlier_ns) / (later_ns - earlier_ns))

    def _forget_positions(self) -> None:
        """Keep what forces to come may still need: they are newer than the last one released."""
        keep_from = bisect_right(self._positions, self._released, key=_stamp) - 1
        keep_from = max(keep_from, len(self._positions) - LONGEST_QUEUE)
        if keep_from > 0:
            del self._positions[:keep_from]


def _stamp(reading: tuple[int, float]) -> int:
    return reading[0]
