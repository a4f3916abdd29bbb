"""What a zero that is off would make of K."""

import math

import numpy as np
import pytest

from hc_bringup.zero_effect import POSITION_MM, ZERO_SHARE, zero_effect, zero_lines


@pytest.mark.parametrize("exponent", [1.0, 1.5, 2.1])
@pytest.mark.parametrize("depth", [1.0, 3.0, 8.0])
def test_the_law_with_the_other_zero_says_the_same_forces(depth, exponent):
    points = np.array([depth, 0.5 * depth])
    felt = 0.7 * points**exponent
    by_position, by_zero = zero_effect(depth, exponent)
    for change, places, forces in (
        (by_position, points - POSITION_MM, felt),
        (by_zero, points, felt - ZERO_SHARE * felt[0]),
    ):
        slope = np.diff(np.log(forces))[0] / np.diff(np.log(places))[0]
        stiffness = np.exp(np.log(forces[0]) - slope * np.log(places[0]))
        assert 0.7 * (1.0 + change) == pytest.approx(stiffness, rel=1e-12)


def test_a_depth_that_is_next_to_the_zero_says_nothing():
    assert all(math.isnan(value) for value in zero_effect(0.3, 1.5))
    assert zero_lines(math.nan, math.nan) == []


def test_the_line_names_both_and_what_to_do():
    (line,) = zero_lines(0.12, -0.05)
    for words in ("12 % wrong", "5 %", "contact_position_std"):
        assert words in line
