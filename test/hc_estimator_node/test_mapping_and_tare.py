"""Axis, sign, scale and zero of one's own sensors."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hc_estimator.stream.mapping import make_mapping
from hc_estimator.stream.press_watch import PressWatch
from hc_estimator.stream.tare import Tare

finite = st.floats(-1e3, 1e3)


@pytest.mark.parametrize(("axis", "expected"), [("x", 1.0), ("y", 2.0), ("z", 3.0)])
def test_an_axis_takes_its_component(axis, expected):
    assert make_mapping(axis, [0, 0, 1], 1, 1.0, 0.0).of_vector(1.0, 2.0, 3.0) == expected


def test_sign_scale_and_zero_apply_in_this_order():
    mapping = make_mapping("z", [0, 0, 1], -1, 2.0, 5.0)
    assert mapping.of_vector(0.0, 0.0, -10.0) == 2.0 * 10.0 - 5.0


def test_a_joint_is_a_scalar_times_its_lever():
    assert make_mapping("x", [0, 0, 1], 1, 0.05, 1.0).of_scalar(100.0) == pytest.approx(4.0)


@given(st.tuples(finite, finite, finite).filter(lambda d: math.hypot(*d) > 1e-6), finite)
def test_a_force_along_a_direction_of_any_length_reads_its_magnitude(direction, magnitude):
    length = math.hypot(*direction)
    force = [magnitude * component / length for component in direction]
    mapping = make_mapping("direction", direction, 1, 1.0, 0.0)
    assert mapping.of_vector(*force) == pytest.approx(magnitude, abs=1e-9)


@pytest.mark.parametrize(
    ("settings", "named"),
    [
        (("w", [0, 0, 1], 1, 1.0, 0.0), "axis"),
        (("z", [0, 0, 1], 0, 1.0, 0.0), "sign"),
        (("direction", [0, 0, 0], 1, 1.0, 0.0), "direction"),
        (("direction", [1, 0], 1, 1.0, 0.0), "direction"),
        (("direction", [math.nan, 0, 1], 1, 1.0, 0.0), "direction"),
        (("z", [math.nan, 0, 1], 1, 1.0, 0.0), "direction"),
        (("x", [1, 0], 1, 1.0, 0.0), "direction"),
    ],
)
def test_what_cannot_be_is_named(settings, named):
    with pytest.raises(ValueError, match=rf"^{named} = "):
        make_mapping(*settings)


def test_a_tare_gives_mean_and_deviation_and_passes_over_what_is_no_number():
    tare = Tare(4)
    assert tare.add(1.0, 10.0) is None
    assert tare.add(math.nan, 10.0) is None
    assert tare.add(2.0, 10.0) is None
    assert tare.add(3.0, math.inf) is None
    assert tare.add(3.0, 14.0) is None
    result = tare.add(4.0, 14.0)
    assert result == (2.5, pytest.approx(1.2909944487), 12.0, pytest.approx(2.3094010768), 4)


def tared(displacement, force):
    tare = Tare(len(displacement))
    for d, f in zip(displacement, force, strict=True):
        tare.add(float(d), float(f))
    return tare.unrest


@pytest.mark.parametrize("samples", [1, 3, 10, 500])
@pytest.mark.parametrize("noise", [0.0, 1e-3, 0.5, 20.0])
def test_a_tool_at_rest_is_at_rest_whatever_the_noise(samples, noise):
    for seed in range(20):
        generator = np.random.default_rng(seed)
        displacement = 412.0 + noise * generator.standard_normal(samples)
        force = -3.0 + noise * generator.standard_normal(samples)
        assert tared(displacement, force) == ""


def test_a_tool_that_moves_or_presses_meanwhile_is_told():
    still = 0.01 * np.random.default_rng(1).standard_normal(500)
    time = np.linspace(0.0, 0.5, 500)
    assert tared(still, still) == ""
    assert "the tool moved by 4.5" in tared(10.0 * time + still, still)
    assert "the force changed by" in tared(still, 0.7 * np.sin(9.0 * time) + still)
    assert tared(0.05 * np.sin(9.0 * time) + still, still) == ""  # breathing of 0.05 mm


def test_a_press_is_known_only_with_zeros_that_were_seen_to_be_right():
    watch = PressWatch()
    generator = np.random.default_rng(2)
    for _ in range(500):  # a robot before its first tare: 400 mm deep, with a bias
        watch.add(400.0, 1.7 + generator.normal(0.0, 0.02))
    assert watch.pressing == ""
    for depth in np.linspace(-2.0, 3.0, 500):
        force = 0.5 * max(depth, 0.0) ** 1.5 + generator.normal(0.1, 0.02)
        watch.add(depth, force)
    watch.add(math.nan, 1.0)
    assert watch.pressing.startswith("the tool presses with 2.5")
    assert watch.pressing.endswith("at a depth of 3 mm")
    watch.add(0.01, 0.12)
    assert watch.pressing == ""
    watch.add(3.0, 2.6)
    watch.forget()
    assert watch.pressing == ""
