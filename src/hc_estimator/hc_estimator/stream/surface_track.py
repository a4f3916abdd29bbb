"""Where a surface that moves was at the stamps of readings.

Poses of the surface come in a stream of their own, late and at a rate of their own. A reading is
held until the surface's pose at its stamp can be interpolated from the two around it, but no longer
than a bound: then the nearest pose counts, and the reading is counted as one without a pose.
"""

from __future__ import annotations

import math
from bisect import bisect_left, insort
from typing import NamedTuple

from hc_estimator.stream.contact_frame import Vector
from hc_estimator.stream.merger import JUMP_NS, LONGEST_QUEUE

LONGEST_TRACK = 2000
"""Poses that are kept, the newest: of 2 s at 1 kHz, of a minute at the 30 Hz of a camera."""


class SurfacePose(NamedTuple):
    """Where a surface is: a point [m], and the normal out of the tissue, of length 1."""

    stamp_ns: int
    point: Vector
    normal: Vector


class HeldReading(NamedTuple):
    """What a sensor read, before it is known where the surface was.

    Attributes:
        stamp_ns: when it was measured.
        arrival_ns: when it came.
        is_force: whether `vector` is a force [N]; otherwise the place of the tip [m].
        vector: in the base frame.
    """

    stamp_ns: int
    arrival_ns: int
    is_force: bool
    vector: Vector


class SurfaceTrack:
    """The newest poses of a surface, in the order of their stamps."""

    def __init__(self) -> None:
        self._poses: list[SurfacePose] = []

    def add(self, pose: SurfacePose) -> None:
        """Take in a pose; a clock that was set back starts the track anew."""
        poses = self._poses
        if poses and pose.stamp_ns < poses[-1].stamp_ns - JUMP_NS:
            poses.clear()
        if not poses or pose.stamp_ns > poses[-1].stamp_ns:
            poses.append(pose)
        else:
            place = bisect_left(poses, pose.stamp_ns, key=_stamp)
            if poses[place].stamp_ns != pose.stamp_ns:
                poses.insert(place, pose)
        if len(poses) > LONGEST_TRACK:
            del poses[0]

    def spans(self, stamp_ns: int) -> bool:
        """Whether there are poses at or before a stamp, and at or after it."""
        poses = self._poses
        return bool(poses) and poses[0].stamp_ns <= stamp_ns <= poses[-1].stamp_ns

    def reaches(self, stamp_ns: int) -> bool:
        """Whether there is a pose at or after a stamp."""
        return bool(self._poses) and self._poses[-1].stamp_ns >= stamp_ns

    def at(self, stamp_ns: int) -> SurfacePose | None:
        """Return the pose at a stamp, linear between two; at the ends the nearest; None of none."""
        poses = self._poses
        if not poses:
            return None
        after = bisect_left(poses, stamp_ns, key=_stamp)
        if after == 0:
            return poses[0]
        if after == len(poses):
            return poses[-1]
        return _between(poses[after - 1], poses[after], stamp_ns)


class SurfaceWait:
    """Holds readings until the surface's pose at their stamps is known.

    Attributes:
        maximum_wait_ns: how long a reading is held, both by the stamps and by the times of arrival.
        without_pose: readings that went on with the nearest pose.
        before_first: readings that were dropped, for no pose had ever come.
    """

    def __init__(self) -> None:
        self.maximum_wait_ns = 0
        self.without_pose = 0
        self.before_first = 0
        self._track = SurfaceTrack()
        self._held: list[HeldReading] = []
        self._newest_stamp_ns = self._newest_arrival_ns = -(2**63)

    def add_pose(self, pose: SurfacePose) -> None:
        """Take in a pose of the surface."""
        self._track.add(pose)

    def hold(self, reading: HeldReading) -> None:
        """Take in a reading; they go on in the order of their arrival."""
        if reading.stamp_ns < self._newest_stamp_ns - JUMP_NS:  # the clock was set back
            self._newest_stamp_ns = reading.stamp_ns
        insort(self._held, reading, key=_arrival)
        self._newest_stamp_ns = max(self._newest_stamp_ns, reading.stamp_ns)
        self._newest_arrival_ns = max(self._newest_arrival_ns, reading.arrival_ns)

    def clear(self) -> int:
        """Drop what is held; returns how many readings that were."""
        number = len(self._held)
        self._held.clear()
        return number

    def release(
        self, *, silent: bool, next_pose_ns: int | None
    ) -> list[tuple[HeldReading, SurfacePose]]:
        """Return what need not wait any more, each with the surface's pose at its stamp.

        Args:
            silent: whether the surface's poses have stopped coming: nothing waits for them then.
            next_pose_ns: when the oldest pose came that is still to be taken in; None without one.
        """
        result: list[tuple[HeldReading, SurfacePose]] = []
        done = 0
        for reading in self._held:
            left = len(self._held) - done
            if not (
                self._track.reaches(reading.stamp_ns)
                or silent
                or left > LONGEST_QUEUE
                or self._waited(reading, next_pose_ns)
            ):
                break
            done += 1
            pose = self._track.at(reading.stamp_ns)
            if pose is None:
                self.before_first += 1
                continue
            self.without_pose += not self._track.spans(reading.stamp_ns)
            result.append((reading, pose))
        del self._held[:done]
        return result

    @property
    def oldest_arrival_ns(self) -> int | None:
        """When the oldest reading came that is held; None without one."""
        return self._held[0].arrival_ns if self._held else None

    def _waited(self, reading: HeldReading, next_pose_ns: int | None) -> bool:
        wait_ns = self.maximum_wait_ns
        if next_pose_ns is not None and next_pose_ns <= reading.arrival_ns + wait_ns:
            return False  # this program is behind, not the surface
        return (
            self._newest_stamp_ns - reading.stamp_ns >= wait_ns
            and self._newest_arrival_ns - reading.arrival_ns >= wait_ns
        )


def _between(before: SurfacePose, after: SurfacePose, stamp_ns: int) -> SurfacePose:
    share = (stamp_ns - before.stamp_ns) / (after.stamp_ns - before.stamp_ns)
    x, y, z = (a + share * (b - a) for a, b in zip(before.normal, after.normal, strict=True))
    length = math.hypot(x, y, z)
    if length < 0.1:  # the one is nearly the opposite of the other: no turn lies between
        return before if share < 0.5 else after
    a, b, c = (p + share * (q - p) for p, q in zip(before.point, after.point, strict=True))
    return SurfacePose(stamp_ns, (a, b, c), (x / length, y / length, z / length))


def _stamp(pose: SurfacePose) -> int:
    return pose.stamp_ns


def _arrival(reading: HeldReading) -> int:
    return reading.arrival_ns
