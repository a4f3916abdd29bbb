"""Names and units of columns as people write them, and the option that assigns them."""

from __future__ import annotations

from pathlib import Path

import pytest

from hc_logger.csv_columns import candidates
from hc_logger.csv_options import parse_assignments
from hc_logger.csv_vocabulary import QUANTITIES, split_name, unit_of
from hc_logger.errors import BagError
from hc_logger.recording import read_recording


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


@pytest.mark.parametrize(
    "names",
    [
        ("Prüfzeit", "Eindringung", "Prüfkraft"),
        ("Durée", "Enfoncement", "Effort"),
        ("Temps", "Profondeur", "Force normale"),
    ],
)
def test_names_of_other_languages_are_known(names: tuple[str, str, str]) -> None:
    for index, quantity in enumerate(QUANTITIES):
        assert candidates(quantity, names, [0, 1, 2]) == ([index], "")


def test_a_name_nobody_knows_is_settled_by_a_unit_that_is_there_once() -> None:
    names = ["tid (s)", "väg (mm)", "kraften (N)", "massa (g)", "temp (C)"]
    for index, quantity in enumerate(QUANTITIES):
        found, why = candidates(quantity, names, range(5))
        assert found == [index]
        assert why == f"{names[index]!r} is taken for the {quantity} by its unit"
    below = ["s", "mm", "N", "g", ""]
    assert candidates("force", ["a", "b", "c", "d", "e"], range(5), below)[0] == [2]
    # Two of them, a mass, or a word that says that it is something else leave it open.
    assert candidates("force", ["kraften (N)", "vikt (N)"], [0, 1]) == ([0, 1], "")
    assert candidates("force", ["massa (g)"], [0]) == ([], "")
    assert candidates("force", ["kraften max (N)"], [0]) == ([], "")


@pytest.mark.parametrize(
    "units", ["[s],[mm],[N]", "s,mm,N", "(sec),(mm),", "[s],-,[N]", "Sekunden,Millimeter,Newton"]
)
def test_a_line_of_units_below_our_own_names_is_passed_over(tmp_path: Path, units: str) -> None:
    """Regression: "line 2: time_s is '[s]' instead of a number"; other names could have one."""
    path = tmp_path / "press.csv"
    rows = "".join(f"{k * 0.001:.3f},1.5,0.25\n" for k in range(50))
    path.write_text(f"time_s,displacement_mm,force_N\n{units}\n{rows}")
    read = read_recording(path)
    assert len(read.time_s) == 50
    assert (read.displacement_mm == 1.5).all()


@pytest.mark.parametrize(
    ("units", "said"),
    [
        ("[ms],[mm],[N]", r"line 2 says that time_s is in \[ms\], and its name that it is in s"),
        ("[s],[m],[N]", r"displacement_mm is in \[m\], and its name that it is in mm"),
        ("s,mm,kN", r"force_N is in kN, and its name that it is in N: mend the wrong one"),
    ],
)
def test_units_that_disagree_with_our_own_names_are_refused(
    tmp_path: Path, units: str, said: str
) -> None:
    path = tmp_path / "press.csv"
    rows = "".join(f"{k * 0.001:.3f},1.5,0.25\n" for k in range(50))
    path.write_text(f"time_s,displacement_mm,force_N\n{units}\n{rows}")
    with pytest.raises(BagError, match=said):
        read_recording(path)
