"""A surface that moves: its pose at the stamps of readings, and readings that wait for it."""

import math

import pytest

from hc_estimator.stream.surface_track import (
    LONGEST_TRACK,
    HeldReading,
    SurfacePose,
    SurfaceTrack,
    SurfaceWait,
)

MS = 1_000_000
UP = (0.0, 0.0, 1.0)


def pose(stamp_ms, height=0.0, normal=UP):
    return SurfacePose(stamp_ms * MS, (0.0, 0.0, height), normal)


def reading(stamp_ms, arrival_ms=None):
    arrival_ms = stamp_ms if arrival_ms is None else arrival_ms
    return HeldReading(stamp_ms * MS, arrival_ms * MS, False, (0.0, 0.0, 0.0))


def test_between_two_poses_point_and_normal_are_interpolated():
    track = SurfaceTrack()
    tilted = (math.sin(0.2), 0.0, math.cos(0.2))
    for one in (pose(30, 0.3, tilted), pose(10, 0.1)):  # out of order
        track.add(one)
    found = track.at(20 * MS)
    assert found.point[2] == pytest.approx(0.2)
    assert found.normal == pytest.approx((math.sin(0.1), 0.0, math.cos(0.1)))
    assert track.at(5 * MS).point[2] == 0.1
    assert track.at(40 * MS).point[2] == 0.3
    assert [track.spans(t * MS) for t in (9, 10, 30, 31)] == [False, True, True, False]


def test_a_surface_that_turns_over_has_the_nearer_normal():
    track = SurfaceTrack()
    track.add(pose(0))
    track.add(pose(10, normal=(0.0, 0.0, -1.0)))
    assert track.at(4 * MS).normal == UP
    assert track.at(6 * MS).normal == (0.0, 0.0, -1.0)


def test_the_track_is_bounded_and_a_clock_set_back_starts_it_anew():
    track = SurfaceTrack()
    for k in range(LONGEST_TRACK + 10):
        track.add(pose(k))
    assert [track.spans(t * MS) for t in (9, 10)] == [False, True]
    track.add(pose(-5000, 0.7))
    assert track.at(0).point[2] == 0.7


def test_a_reading_waits_for_the_pose_after_it_and_no_longer_than_allowed():
    wait = SurfaceWait()
    wait.maximum_wait_ns = 50 * MS
    wait.add_pose(pose(0, 0.0))
    wait.hold(reading(10))
    assert wait.release(silent=False, next_pose_ns=None) == []
    wait.add_pose(pose(20, 0.2))
    ((_, where),) = wait.release(silent=False, next_pose_ns=None)
    assert where.point[2] == pytest.approx(0.1)
    assert wait.without_pose == 0
    wait.hold(reading(30))
    wait.hold(reading(79))
    assert wait.release(silent=False, next_pose_ns=None) == []
    wait.hold(reading(80))
    # A pose that came in time and waits to be taken in: this program is late, not the surface.
    assert wait.release(silent=False, next_pose_ns=45 * MS) == []
    ((first, where),) = wait.release(silent=False, next_pose_ns=None)
    assert (first.stamp_ns, where.point[2], wait.without_pose) == (30 * MS, 0.2, 1)
    # Nobody waits for a surface that has fallen silent.
    assert len(wait.release(silent=True, next_pose_ns=None)) == 2


def test_readings_before_the_first_pose_are_dropped_and_counted():
    wait = SurfaceWait()
    wait.hold(reading(0))
    assert wait.release(silent=True, next_pose_ns=None) == []
    assert wait.before_first == 1
    assert wait.oldest_arrival_ns is None


def test_readings_go_on_in_the_order_of_their_arrival():
    wait = SurfaceWait()
    wait.hold(reading(20, arrival_ms=30))
    wait.hold(reading(10, arrival_ms=25))
    wait.add_pose(pose(0))
    wait.add_pose(pose(40))
    released = wait.release(silent=False, next_pose_ns=None)
    assert [one.arrival_ns // MS for one, _ in released] == [25, 30]
