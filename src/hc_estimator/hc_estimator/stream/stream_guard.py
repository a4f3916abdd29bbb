"""Tells the next sample of a stream from a stray one, a restarted publisher and a time jump.

A single sample out of place must neither reset the estimator nor move its clock, and a clock that
really jumped (a bag that loops, a corrected clock) must not leave it rejecting everything. So a
sample out of place is held until some more confirm it; held samples are then used, none is lost.
What was dropped is counted by its fault, so that a user can be told what is wrong with a stream
of which nothing can be used.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Sequence
from enum import Enum
from typing import NamedTuple

UNCONFIRMED_LATE = 100
"""A sample up to so many places and `late_ns` behind came late; it did not start a new stream."""

_SEQUENCE_SLACK = 2000
_LARGEST_RATE_PER_NS = 1e-5  # 10 kHz: a sequence cannot advance faster where no rate is known yet
_SURE_SLACK = 100
_SURE_FACTOR = 4.0
"""Where the rate is known: numbers may run ahead of the time by this much, for stamps jitter."""
_PERIOD_WEIGHT = 1.0 / 64.0
_UNCOUNTED = 20
"""So many more odd numbers than regular ones, at stamps in order, and the numbers are no count;
so many regular ones in a row, and they are one again."""


class StreamSample(NamedTuple):
    """One sample in the core's units."""

    stamp_ns: int
    sequence: int
    displacement_mm: float
    force_n: float


class Break(Enum):
    """What separates the samples from those before them."""

    NONE = "none"
    RESTARTED = "restarted"  # the numbering began anew while time went on
    TIME_JUMP = "time jump"  # the stamps jumped


@dataclasses.dataclass
class StreamFaults:
    """Samples that were out of place, by what was wrong with them.

    Attributes:
        zero_stamps: stamps that are zero, as of a driver that does not fill them in.
        repeated_stamps: one and the same stamp again and again, far from that of the stream.
        stamp_jumps: stamps far from that of the sample before.
        odd_numbers: numbers that do not follow the one before, at a stamp that does.
        largest_jump_ns: the largest of those jumps, either way.
    """

    zero_stamps: int = 0
    repeated_stamps: int = 0
    stamp_jumps: int = 0
    odd_numbers: int = 0
    largest_jump_ns: int = 0


