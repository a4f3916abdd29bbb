"""hc payload where no weight explains the forces: it says what to type, or what may be wrong."""

import numpy as np
from scipy.spatial.transform import Rotation

from hc_bringup.commands.payload import _why_not
from hc_estimator.stream.payload import GRAVITY, StillReadings, identify_payload


def said(forces, attitudes, mounting=(0.0, 0.0, 0.0, 1.0)):
    still = StillReadings(forces, 0.0 * forces, attitudes)
    return _why_not(identify_payload(*still), still, GRAVITY, mounting, "/arm/estimator")


def test_what_to_type_is_told():
    attitudes = Rotation.random(6, random_state=1)
    down = (0.0, -9.81, 0.0)
    line = said(0.4 * attitudes.inv().apply(down), attitudes.as_quat())
    assert "0.4 kg" in line
    assert "hc param set arm/estimator input.gravity '[" in line
    numbers = [float(word) for word in line.split("'[")[1].split("]'")[0].split(", ")]
    np.testing.assert_allclose(numbers, down, atol=1e-3)


def test_a_mounting_is_told_whole_with_the_part_that_was_set_already():
    flange = Rotation.random(6, random_state=2)
    was_set = Rotation.from_euler("z", 30, degrees=True)
    true = Rotation.from_euler("ZX", [45, 20], degrees=True)
    forces = 0.4 * (flange * true).inv().apply(GRAVITY)
    line = said(forces, (flange * was_set).as_quat(), tuple(was_set.as_quat()))
    assert "input.force.mounting '[" in line
    numbers = [float(word) for word in line.split("'[")[1].split("]'")[0].split(", ")]
    assert (Rotation.from_quat(numbers).inv() * true).magnitude() < 1e-3


def test_a_touch_is_no_setting():
    attitudes = Rotation.random(6, random_state=3)
    forces = 0.4 * attitudes.inv().apply(GRAVITY)
    forces[1] += 5.0
    line = said(forces, attitudes.as_quat())
    assert "did the tool touch something?" in line
    assert "hc param set" not in line
