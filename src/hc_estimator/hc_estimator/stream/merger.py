"""Brings the readings of two sensors, with rates and delays of their own, into one stream.

Every reading goes on at its own stamp, nothing is interpolated: a sample holds both readings where
the stamps are equal, otherwise one of the two. Samples come out in the order of their
stamps. A reading therefore waits for the other sensor as long as that may still bring an older
one, but never longer than a bound. What comes later is dropped and counted, and so are the
readings of a sensor that is alone: they say nothing of a tissue. At the start, and after a pause, a
displacement comes first: a force alone would be that of a tool whose place nobody knows.

What a reading means may depend on where the tool, or the surface, was at its stamp. By the time
that a sample comes out, the displacement readings around its stamp are there, and come along. The
poses of a surface that moves are a third stream, which readings wait for in the same way.
"""

from __future__ import annotations

import dataclasses
from bisect import bisect_left, insort
from typing import Any, NamedTuple

JUMP_NS = 1_000_000_000
"""A stamp so far behind the newest of its sensor is no late message: the clock was set back."""

TOLERANCE_NS = 1_000
"""Stamps that differ by no more are one: drivers round them."""

MAXIMUM_WAIT_S = 0.05
"""The bound on a reading's wait, where nobody says another."""

TRANSPORT_S = 0.02
"""From a sensor to the node, on a busy machine."""

LONGEST_QUEUE = 10_000
"""Readings that wait at most, whatever the stamps say."""

_NEVER = -(2**63)


class Reading(NamedTuple):
    """What a sensor read.

    Attributes:
        stamp_ns: when it was measured.
        value: what was given to the merger: a number, a vector, a pose.
        arrival_ns: when it came.
    """

    stamp_ns: int
    value: Any
    arrival_ns: int


def needed_wait_s(delay_s: float, period_s: float) -> float:
    """Return how long a reading has to wait for the other sensor.

    Args:
        delay_s: by how much one sensor's time offset differs from the other's [s].
        period_s: of the slower sensor [s].
    """
    return abs(delay_s) + 2.0 * period_s + TRANSPORT_S


class Around(NamedTuple):
    """The readings of a stream around a stamp: twice the one at that stamp, if there is one.

    Attributes:
        before: the last one before it; None without one.
        after: the first one after it; None if none has come, however long it was waited for.
    """

    before: Reading | None
    after: Reading | None

    @property
    def is_complete(self) -> bool:
        """Whether there are readings on both sides."""
        return self.before is not None and self.after is not None


class Merged(NamedTuple):
    """What the sensors read at one stamp, as it was given; None for a sensor without a reading.

    Attributes:
        stamp_ns: the stamp.
        sequence: its number.
        displacement: reading of the displacement.
        force: reading of the force.
        displacements: readings of the displacement around the stamp.
        surfaces: poses of the surface around the stamp.
    """

    stamp_ns: int
    sequence: int
    displacement: Any
    force: Any
    displacements: Around
    surfaces: Around


@dataclasses.dataclass
class MergerCounters:
    """What became of the readings that are in no sample.

    Attributes:
        late: came after their place in the stream had passed, or repeated a stamp.
        unpaired: the other sensor had no reading near them in time, or they were forces before the
            first displacement.
        resets: times the clock was set back.
    """

    late: int = 0
    unpaired: int = 0
    resets: int = 0


class _Stream:
    """Readings of one sensor that wait, oldest first, and the last one that was taken out."""

    __slots__ = ("last", "newest_arrival_ns", "newest_ns", "waiting")

    def __init__(self) -> None:
        self.waiting: list[Reading] = []
        self.forget()

    def forget(self) -> None:
        self.waiting.clear()
        self.newest_ns = self.newest_arrival_ns = _NEVER
        self.last: Reading | None = None

    def insert(self, reading: Reading) -> bool:
        """Put a reading in its place; False if there is one with its stamp."""
        waiting = self.waiting
        if not waiting or reading.stamp_ns > waiting[-1].stamp_ns:
            waiting.append(reading)
        else:
            place = bisect_left(waiting, reading.stamp_ns, key=_stamp)
            if waiting[place].stamp_ns == reading.stamp_ns:
                return False
            waiting.insert(place, reading)
        self.newest_ns = max(self.newest_ns, reading.stamp_ns)
        self.newest_arrival_ns = max(self.newest_arrival_ns, reading.arrival_ns)
        return True

    def take(self) -> Any:
        """Take out the oldest."""
        self.last = self.waiting.pop(0)
        return self.last.value

    def is_near(self, stamp_ns: int, gap_ns: int) -> bool:
        """Whether there is a reading within a time before or after."""
        if self.last is not None and abs(stamp_ns - self.last.stamp_ns) <= gap_ns:
            return True
        return bool(self.waiting) and self.waiting[0].stamp_ns - stamp_ns <= gap_ns

    def around(self, stamp_ns: int) -> Around:
        """Return the readings around a stamp; those that wait lie behind it."""
        before, after = self.last, self.waiting[0] if self.waiting else None
        if before is not None and before.stamp_ns > stamp_ns:  # the others' clock was set back
            return Around(None, before)
        if before is not None and stamp_ns - before.stamp_ns <= TOLERANCE_NS:
            return Around(before, before)
        return Around(before, after)


