"""Axis, sign, scale and zero of one's own sensors."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hc_estimator.input.mapping import make_mapping
from hc_estimator.input.tare import Tare

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
