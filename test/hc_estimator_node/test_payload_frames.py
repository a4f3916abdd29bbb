"""Forces at rest that no weight explains: which setting would explain them is told."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from hc_estimator.stream.payload import GRAVITY, identify_payload, is_small
from hc_estimator.stream.payload_frames import explain_otherwise

BIAS = np.array([0.4, -0.3, 1.2])


def at_rest(attitudes, gravity, turn, mass=0.35, seed=0):
    """Forces [N] of a sensor that sits turned behind the attitudes that are known of it."""
    noise = 0.002 * np.random.default_rng(seed).standard_normal((len(attitudes), 3))
    return mass * (Rotation.from_quat(attitudes) * turn).inv().apply(gravity) + BIAS + noise


@pytest.mark.parametrize("seed", range(20))
def test_a_pose_in_a_frame_that_does_not_stand_upright(seed):
    """Regression: only the mounting was named, and a mass of 0.04 kg for 0.35 was set."""
    attitudes = Rotation.random(6, random_state=seed).as_quat()
    down = Rotation.random(random_state=100 + seed).apply(GRAVITY)
    forces = at_rest(attitudes, down, Rotation.identity(), seed=seed)
    assert not identify_payload(forces, 0.0 * forces, attitudes).is_explained
    other = explain_otherwise(forces, attitudes, GRAVITY)
    assert other.name == "gravity"
    np.testing.assert_allclose(other.value, down, atol=0.1)
    assert other.mass == pytest.approx(0.35, abs=0.005)
    assert is_small(other.residual_n, other.mass, GRAVITY)
    found = identify_payload(forces, 0.0 * forces, attitudes, other.value)
    assert found.is_explained
    np.testing.assert_allclose(found.force_bias, BIAS, atol=0.01)


@pytest.mark.parametrize("seed", range(20))
def test_a_sensor_that_sits_turned(seed):
    attitudes = Rotation.random(6, random_state=seed)
    turn = Rotation.random(random_state=200 + seed)
    forces = at_rest(attitudes.as_quat(), GRAVITY, turn, seed=seed)
    assert not identify_payload(forces, 0.0 * forces, attitudes.as_quat()).is_explained
    other = explain_otherwise(forces, attitudes.as_quat(), GRAVITY)
    assert other.name == "force.mounting"
    assert (Rotation.from_quat(other.value).inv() * turn).magnitude() < 0.01
    assert other.mass == pytest.approx(0.35, abs=0.005)
    behind = (attitudes * Rotation.from_quat(other.value)).as_quat()
    assert identify_payload(forces, 0.0 * forces, behind).is_explained


def test_a_tool_that_touched_something_and_too_few_attitudes_are_no_other_setting():
    attitudes = Rotation.random(7, random_state=3).as_quat()
    forces = at_rest(attitudes, GRAVITY, Rotation.identity())
    assert explain_otherwise(forces[:3], attitudes[:3], GRAVITY) is None
    forces[2] += [0.0, 4.0, 1.0]
    assert not identify_payload(forces, 0.0 * forces, attitudes).is_explained
    other = explain_otherwise(forces, attitudes, GRAVITY)
    assert not is_small(other.residual_n, other.mass, GRAVITY)
