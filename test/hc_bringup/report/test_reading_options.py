"""hc compare reads recordings as hc estimate does, and pages say how theirs was read."""

from __future__ import annotations

import argparse
import json
import math
import shlex
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hc_bringup.commands import compare, estimate, report
from hc_bringup.errors import UserError

EXAMPLE = Path(__file__).parents[3] / "bags" / "example"


@pytest.fixture
def table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A press of somebody else's, 0.4 mm too deep, with a pull for a push."""
    monkeypatch.chdir(tmp_path)
    depths = [2.0 * math.sin(k / 150) ** 2 for k in range(2000)]
    rows = "".join(f"{k / 500};{d + 0.4};{-0.3 * d**1.6}\n" for k, d in enumerate(depths))
    path = Path("my press.csv")
    path.write_text(f"t;way;push\n{rows}")
    return path


def parsed(command: Any, *words: str) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    command.configure(parser)
    return parser.parse_args(words)


KNOWN = (
    *("--units", "displacement=mm,force=N"),
    *("--columns", "time=t,displacement=way,force=push", "--separator", "semicolon"),
    *("--input", "force.sign=-1", "--input", "position.zero=0.4"),
)


def test_it_compares_what_estimate_reads(table: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = (str(table), "--filter", "raukf", "--filter", "ukf", *KNOWN)
    assert compare.run(parsed(compare, *words, "-o", "page.html", "--json")) == 0
    (scores,) = json.loads(capsys.readouterr().out)["recordings"]
    estimate.run(parsed(estimate, str(table), "--filter", "raukf", *KNOWN, "--json"))
    alone = json.loads(capsys.readouterr().out)
    of_raukf = scores["scores"]["raukf"]
    assert of_raukf["force_rms_n"] < 0.05
    assert of_raukf["nis"] == pytest.approx(alone["nis_mean"], rel=0.05)
    assert any("separated by semicolon" in line for line in scores["findings"])


@pytest.mark.parametrize("command", [compare, report], ids=["compare", "report"])
def test_a_page_says_how_its_recording_was_read(table: Path, command: Any) -> None:
    """Regression: the line of a report left --columns, --units and the like away."""
    filters = ("--filter", "ekf", *(("--filter", "ukf") if command is compare else ()))
    arguments = parsed(command, str(table), *filters, *KNOWN, "--find-surface", "-o", "page.html")
    line = (compare._command_line if command is compare else report.command_line)(arguments)
    again = parsed(command, *shlex.split(shlex.join(line))[2:])
    assert vars(again) == vars(arguments)


def test_recorded_estimates_are_of_the_readings_as_they_were(tmp_path: Path) -> None:
    words = (str(EXAMPLE), "--filter", "ekf", "--recorded", "-o", str(tmp_path / "page.html"))
    for more in (("--input", "position.zero=0.4"), ("--find-surface",)):
        with pytest.raises(UserError, match="--recorded takes the estimates of the readings"):
            compare.run(parsed(compare, *words, *more))


def test_what_is_no_option_of_the_recording_is_refused(tmp_path: Path) -> None:
    two = (str(EXAMPLE), "--filter", "ekf", "--filter", "ukf", "-o", str(tmp_path / "page.html"))
    for more, line in (
        (("--decimal", ","), r"--decimal is for a CSV file, and .*example is none"),
        (("--input", "force.nope=1"), r"--input force\.nope is none of force\.topic"),
    ):
        with pytest.raises(UserError, match=line):
            compare.run(parsed(compare, *two, *more))


@pytest.mark.parametrize("name", ["raukf", "ukf", "rwstukf"])
def test_a_recording_that_shows_nothing_is_no_result(tmp_path: Path, name: str) -> None:
    """Regression: K = 1 ± 2 of two channels that stand still, status 0, and a row of a batch."""
    path = tmp_path / "still.csv"
    rows = "".join(f"{k / 100},0,0\n" for k in range(500))
    path.write_text(f"time_s,displacement_mm,force_N\n{rows}")
    with pytest.raises(UserError, match=r"show nothing of K, B, n and p: press, and move$"):
        estimate.run(parsed(estimate, str(path), "--filter", name))


def test_what_was_known_before_a_change_is_not_called_nothing() -> None:
    """Regression: "the 20000 samples show nothing: press, and move", and K had been 0.3 %."""
    nothing = dict.fromkeys(("stiffness", "damping"), 0.0)
    counts = {"samples": 900, "used": 900, "rejected": {}, "forces": 900, "displacements": 900}
    summary = counts | {
        "in_contact": 300,
        "identifiability": nothing,
        "changes_detected": 2,
        "most_known": 1.0,
        "model_mismatch_share": 0.0,
    }
    said = estimate.why_no_result(summary)
    assert said.startswith("2 changes of the tissue detected, and what came after the last one ")
    for other in ({"changes_detected": 0}, {"most_known": 0.3}):
        said = estimate.why_no_result(summary | other)
        assert said == "the 900 samples show nothing of K, B, n and p: press, and move"


def test_presses_on_something_rigid_are_not_called_none(tmp_path: Path) -> None:
    """Regression: of presses through 4 mm of tissue onto a table "press, and move"."""
    time_s = np.arange(0.0, 40.0, 0.002)
    depth = -2.0 + 3.2 * (1.0 - np.cos(2.0 * np.pi * 0.4 * time_s))
    speed = np.gradient(depth, time_s)
    noise = np.random.default_rng(12)
    place = depth + noise.normal(0.0, 0.003, depth.size)
    law = 0.4 + 0.012 * np.sign(speed) * np.abs(speed) ** 1.1
    force = np.maximum(0.0, law * np.maximum(depth, 0.0) ** 1.5)
    force += 30.0 * np.maximum(depth - 4.0, 0.0) + noise.normal(0.0, 0.01, depth.size)
    path = tmp_path / "table.csv"
    rows, header = np.column_stack((time_s, place, force)), "time_s,displacement_mm,force_N"
    np.savetxt(path, rows, delimiter=",", header=header, comments="", fmt="%.9g")
    with pytest.raises(UserError) as caught:
        estimate.run(parsed(estimate, str(path)))
    assert "the contact law did not fit in " in str(caught.value)
    assert "press less deep" in str(caught.value)
