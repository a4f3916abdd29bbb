"""What a haptic device may say of where it is, and what the hand then gets."""

from __future__ import annotations

import math

import pytest

from hc_sim_rig.bilateral.device_poses import DevicePoses


@pytest.mark.parametrize(
    ("place", "reason", "words"),
    [
        ((math.nan, 0.0), "no_number", "no number: a position is nan"),
        ((1.0, math.inf), "no_number", "no number"),
        ((20_000.0, 0.0), "out_of_range", "20 m from the origin: is it in metres?"),
        ((0.0, -20_000.0), "out_of_range", "out of range"),
        ((40.0, 0.0), "jump", "jump: 39.0 mm in 1.0 ms"),
        ((1.0, 40.0), "jump", "jump"),
    ],
)
def test_a_pose_that_cannot_be_of_a_hand_is_counted_and_named(
    place: tuple[float, float], reason: str, words: str
) -> None:
    poses = DevicePoses(2.0)
    poses.take(1.0, 0.0, 0.0)
    assert poses.where(0.0) == (2.0, 0.0, 0.0)
    poses.take(*place, 0.001)
    assert poses.where(0.001) is None
    assert not poses.heard(0.001)
    assert poses.refused[reason] == sum(poses.refused.values()) == 1
    assert words in poses.why_refused
    # It goes on from where the device then is: after a jump from there.
    there = place if reason == "jump" else (1.0, 0.0)
    poses.take(*there, 0.002)
    assert poses.where(0.002) == (2.0 * there[0], 2.0 * there[1], 0.002)
    assert poses.accepted == 2


def test_a_scaled_device_does_not_leave_the_range_of_the_link() -> None:
    poses = DevicePoses(100.0)
    poses.take(200.0, 0.0, 0.0)
    assert poses.refused["out_of_range"] == 1


def test_a_break_is_seen_although_good_poses_came_since() -> None:
    """At 4 kHz four poses come between two samples."""
    poses = DevicePoses(1.0)
    poses.take(1.0, 0.0, 0.0)
    assert poses.where(0.0) is not None
    for at, position in ((0.00025, math.nan), (0.0005, 1.0), (0.00075, 1.0)):
        poses.take(position, 0.0, at)
    assert poses.where(0.001) is None
    assert poses.where(0.001) == (1.0, 0.0, 0.00075)
    poses.take(3.0, 0.0, 0.2)  # silent for long, and the sampler slept as well
    assert poses.where(0.2) is None
    assert poses.where(0.2) == (3.0, 0.0, 0.2 - 0.00075)


def test_a_stall_and_the_bunch_after_it_are_no_jump() -> None:
    poses = DevicePoses(1.0)
    for k in range(200):  # 1 m/s
        arrival = 1e-3 * k if k < 100 else max(0.14, 1e-3 * k)
        poses.take(float(k), 0.0, arrival)
    assert poses.accepted == 200
