"""When a sensor measured that reads at an even rate, but whose readings are stamped on arrival.

A driver stamps what it gets: eight readings of a packet within 20 us, the sixteen of a USB
adapter's latency at once, each one later by what a network took. As times of measurement such
stamps are wrong by milliseconds, and a law is bent to fit them. No reading arrives before it is
measured, and every so often one arrives with hardly a delay: over the count of readings the times
of measurement are the line through the earliest arrivals (Paxson 1998; Zhang, Liu and Xia 2002;
here through that of each quarter of a second, by Theil and Sen). What all of them are late by
cannot be seen; it is a delay of the channel like any other.
"""

from __future__ import annotations

import math
from collections import deque
from typing import Any

import numpy as np
from numpy.typing import NDArray

MEASURED, ARRIVAL = "measured", "arrival"
"""What stamps say: when a reading was measured, or when it arrived (`input.force.stamps`)."""
FEWEST, SHORTEST_NS = 64, 500_000_000
"""Readings, and their time, before a rate is known."""
BLOCK, BLOCK_NS = 32, 250_000_000
"""Readings, and their time, of which the earliest counts."""
BLOCKS = 40
NEXT = 4
"""Blocks up to which those are apart that say the first rate: some readings may have been lost."""
LONGEST_NS = 1_000_000_000
"""What is later than this was not on its way for so long: the sensor was away."""
MISTAKEN_NS = 300_000_000
"""Within this a loss shows to have been none."""
WRONG, AHEAD_NS = 5, 60_000_000_000
"""Stamps in a row so far ahead, or a second back, after which it is another clock."""
SLIPS, SLIPS_BLOCKS = (-0.02, 0.05), 8
"""Share of the readings by which the count was off in so many blocks in a row: another rate. It is
never too high but by mistake, and too low where readings are lost."""
REGULAR, MULTIPLE = 0.9, 0.2
"""Share of the steps that are multiples of the usual one, to so much of it, where readings come one
by one and some are lost."""
USUAL = 0.98
"""Share of the readings that are late by no more than is usual."""
IN_TIME = 0.5
"""Of a period, by which a reading in time is late at most."""
FALL, BUSY_NS = 2.0, 100_000_000
"""Times the usual span, by which a reading is less late than one before where a busy machine had
held that up; and for how long thereafter readings that are late may be late for that."""
LONG_NS, LONG = 5_000_000, 3.0
"""Beyond the usual span, and in periods: so long a loss is as likely to be a machine that is busy;
it takes more readings to show, and those late by no more apart than is usual."""
HELD_NS = 40_000_000
"""For so long readings wait until it shows what they are: then they are late, and none was lost.
Those of the other channel wait for 50 ms."""

Timed = list[tuple[int, Any]]
"""Times of measurement [ns] with what was read."""


class _Run:
    """Readings in a row that are late."""

    __slots__ = ("begun", "least", "most", "number")

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """Begin with the next one."""
        self.number, self.begun, self.least, self.most = 0, 0.0, math.inf, -math.inf

    def add(self, arrival: float, late: float) -> None:
        """Take the next one."""
        if self.number == 0:
            self.begun = arrival
        self.number += 1
        self.least = min(self.least, late)
        self.most = max(self.most, late)

    def add_alike(self, arrival: float, late: float, within: float) -> None:
        """Take the next one; begin anew with it if it would be further from another than that."""
        if max(self.most, late) - min(self.least, late) > within:
            self.forget()
        self.add(arrival, late)

    def is_loss(self, fewest: float, arrival: float, period: float) -> bool:
        """Whether they stay late: enough of them, which did not come at once as after a stall."""
        took = arrival - self.begun
        return 2 <= self.number >= fewest and took >= 0.5 * (self.number - 1) * period


