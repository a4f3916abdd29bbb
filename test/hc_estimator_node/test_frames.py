"""Frames that hang on each other, against scipy."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from hc_estimator.stream.frame_poses import FramePoses
from hc_estimator.stream.frames import FrameTree

ROBOT = (("base", "shoulder"), ("shoulder", "wrist"), ("wrist", "tool"), ("base", "camera"))


def matrix(pose):
    result = np.eye(4)
    result[:3, :3] = Rotation.from_quat(pose[1]).as_matrix()
    result[:3, 3] = pose[0]
    return result


def test_the_pose_of_a_frame_in_any_other_is_that_of_the_product_of_matrices():
    generator = np.random.default_rng(4)
    tree, told = FrameTree(), {}
    for parent, child in ROBOT:
        turn = tuple(map(float, Rotation.random(random_state=generator).as_quat()))
        pose = (tuple(map(float, generator.uniform(-1, 1, 3))), turn)
        told[child] = matrix(pose)
        tree.add(parent, child, pose)
    of_tool = told["shoulder"] @ told["wrist"] @ told["tool"]
    for base, tip, expected in (
        ("base", "tool", of_tool),
        ("wrist", "tool", told["tool"]),
        ("tool", "base", np.linalg.inv(of_tool)),
        ("camera", "tool", np.linalg.inv(told["camera"]) @ of_tool),
        ("tool", "tool", np.eye(4)),
    ):
        np.testing.assert_allclose(matrix(tree.pose(base, tip)), expected, atol=1e-12)
    assert tree.between("base", "tool") == {"shoulder", "wrist", "tool"}
    assert tree.between("camera", "shoulder") == {"camera", "shoulder"}
    assert tree.parent("tool") == "wrist"


def test_frames_that_nothing_connects_have_no_pose():
    tree = FrameTree()
    here = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
    tree.add("base", "arm", here)
    tree.add("world", "tool", here)
    assert tree.pose("base", "tool") is None
    assert tree.between("base", "tool") is None
    assert tree.parent("base") is None
    tree.add("arm", "base", here)  # they hang on themselves: no end, but no hanging either
    assert tree.pose("base", "tool") is None
    assert tree.pose("base", "arm")[0] == pytest.approx((0.0, 0.0, 0.0))


def moved(child, parent, x, stamp_s, turn=(0.0, 0.0, 0.0, 1.0)):
    """A geometry_msgs/TransformStamped as far as is read of it."""
    rotation = SimpleNamespace(**dict(zip("xyzw", turn, strict=True)))
    return SimpleNamespace(
        header=SimpleNamespace(frame_id=parent, stamp=SimpleNamespace(sec=stamp_s, nanosec=0)),
        child_frame_id=child,
        transform=SimpleNamespace(
            translation=SimpleNamespace(x=x, y=0.0, z=0.0), rotation=rotation
        ),
    )


def test_a_transform_that_is_none_does_not_give_an_old_pose_a_new_stamp():
    """Regression of 2026-11-26: its stamp was taken although it was not."""
    told = []
    poses = FramePoses(lambda stamp_ns, _base, place, _turn: told.append((stamp_ns, place[0])))
    poses.follow("tool", "base")
    for stamp_s, turn in ((1, (0.0, 0.0, 0.0, 1.0)), (2, (0.0, 0.0, 0.0, 0.0)), (3, (0, 0, 0, 1))):
        arm = moved("tool", "base", 0.1 * stamp_s, stamp_s, turn)
        poses.take_moving(SimpleNamespace(transforms=[arm]))
    assert poses.unusable == 1
    assert told == [(1_000_000_000, pytest.approx(0.1)), (3_000_000_000, pytest.approx(0.3))]


def test_a_frame_whose_stamps_lag_does_not_give_a_pose_the_stamp_of_before():
    """Each of its messages gave the pose of now its own, older stamp: 5 mm off at 0.1 m/s."""
    told = []
    poses = FramePoses(lambda stamp_ns, _base, place, _turn: told.append((stamp_ns, place[0])))
    poses.follow("tool", "base")
    for second in range(100, 200):
        poses.take_moving(SimpleNamespace(transforms=[moved("tool", "arm", 0.01 * second, second)]))
        if second % 5 == 0:  # that a base stands still comes seldom, and late
            late_ns = SimpleNamespace(sec=second - 1, nanosec=500_000_000)
            base = moved("arm", "base", 0.0, 0)
            base.header.stamp = late_ns
            poses.take_moving(SimpleNamespace(transforms=[base]))
    assert len(told) > 90
    for stamp_ns, place in told[1:]:
        assert place == pytest.approx(1e-11 * stamp_ns)
