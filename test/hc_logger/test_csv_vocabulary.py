"""Names and units of columns as people write them, and the option that assigns them."""

from __future__ import annotations

import pytest

from hc_logger.csv_options import parse_assignments
from hc_logger.csv_vocabulary import split_name, unit_of


def test_an_assignment_may_hold_commas() -> None:
    assert parse_assignments("time=Time, s,displacement=z, mm,force=3") == {
        "time": "Time, s",
        "displacement": "z, mm",
        "force": "3",
    }
    for text in ("", "time", "x=1", "time=", "time=1,time=2"):
        with pytest.raises(ValueError, match=r"form|given"):
            parse_assignments(text)


@pytest.mark.parametrize(
    ("cell", "name", "unit"),
    [
        ("force_N", "force", "N"),
        ("Force [mN]", "force", "mN"),
        ("Kraft in N", "kraft", "N"),
        ("Time(ms)", "time", "ms"),
        ("Position / µm", "position", "um"),
        ("Position \u03bcm", "position", "um"),
        ("Normal force", "normal force", None),
        ("Force (Compression)", "force", None),
        ("DISTANCE MM", "distance", "mm"),
        ("Load kN", "load", "kN"),
        ("Extension in", "extension", "in"),
        ("Load (lb)", "load", "lbf"),
        ("F", "f", None),
    ],
)
def test_names_and_units(cell: str, name: str, unit: str | None) -> None:
    assert split_name(cell) == (name, unit)


def test_units_that_differ_by_a_capital_are_not_guessed() -> None:
    assert unit_of("MN") is None
    assert unit_of("M") is None
    assert unit_of("mn") is None
    assert unit_of("MM") == "mm"