class StreamGuard:
    """Decides, sample by sample, which ones belong to the stream.

    Attributes:
        lost: samples that the sequence numbers say never came.
        strays: samples that were out of place and not confirmed, and therefore dropped.
        faults: what was wrong with samples that were out of place.
        counted: whether the sequence numbers are a count; if not, stamps alone are judged.
        last_stamp_ns: stamp of the newest sample of the stream; None before the first.
        last_sequence: its sequence.
    """

    def __init__(
        self, *, maximum_gap_ns: int, late_ns: int = 100_000_000, confirmations: int = 5
    ) -> None:
        """Make a guard.

        Args:
            maximum_gap_ns: stamps further ahead than this are a jump, not a silent sensor.
            late_ns: stamps behind by less than this are late samples, not a jump.
            confirmations: samples in a row that make a jump or a restart believable.
        """
        self.maximum_gap_ns = maximum_gap_ns
        self.late_ns = late_ns
        self.confirmations = confirmations
        self.lost = 0
        self.strays = 0
        self.faults = StreamFaults()
        self.counted = True
        self.last_stamp_ns: int | None = None
        self.last_sequence = 0
        self._held: list[StreamSample] = []
        self._after_zero = 0  # left out on purpose after a number 0
        self._period_ns = 0.0  # of samples whose numbers follow; 0 as long as it is not known
        self._oddity = 0

    def forget(self) -> None:
        """Take the next sample as the first one; counters stay."""
        self.strays += len(self._held)
        self._held.clear()
        self.last_stamp_ns = None
        self.last_sequence = 0
        self._period_ns = 0.0

    def expect_gap(self, samples: int) -> None:
        """Hear that samples were left out on purpose: they are not lost.

        Where the last number was 0 the source may not count, and then its next one is 0 again:
        the next number says whether it does.
        """
        if self.last_sequence != 0:
            self.last_sequence += samples
        elif self.last_stamp_ns is not None:
            self._after_zero += samples

    def is_next(self, stamp_ns: int, sequence: int) -> bool:
        """Take a sample that plainly follows the last one.

        This is the path of nearly every sample. Where it returns False, ask `push`.

        Args:
            stamp_ns: stamp [ns].
            sequence: number of the sample; 0 throughout if the source does not count.

        Returns:
            True if the sample follows (and it is then the last one).
        """
        last = self.last_stamp_ns
        if last is None or self._held:
            return False
        elapsed = stamp_ns - last
        if not 0 < elapsed <= self.maximum_gap_ns:
            return False
        advance = sequence - self.last_sequence
        if advance == 1:
            period = self._period_ns
            self._period_ns = period + (elapsed - period) * _PERIOD_WEIGHT if period else elapsed
            if self._oddity:
                self._take_regular_number()
        elif not self.counted:
            self._oddity = _UNCOUNTED
        elif not (sequence == 0 and self.last_sequence == 0):
            if not self._can_advance(advance, elapsed):
                return False
            left_out, self._after_zero = self._after_zero, 0
            self.lost += max(0, advance - 1 - left_out)
        self.last_stamp_ns = stamp_ns
        self.last_sequence = sequence
        return True

    def push(self, sample: StreamSample) -> tuple[Sequence[StreamSample], Break]:
        """Judge a sample that `is_next` did not take.

        Args:
            sample: the sample.

        Returns:
            Samples to use now, in order (none while they are held), and what separates the first
            of them from the samples before.
        """
        if self.last_stamp_ns is None:
            self._take(sample)
            return (sample,), Break.NONE
        if sample.stamp_ns == 0 and self.last_stamp_ns == 0:
            self.faults.zero_stamps += 1
            self.strays += 1
            return (), Break.NONE
        if self._held:
            held, self._held = self._held, []
            if self.is_next(sample.stamp_ns, sample.sequence):
                self.strays += len(held)  # the stream goes on: what was held was foreign to it
                return (sample,), Break.NONE
            self._held = held
        elapsed = sample.stamp_ns - self.last_stamp_ns
        behind = self.last_sequence - sample.sequence
        near = -_SEQUENCE_SLACK <= behind <= UNCONFIRMED_LATE or not self.counted
        if -self.late_ns < elapsed <= 0 and near:
            # Repeated or late: the estimator itself rejects it and says why.
            if behind < 0 and self.counted:
                self.lost += -behind - 1
                self.last_sequence = sample.sequence
            return (sample,), Break.NONE
        self._note_fault(sample.stamp_ns, elapsed)
        if not self.counted and 0 < elapsed <= self.maximum_gap_ns:
            self.strays += len(self._held)
            self._held.clear()
            self._take(sample)
            return (sample,), Break.NONE
        return self._hold(sample)

    def _can_advance(self, advance: int, elapsed: int) -> bool:
        """Whether the numbers may have advanced so far in the time between two stamps."""
        if self._period_ns:
            return 0 < advance <= _SURE_SLACK + _SURE_FACTOR * elapsed / self._period_ns
        return 0 < advance <= _SEQUENCE_SLACK + elapsed * _LARGEST_RATE_PER_NS

    def _note_fault(self, stamp_ns: int, elapsed: int) -> None:
        faults = self.faults
        if stamp_ns == 0:
            faults.zero_stamps += 1
        elif self._held and stamp_ns == self._held[-1].stamp_ns:
            faults.repeated_stamps += 1
        elif -self.late_ns < elapsed <= self.maximum_gap_ns:
            faults.odd_numbers += 1
            self._oddity += 1
            if self._oddity >= _UNCOUNTED:
                self.counted = False
        else:
            faults.stamp_jumps += 1
            faults.largest_jump_ns = max(faults.largest_jump_ns, abs(elapsed))

    def _take_regular_number(self) -> None:
        self._oddity -= 1
        if self._oddity == 0:
            self.counted = True

    def _hold(self, sample: StreamSample) -> tuple[Sequence[StreamSample], Break]:
        assert self.last_stamp_ns is not None
        if self._held:
            previous = self._held[-1]
            elapsed = sample.stamp_ns - previous.stamp_ns
            advance = sample.sequence - previous.sequence
            follows = 0 < elapsed <= self.maximum_gap_ns and (
                sample.sequence == previous.sequence == 0
                or not self.counted
                or self._can_advance(advance, elapsed)
            )
            if not follows:
                self.strays += len(self._held)
                self._held.clear()
        self._held.append(sample)
        if len(self._held) < self.confirmations:
            return (), Break.NONE
        used, self._held = self._held, []
        elapsed = used[0].stamp_ns - self.last_stamp_ns
        in_time = -self.late_ns < elapsed <= self.maximum_gap_ns
        if self.counted:
            self.lost += sum(
                max(0, after.sequence - before.sequence - 1)
                for before, after in itertools.pairwise(used)
            )
        self._take(used[-1])
        return used, Break.RESTARTED if in_time else Break.TIME_JUMP

    def _take(self, sample: StreamSample) -> None:
        self._after_zero = 0
        self.last_stamp_ns = sample.stamp_ns
        self.last_sequence = sample.sequence