class Merger:
    """Two streams of readings in, one stream of samples out, in the order of the stamps.

    Attributes:
        counters: what was dropped, and why.
        surface_silence_ns: once no pose of the surface has come for so long, nothing waits for one.
    """

    def __init__(
        self,
        *,
        maximum_wait_ns: int,
        reorder_window_ns: int,
        maximum_gap_ns: int,
        with_surface: bool = False,
    ) -> None:
        """Make a merger.

        Args:
            maximum_wait_ns: how long a reading waits for the other sensor, both by the stamps and
                by the times of arrival: a recording that is played slowly has its other reading
                come long after, a network that stalls has it come at once, yet nothing is late.
            reorder_window_ns: for how long every reading waits for those of either sensor that
                come out of order.
            maximum_gap_ns: a reading further than this from any of the other sensor is dropped.
            with_surface: readings wait for the poses of a surface as for the other sensor.
        """
        self.maximum_wait_ns = maximum_wait_ns
        self.reorder_window_ns = reorder_window_ns
        self.maximum_gap_ns = maximum_gap_ns
        self.surface_silence_ns = 0
        self.counters = MergerCounters()
        self._displacement = _Stream()
        self._force = _Stream()
        self._surface = _Stream()
        self._awaited = (self._displacement, self._force, self._surface)[: 2 + with_surface]
        self._arrived: list[tuple[_Stream, Reading]] = []
        self._released_ns = _NEVER
        self._sequence = 0

    def add_displacement(
        self, stamp_ns: int, value: Any, arrival_ns: int, complete_ns: int | None = None
    ) -> list[Merged]:
        """Take in a displacement reading; return the samples that wait for nothing any more.

        Args:
            stamp_ns: when it was measured.
            value: the reading, as it is to come out.
            arrival_ns: when it came.
            complete_ns: what did not come before this must wait, for messages that came before are
                still to be handed over: what is late does not depend on how far a busy program
                has got with either sensor. None if no message waits.
        """
        reading = Reading(stamp_ns, value, arrival_ns)
        return self._take_in(self._displacement, reading, complete_ns)

    def add_force(
        self, stamp_ns: int, value: Any, arrival_ns: int, complete_ns: int | None = None
    ) -> list[Merged]:
        """Take in a force reading; as `add_displacement`."""
        return self._take_in(self._force, Reading(stamp_ns, value, arrival_ns), complete_ns)

    def add_surface(
        self, stamp_ns: int, value: Any, arrival_ns: int, complete_ns: int | None = None
    ) -> list[Merged]:
        """Take in a pose of the surface; as `add_displacement`."""
        return self._take_in(self._surface, Reading(stamp_ns, value, arrival_ns), complete_ns)

    def flush(self) -> list[Merged]:
        """Return what waits: a recording is over."""
        arrived, self._arrived = self._arrived, []
        return [s for sensor, one in arrived for s in self._add(sensor, one)] + self._release(None)

    def skip(self, number: int) -> None:
        """Leave a gap in the numbers for readings that were left out before they came here."""
        self._sequence += number

    def clear(self) -> None:
        """Drop what waits: readings to come are of other sensors, or read otherwise.

        The surface is where it was.
        """
        surface = self._surface
        self.counters.unpaired += sum(stream is not surface for stream, _ in self._arrived)
        self._arrived = [one for one in self._arrived if one[0] is surface]
        self._start_over()

    def _start_over(self) -> None:
        for sensor in (self._displacement, self._force):
            self.counters.unpaired += len(sensor.waiting)
            sensor.forget()
        self._released_ns = _NEVER

    def _take_in(self, sensor: _Stream, reading: Reading, complete_ns: int | None) -> list[Merged]:
        """Take in, in the order of their arrival, what need not wait for other messages."""
        arrived = self._arrived
        if not arrived and (complete_ns is None or reading.arrival_ns < complete_ns):
            return self._add(sensor, reading)  # nearly always
        insort(arrived, (sensor, reading), key=_arrival)
        result: list[Merged] = []
        done = 0
        for of, one in arrived:
            if complete_ns is not None and one.arrival_ns >= complete_ns:
                break
            done += 1
            result += self._add(of, one)
        del arrived[:done]
        return result

    def _add(self, sensor: _Stream, reading: Reading) -> list[Merged]:
        if sensor is self._surface:
            return self._add_pose(reading)
        if reading.stamp_ns < sensor.newest_ns - JUMP_NS:
            self.counters.resets += 1
            self._start_over()
        if reading.stamp_ns <= self._released_ns or not sensor.insert(reading):
            self.counters.late += 1
            return []
        return self._release(reading.arrival_ns)

    def _add_pose(self, reading: Reading) -> list[Merged]:
        surface = self._surface
        if reading.stamp_ns < surface.newest_ns - JUMP_NS:  # its clock was set back
            surface.forget()
        if surface.last is None or reading.stamp_ns > surface.last.stamp_ns:
            surface.insert(reading)
        if len(surface.waiting) > LONGEST_QUEUE:
            surface.take()
        return self._release(reading.arrival_ns)

    def _release(self, now_ns: int | None) -> list[Merged]:
        """Return what need not wait any more, oldest first; all of it without a time."""
        result: list[Merged] = []
        displacement, force, surface = self._displacement, self._force, self._surface
        while displacement.waiting or force.waiting:
            first, other = displacement, force
            if not first.waiting or (
                other.waiting and other.waiting[0].stamp_ns < first.waiting[0].stamp_ns
            ):
                first, other = other, first
            oldest = first.waiting[0]
            if now_ns is not None and not self._may_go(first, other, oldest, now_ns):
                break
            stamp_ns = oldest.stamp_ns
            if stamp_ns <= self._released_ns:  # within the tolerance of the one before
                first.take()
                self.counters.late += 1
                continue
            near = other.is_near(stamp_ns, self.maximum_gap_ns)
            values: dict[_Stream, Any] = {first: first.take()}
            if other.waiting and other.waiting[0].stamp_ns - stamp_ns <= TOLERANCE_NS:
                stamp_ns = other.waiting[0].stamp_ns
                values[other] = other.take()
            sequence, self._sequence = self._sequence, self._sequence + 1
            begun = stamp_ns - self._released_ns <= self.maximum_gap_ns
            if not (near and (begun or displacement in values)):
                self.counters.unpaired += len(values)
                continue
            self._released_ns = stamp_ns
            while surface.waiting and surface.waiting[0].stamp_ns <= stamp_ns:
                surface.take()
            result.append(
                Merged(
                    stamp_ns,
                    sequence,
                    values.get(displacement),
                    values.get(force),
                    displacement.around(stamp_ns),
                    surface.around(stamp_ns),
                )
            )
        return result

    def _may_go(self, first: _Stream, other: _Stream, oldest: Reading, now_ns: int) -> bool:
        """Whether nothing older can come, or the wait for it is over."""
        settled_ns = oldest.stamp_ns + self.reorder_window_ns
        if all(
            stream.newest_ns >= settled_ns or (stream is self._surface and self._is_silent(now_ns))
            for stream in self._awaited
        ):
            return True
        wait_ns = self.maximum_wait_ns
        newest_ns = max(first.newest_ns, other.newest_ns)
        if newest_ns - oldest.stamp_ns >= wait_ns and now_ns - oldest.arrival_ns >= wait_ns:
            return True
        return len(first.waiting) + len(other.waiting) > LONGEST_QUEUE

    def _is_silent(self, now_ns: int) -> bool:
        """Whether the surface has been known, and no pose has come for long."""
        came_ns = self._surface.newest_arrival_ns
        return came_ns != _NEVER and now_ns - came_ns > self.surface_silence_ns


def _stamp(reading: Reading) -> int:
    return reading.stamp_ns


def _arrival(arrived: tuple[_Stream, Reading]) -> int:
    return arrived[1].arrival_ns
