"""What is printed of the parameters: how much the data say, and where a search ended at its limit.

Regression of 2026-11-29: of tissue with p = 0.3 it was said "p = 0.40004 ± 0.0051, 100 % known",
which is the smallest that the default filter looks for.
"""

import pytest

from hc_bringup.summary import parameter_lines

VALUES = {
    "stiffness": 0.4,
    "damping": 0.01,
    "displacement_exponent": 1.5,
    "velocity_exponent": 1.0,
}
DEVIATIONS = dict.fromkeys(VALUES, 0.005)
KNOWN = dict.fromkeys(VALUES, 1.0)


@pytest.mark.parametrize(
    ("name", "value", "which"),
    [
        ("velocity_exponent", 0.40004, "smallest"),
        ("velocity_exponent", 2.0, "largest"),
        ("displacement_exponent", 0.6, "smallest"),
        ("displacement_exponent", 3.999, "largest"),
    ],
)
def test_an_exponent_at_the_end_of_the_search_is_not_said_to_be_known(name, value, which):
    lines = parameter_lines({**VALUES, name: value}, DEVIATIONS, KNOWN)
    said = lines[list(VALUES).index(name)]
    assert f"the {which} that is looked for" in said
    assert "known from the data" not in said
    assert sum("100 % known from the data" in line for line in lines) == 3


def test_exponents_between_the_limits_are():
    lines = parameter_lines({**VALUES, "velocity_exponent": 0.41}, DEVIATIONS, KNOWN)
    assert all("100 % known from the data" in line for line in lines)


def test_what_is_held_at_a_limit_is_not_looked_for():
    held = {**DEVIATIONS, "velocity_exponent": 0.0}
    lines = parameter_lines({**VALUES, "velocity_exponent": 2.0}, held, KNOWN)
    assert not any("looked for" in line for line in lines)