class ArrivalClock:
    """Turns stamps of arrival of one sensor, one after the other, into times of measurement.

    Attributes:
        mistaken: readings that were counted as lost, and were not: those before them got times
            that are too late by so many periods, and those after them may lie before these.
    """

    def __init__(self) -> None:
        """Begin without a rate."""
        self.mistaken = 0
        self.forget()

    def forget(self) -> None:
        """Know nothing of the sensor's rate; readings that wait are given up."""
        self._origin_ns = 0
        self._period = math.nan  # [ns]
        self._waiting: list[tuple[float, float, Any]] = []  # arrival, count and what was read
        self._before: list[float] = []  # arrivals of the block before [ns]
        self._wrong = 0
        self.missed: tuple[Any, int, float] | None = None
        """What the latest reading said was lost, less what was not: from which reading on, how
        many, and the period of each [ns]."""

    def take(self, arrival_ns: int, reading: Any) -> Timed:
        """Take a reading; return those whose time of measurement is known now, in order.

        The first half second waits until the rate is known, and what comes later than usual until
        it shows whether readings before it were lost or only late.

        Args:
            arrival_ns: when it arrived [ns].
            reading: anything.
        """
        self.missed = None
        if math.isnan(self._period):
            return self._wait(arrival_ns, reading)
        arrival = float(arrival_ns - self._origin_ns)
        late = arrival - self._line(self._count + 1.0)
        if not -LONGEST_NS < late < AHEAD_NS:
            self._wrong += 1
            timed = [*self.flush(), (arrival_ns, reading)]
            if self._wrong >= WRONG:
                self.forget()
            return timed
        self._wrong = 0
        self._count += 1.0
        late -= self._slip(arrival, late, reading)
        waits = 0.0 <= arrival - self._far_since < HELD_NS
        timed = [] if waits else self.flush()
        self._add_to_block(arrival, late)
        return timed

    def flush(self) -> Timed:
        """Return the readings that wait, as well as their times are known."""
        timed = [
            (self._origin_ns + round(arrival - self._lateness(arrival, count)), reading)
            for arrival, count, reading in self._waiting
        ]
        self._waiting.clear()
        return timed

    def _lateness(self, arrival: float, count: float) -> float:
        if math.isnan(self._period):
            return 0.0
        return max(arrival - float(self._line(count)), 0.0)

    def _wait(self, arrival_ns: int, reading: Any) -> Timed:
        """Take one of the first readings."""
        waiting, given_up = self._waiting, []
        if waiting:
            step = arrival_ns - self._origin_ns - waiting[-1][0]
            if not -LONGEST_NS < step < LONGEST_NS:
                given_up = self.flush()
        if not waiting:
            self._origin_ns = arrival_ns
        arrival = float(arrival_ns - self._origin_ns)
        waiting.append((arrival, math.nan, reading))
        if len(waiting) < FEWEST or arrival < SHORTEST_NS:
            return given_up
        counts = self._learn([arrival for arrival, _count, _reading in waiting])
        self._waiting = [
            (arrival, float(count), one)
            for (arrival, _count, one), count in zip(waiting, counts, strict=True)
        ]
        return given_up + self.flush()

    def _learn(self, arrivals: list[float]) -> NDArray[np.float64]:
        """Learn the rate from readings in a row, the last of which is the latest.

        Returns:
            Their counts.
        """
        times = np.maximum.accumulate(arrivals)
        steps = np.diff(times)
        counts = np.arange(len(times), dtype=np.float64)
        usual = float(np.median(steps))
        if usual > 0.5 * float(np.mean(steps)):
            passed = np.maximum(np.round(steps / usual), 1.0)
            if np.mean(np.abs(steps - usual * passed) < MULTIPLE * usual) > REGULAR:
                counts[1:] = np.cumsum(passed)
        self._period = max(float(times[-1] - times[0]) / float(counts[-1]), 1.0)
        self._earliest: deque[tuple[float, float]] = deque(maxlen=BLOCKS)  # count, arrival
        spans = []
        for begin in range(0, len(times) - BLOCK // 2, BLOCK):
            block = slice(begin, begin + BLOCK)
            late = times[block] - self._period * counts[block]
            least = int(np.argmin(late))
            self._earliest.append((float(counts[block][least]), float(times[block][least])))
            spans.append(float(np.quantile(late - late[least], USUAL)))
        self._spans: deque[float] = deque([float(np.median(spans))], maxlen=BLOCKS)
        self._count = float(counts[-1])
        self._fit(NEXT)
        in_time = np.flatnonzero(times - self._line(counts) <= IN_TIME * self._period)
        usual_run = int(np.max(np.diff(in_time, prepend=-1, append=len(times)))) - 1
        self._runs = deque([usual_run], maxlen=BLOCKS)  # longest of late readings in a block
        self._slipping = self._since_in_time = 0
        self._begin_block()
        self._begin_watch()
        return counts

    def _block_size(self) -> int:
        return max(BLOCK, math.ceil(BLOCK_NS / self._period))

    def _begin_block(self) -> None:
        self._arrivals: list[float] = []
        self._lates: list[float] = []
        self._least = (math.inf, 0.0, 0.0)  # how late; count and arrival of the earliest
        self._longest = self._slipped = 0

    def _begin_watch(self) -> None:
        self._late_ones, self._far_ones, self._alike_ones = _Run(), _Run(), _Run()
        self._far_since = math.inf  # when the first of those came that are far late now [ns]
        self._busy_until = -math.inf  # the machine, as what came sooner than others shows [ns]

    def _line(self, count: Any) -> Any:
        return self._offset + self._period * count

    def _slip(self, arrival: float, late: float, reading: Any) -> float:
        """Let a reading wait, and correct the count where some were lost before.

        Returns:
            By how much the line moved [ns].

        Those after a loss stay late. Those that were held up come at once, a busy machine takes
        each late by a time of its own, and what arrives before it was measured says that the count
        is too high.
        """
        period, missed, since = self._period, 0, -math.inf
        self._since_in_time += 1
        self._waiting.append((arrival, self._count, reading))
        if late < -IN_TIME * period or late > LONGEST_NS:
            missed = round(late / period)
            self._longest = max(self._longest, self._since_in_time)  # none had been lost
        elif late <= IN_TIME * period:
            self._longest = max(self._longest, self._late_ones.number)
            self._since_in_time = 0
            self._begin_watch()
        else:
            missed, since = self._lost(arrival, late)
        if missed == 0:
            return 0.0
        first = next(k for k, (came, _, _) in enumerate(self._waiting) if came >= since)
        self._waiting[first:] = [
            (came, count + missed, one) for came, count, one in self._waiting[first:]
        ]
        self.missed = (self._waiting[first][2], missed, period)
        self._count += missed
        self._slipped += missed
        self.mistaken += max(-missed, 0)
        self._begin_watch()
        if missed > 0:
            self._lates.clear()
            self._least = (math.inf, 0.0, 0.0)
        return missed * period

    def _lost(self, arrival: float, late: float) -> tuple[int, float]:
        """Say of a reading that is late whether some were lost.

        Returns:
            How many, and when the first came of those after them [ns].
        """
        period, span = self._period, self._span
        within = span + IN_TIME * period
        late_ones, far_ones, alike_ones = self._late_ones, self._far_ones, self._alike_ones
        late_ones.add(arrival, late)
        if late <= within:
            self._far_since = math.inf
            far_ones.forget()
            alike_ones.forget()
        else:
            self._far_since = min(self._far_since, arrival)
            far_ones.add(arrival, late)
            alike_ones.add_alike(arrival, late, within)
        if late_ones.most - late > FALL * within:
            self._busy_until = arrival + BUSY_NS
            late_ones.forget()
            far_ones.forget()
        fewest = span / period + 1.0
        if alike_ones.number and alike_ones.least > span + max(LONG_NS, LONG * period):
            if alike_ones.is_loss(2.0 * fewest + 1.0, arrival, period):
                return round(alike_ones.least / period), alike_ones.begun
        elif arrival >= self._busy_until:
            if far_ones.is_loss(fewest, arrival, period):
                return round(far_ones.least / period), far_ones.begun
            usual_run = max(self._longest, *self._runs)
            if late_ones.is_loss(3.0 * usual_run + 8.0, arrival, period):
                return round(late_ones.least / period), late_ones.begun
        return 0, arrival

    def _add_to_block(self, arrival: float, late: float) -> None:
        """Let a reading count; at the end of its block the line is fitted anew."""
        self._arrivals.append(arrival)
        self._lates.append(late)
        if late < self._least[0]:
            self._least = (late, self._count, arrival)
        if len(self._arrivals) < self._block_size():
            return
        slipped = self._slipped / len(self._arrivals)
        self._slipping = 0 if SLIPS[0] <= slipped <= SLIPS[1] else self._slipping + 1
        if self._slipping >= SLIPS_BLOCKS and not self._waiting:
            self._learn(self._before + self._arrivals)
            self._before = []
            return
        while self._earliest and self._earliest[-1][0] >= self._least[1]:
            self._earliest.pop()  # the count was too high
        self._earliest.append(self._least[1:])
        self._spans.append(float(np.quantile(self._lates, USUAL)))
        self._runs.append(self._longest)
        self._before = self._arrivals
        self._fit()
        self._begin_block()

    def _fit(self, apart: int = BLOCKS) -> None:
        """Lay the line through the earliest readings of the blocks.

        Args:
            apart: blocks up to which those may be apart that say the rate.
        """
        counts, times = np.array(self._earliest).T
        if len(counts) > 1:
            before, after = np.triu_indices(len(counts), 1)
            near = after - before <= apart
            before, after = before[near], after[near]
            slopes = (times[after] - times[before]) / (counts[after] - counts[before])
            self._period = max(float(np.median(slopes)), 1.0)
        self._offset = float(np.median(times - self._period * counts))
        self._span = float(np.median(self._spans))


def measured_stamps(arrivals_ns: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return when the readings of a recording were measured [ns], shape (n,).

    A machine that is busy for a tenth of a second looks as if readings had been lost, until those
    that come next are too early for that; in a recording the ones between are put right.

    Args:
        arrivals_ns: when they arrived [ns], shape (n,), in the order in which they came.
    """
    clock, measured_ns = ArrivalClock(), arrivals_ns.copy()
    lost: list[tuple[int, int]] = []  # from which reading on, and how many
    mistaken: list[tuple[int, int, float]] = []  # from one to another, and for how long [ns]
    for k, arrival_ns in enumerate(arrivals_ns.tolist()):
        for stamp, number in clock.take(arrival_ns, k):
            measured_ns[number] = stamp
        if clock.missed is None:
            continue
        first, missed, period_ns = clock.missed
        if missed > 0:
            lost.append((first, missed))
        while missed < 0 and lost and arrival_ns - arrivals_ns[lost[-1][0]] < MISTAKEN_NS:
            begun, number = lost.pop()
            some = min(number, -missed)
            mistaken.append((begun, first, some * period_ns))
            if some < number:
                lost.append((begun, number - some))
            missed += some
    for stamp, number in clock.flush():
        measured_ns[number] = stamp
    for begun, end, time_ns in mistaken:
        measured_ns[begun:end] -= round(time_ns)
    return measured_ns
