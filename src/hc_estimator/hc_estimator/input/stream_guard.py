"""Tells the next sample of a stream from a stray one, a restarted publisher and a time jump.

A single sample out of place must neither reset the estimator nor move its clock, and a clock that
really jumped (a bag that loops, a corrected clock) must not leave it rejecting everything. So a
sample out of place is held until some more confirm it; held samples are then used, none is lost.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from enum import Enum
from typing import NamedTuple

UNCONFIRMED_LATE = 100
"""A sample up to so many places and `late_ns` behind came late; it did not start a new stream."""

_SEQUENCE_SLACK = 2000
_LARGEST_RATE_PER_NS = 1e-5  # 10 kHz: a sequence cannot advance faster


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


class StreamGuard:
    """Decides, sample by sample, which ones belong to the stream.

    Attributes:
        lost: samples that the sequence numbers say never came.
        strays: samples that were out of place and not confirmed, and therefore dropped.
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
        self.last_stamp_ns: int | None = None
        self.last_sequence = 0
        self._held: list[StreamSample] = []

    def forget(self) -> None:
        """Take the next sample as the first one; counters stay."""
        self.strays += len(self._held)
        self._held.clear()
        self.last_stamp_ns = None
        self.last_sequence = 0

    def expect_gap(self, samples: int) -> None:
        """Hear that samples were left out on purpose: they are not lost."""
        if self.last_stamp_ns is not None:
            self.last_sequence += samples

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
        advance = sequence - self.last_sequence
        if advance != 1:
            if sequence == 0 and self.last_sequence == 0:
                advance = 1  # an uncounted stream
            elif not 0 < advance <= _SEQUENCE_SLACK + elapsed * _LARGEST_RATE_PER_NS:
                return False
        if not 0 < elapsed <= self.maximum_gap_ns:
            return False
        self.lost += advance - 1
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
        if self._held:
            held, self._held = self._held, []
            if self.is_next(sample.stamp_ns, sample.sequence):
                self.strays += len(held)  # the stream goes on: what was held was foreign to it
                return (sample,), Break.NONE
            self._held = held
        elapsed = sample.stamp_ns - self.last_stamp_ns
        behind = self.last_sequence - sample.sequence
        if -self.late_ns < elapsed <= 0 and -_SEQUENCE_SLACK <= behind <= UNCONFIRMED_LATE:
            # Repeated or late: the estimator itself rejects it and says why.
            if behind < 0:
                self.lost += -behind - 1
                self.last_sequence = sample.sequence
            return (sample,), Break.NONE
        return self._hold(sample)

    def _hold(self, sample: StreamSample) -> tuple[Sequence[StreamSample], Break]:
        assert self.last_stamp_ns is not None
        if self._held:
            previous = self._held[-1]
            follows = 0 < sample.stamp_ns - previous.stamp_ns <= self.maximum_gap_ns and (
                sample.sequence > previous.sequence or sample.sequence == previous.sequence == 0
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
        self.lost += sum(
            max(0, after.sequence - before.sequence - 1)
            for before, after in itertools.pairwise(used)
        )
        self._take(used[-1])
        return used, Break.RESTARTED if in_time else Break.TIME_JUMP

    def _take(self, sample: StreamSample) -> None:
        self.last_stamp_ns = sample.stamp_ns
        self.last_sequence = sample.sequence
