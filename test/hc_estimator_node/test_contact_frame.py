"""Six axes: turned vectors, depth and force along a normal, weight off, payload identified."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from hc_estimator.stream.contact_frame import (
    ContactFrame,
    Payload,
    inverse,
    product,
    rotated,
    unit_quaternion,
    unit_vector,
)
from hc_estimator.stream.payload import identify_payload, still_readings

GRAVITY = np.array([0.0, 0.0, -9.81])
number = st.floats(-10.0, 10.0)
vectors = st.tuples(number, number, number)
quaternions = st.tuples(number, number, number, number).filter(lambda q: math.hypot(*q) > 1e-3)


@given(quaternions, quaternions, vectors)
def test_turns_are_those_of_scipy(p, q, v):
    p, q = unit_quaternion(p), unit_quaternion(q)
    np.testing.assert_allclose(rotated(q, v), Rotation.from_quat(q).apply(v), atol=1e-9)
    np.testing.assert_allclose(rotated(inverse(q), rotated(q, v)), v, atol=1e-9)
    both = Rotation.from_quat(p) * Rotation.from_quat(q)
    np.testing.assert_allclose(rotated(product(p, q), v), both.apply(v), atol=1e-9)


@given(quaternions, quaternions, vectors, st.floats(0.0, 5.0), vectors, st.floats(-5.0, 50.0))
def test_weight_and_offset_vanish_in_every_attitude(attitude, mounting, bias, mass, normal, push):
    if math.hypot(*normal) < 1e-3:
        return
    normal = unit_vector(normal)
    attitude, mounting = unit_quaternion(attitude), unit_quaternion(mounting)
    frame = ContactFrame(
        normal=normal, mounting=mounting, payload=Payload(mass, (0.0, 0.0, 0.0), bias)
    )
    sensor = Rotation.from_quat(attitude) * Rotation.from_quat(mounting)
    reading = sensor.inv().apply(push * np.array(normal) + mass * GRAVITY) + np.array(bias)
    force = frame.contact_force(tuple(reading), attitude)
    assert frame.along_normal(force) == pytest.approx(push, abs=1e-9)
    in_base = frame._replace(in_base=True)
    told = push * np.array(normal) + mass * GRAVITY + np.array(bias)
    assert in_base.along_normal(in_base.contact_force(tuple(told), attitude)) == pytest.approx(
        push, abs=1e-9
    )


def test_depth_is_that_of_the_tip_along_the_normal():
    attitude = unit_quaternion(Rotation.from_euler("y", 90, degrees=True).as_quat())
    frame = ContactFrame(point=(0.4, 0.0, 0.2), normal=(0.0, 0.0, 1.0), tip=(0.1, 0.0, 0.0))
    tip = frame.tip_at((0.4, 0.3, 0.297), attitude)  # the tip points down
    np.testing.assert_allclose(tip, (0.4, 0.3, 0.197), atol=1e-12)
    assert frame.depth_mm(tip) == pytest.approx(3.0)
    slanted = frame._replace(normal=unit_vector((0.0, 1.0, 1.0)))
    assert slanted.depth_mm(tip) == pytest.approx(-(0.3 - 0.003) * 1000.0 / math.sqrt(2.0))


@pytest.mark.parametrize("values", [(0, 0, 0, 0), (1, 0, 0), (math.nan, 0, 0, 1)])
def test_no_quaternion_is_named(values):
    with pytest.raises(ValueError, match="is no quaternion"):
        unit_quaternion(values)


def still(attitudes, mass=0.7, center=(0.01, -0.02, 0.06), noise=0.01, seed=0):
    generator = np.random.default_rng(seed)
    weight = mass * Rotation.from_quat(attitudes).inv().apply(GRAVITY)
    forces = weight + np.array([0.3, -1.1, 4.2])
    torques = np.cross(np.broadcast_to(center, weight.shape), weight) + np.array([0.01, 0.0, -0.02])
    return (
        forces + noise * generator.standard_normal(forces.shape),
        torques + 0.1 * noise * generator.standard_normal(torques.shape),
    )


def test_a_payload_is_identified_with_an_honest_uncertainty():
    scores = []
    for seed in range(60):
        attitudes = Rotation.random(6, random_state=seed).as_quat()
        found = identify_payload(*still(attitudes, seed=seed), attitudes)
        assert found.mass == pytest.approx(0.7, abs=0.01)
        np.testing.assert_allclose(found.center, (0.01, -0.02, 0.06), atol=2e-3)
        np.testing.assert_allclose(found.force_bias, (0.3, -1.1, 4.2), atol=0.05)
        scores.append((found.mass - 0.7) / found.mass_std)
        scores += ((found.force_bias - [0.3, -1.1, 4.2]) / found.force_bias_std).tolist()
    assert 0.6 < np.mean(np.square(scores)) < 1.8


def test_without_a_payload_there_is_no_centre():
    attitudes = Rotation.random(5, random_state=1).as_quat()
    found = identify_payload(*still(attitudes, mass=0.0), attitudes)
    assert abs(found.mass) < 0.01
    assert np.isnan(found.center_std).all()


def test_attitudes_that_tell_nothing_are_refused():
    attitudes = Rotation.from_euler("z", [[0], [60], [120], [200]], degrees=True).as_quat()
    with pytest.raises(ValueError, match="differ by 0 degrees against the vertical"):
        identify_payload(*still(attitudes), attitudes)
    with pytest.raises(ValueError, match="2 attitudes are too few"):
        identify_payload(*still(attitudes[:2]), attitudes[:2])


def test_two_attitudes_that_come_again_are_two_and_a_sensor_that_is_turned_is_told():
    """Regression: the centre of two attitudes was 1.7 mm off with a deviation of 0.01 mm."""
    pair = Rotation.random(2, random_state=3)
    attitudes = (pair[[0, 1, 0, 1]] * Rotation.from_euler("x", 0.1, degrees=True)).as_quat()
    with pytest.raises(ValueError, match="2 attitudes are too few, though 4 were taken"):
        identify_payload(*still(attitudes, noise=1e-4), attitudes)

    attitudes = Rotation.random(6, random_state=3).as_quat()
    assert identify_payload(*still(attitudes), attitudes).is_explained
    assert identify_payload(*still(attitudes, mass=0.0), attitudes).is_explained
    mounted = Rotation.from_quat(attitudes) * Rotation.from_euler("z", 45, degrees=True)
    found = identify_payload(*still(mounted.as_quat()), attitudes)
    assert not found.is_explained
    assert found.residual_n > 0.5


def test_the_times_at_rest_are_found_in_a_recording():
    generator = np.random.default_rng(4)
    targets = Rotation.random(5, random_state=7)
    pose_s = np.arange(0.0, 15.0, 0.008)
    attitudes = []
    for time in pose_s:
        part, fraction = divmod(time / 3.0, 1.0)
        turn = targets[int(part)]
        if fraction > 0.6:  # on the way to the next one
            after = targets[min(int(part) + 1, 4)]
            way = (turn.inv() * after).as_rotvec() * (fraction - 0.6) / 0.4
            turn = turn * Rotation.from_rotvec(way)
        attitudes.append(
            (turn * Rotation.from_rotvec(1e-4 * generator.standard_normal(3))).as_quat()
        )
    wrench_s = np.arange(0.0, 15.0, 0.002)
    nearest = np.clip(np.searchsorted(pose_s, wrench_s), 0, len(pose_s) - 1)
    turned = Rotation.from_quat(np.array(attitudes)[nearest])
    weight = 0.7 * turned.inv().apply(GRAVITY)
    wrenches = np.column_stack(
        (weight + np.array([0.3, -1.1, 4.2]), np.cross([0, 0, 0.06], weight))
    )
    wrenches += 0.01 * generator.standard_normal(wrenches.shape)
    still_ones = still_readings(wrench_s, wrenches, pose_s, np.array(attitudes))
    assert len(still_ones.attitudes) == 5
    found = identify_payload(*still_ones)
    assert found.mass == pytest.approx(0.7, abs=0.003)
    np.testing.assert_allclose(found.center, (0.0, 0.0, 0.06), atol=2e-3)
    assert (
        len(still_readings(wrench_s, wrenches, pose_s[:20], np.array(attitudes[:20])).forces) == 0
    )


def test_rests_are_found_in_poses_that_come_once_a_second():
    """None lay in the middle of a rest of two poses: a mean of no rotations raised."""
    pose_s = np.arange(0.0, 8.0)
    turns = Rotation.from_rotvec([[0.3 * (i // 2), 0.0, 0.0] for i in range(8)])
    wrench_s = np.arange(0.0, 8.0, 0.01)
    wrenches = np.tile([0.0, 0.0, -9.81, 0.0, 0.0, 0.0], (len(wrench_s), 1))
    still = still_readings(wrench_s, wrenches, pose_s, turns.as_quat())
    off = Rotation.from_quat(still.attitudes).inv() * turns[::2]
    np.testing.assert_allclose(off.magnitude(), 0.0, atol=1e-12)


def test_a_pose_without_an_orientation_and_a_wrench_without_a_number_are_no_rest():
    pose_s = np.arange(0.0, 3.0, 0.01)
    quaternions = np.tile([0.0, 0.0, 0.0, 1.0], (len(pose_s), 1))
    quaternions[::3] = 0.0
    quaternions[1::9] = np.nan
    wrenches = np.tile([0.0, 0.0, -9.81, 0.0, 0.0, 0.0], (len(pose_s), 1))
    wrenches[5::7] = np.nan
    still = still_readings(pose_s, wrenches, pose_s, quaternions)
    np.testing.assert_allclose(still.forces, [[0.0, 0.0, -9.81]])
    np.testing.assert_allclose(np.abs(still.attitudes), [[0.0, 0.0, 0.0, 1.0]])
    with pytest.raises(ValueError, match="no pose has an orientation"):
        still_readings(pose_s, wrenches, pose_s, np.zeros((len(pose_s), 4)))
