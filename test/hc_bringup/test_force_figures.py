"""Forces in the summaries: in the unit in which a reader can take them in."""

import math

import pytest

from hc_bringup.summary import millinewton


@pytest.mark.parametrize(
    ("force_n", "text"),
    [
        (math.nan, "-"),
        (0.00012, "0.12 mN"),
        (0.0119, "11.9 mN"),
        (9.5, "9500.0 mN"),
        (12.34, "12.3 N"),
        (436703.2056, "4.37e+05 N"),
    ],
)
def test_a_force_is_told_in_a_readable_unit(force_n, text):
    assert millinewton(force_n) == text
