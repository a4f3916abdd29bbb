"""The end of a run in a terminal: a picture of what was felt, and sentences about it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from rich.text import Text

from hc_bringup.dashboard.columns import COLUMNS, INDEX
from hc_bringup.report.contacts import WORTH_A_ROW, find_contacts
from hc_bringup.report.palpation_map import MeasuredPlaces, StiffnessMap, fit_map, usual_map
from hc_bringup.report.verdict import verdict
from hc_bringup.run_ending import show_ending
from hc_bringup.terminal.ending import _sentences, draw_depth, draw_profile, ending, is_scan
from hc_bringup.tip_path import TipPath

MakeRun = Callable[..., Any]


def scan(until_mm: float = 30.0) -> StiffnessMap:
    """Tissue with a lump at 12 mm, three times as stiff, felt along a line."""
    pytest.importorskip("sklearn")
    x = np.arange(0.0, until_mm, 0.5)
    stiffness = 0.5 * (1.0 + 2.0 * np.exp(-(((x - 12.0) / 3.5) ** 2)))
    noise = 0.01 * np.random.default_rng(1).standard_normal(len(x))
    ones = np.ones(len(x))
    place = np.column_stack([x, 0.0 * x])
    return fit_map(MeasuredPlaces(place, np.log(stiffness) + noise, 1e-4 * ones, 3.0 * ones, 2.0))


def test_a_lump_is_drawn_where_it_is() -> None:
    found = scan()
    assert is_scan(found)
    lines = [line.plain for line in draw_profile(found, 60)]
    assert abs(lines[1].index("█") - 2 - 60 * 12.0 / 30.0) < 4
    assert {len(line) for line in lines[1:]} == {62}


def test_a_run_ends_with_the_words_of_its_report(make_run: MakeRun) -> None:
    """Regression: a computation of its own, "3.0 times, known to 1 %" beside "3.0 ± 0.1 times"."""
    pytest.importorskip("sklearn")
    path = np.linspace(0.0, 12.0, 600)
    tip = TipPath(path, np.column_stack([2.0 * path, np.zeros_like(path)]))
    scanned = make_run(
        stiffness=lambda t: 0.3 * (1.0 + 2.0 * np.exp(-(((2.0 * t - 12.0) / 4.0) ** 2))),
        seconds=12.0,
        tip=tip,
        lifted_mm=-0.5,
        filter_name="ekf",
    )
    contacts = find_contacts(scanned, WORTH_A_ROW)
    report = verdict(scanned, contacts, None, usual_map(scanned, contacts))
    lines = [line.plain for line in ending(scanned, 80)]
    assert lines[0].startswith("stiffness at ")
    assert lines[-2] == report[0].text
    assert lines[-2].startswith("A hard spot at ")
    assert lines[-1].startswith(report[1].text)


def test_a_lump_that_was_not_passed_has_no_place_yet(make_run: MakeRun) -> None:
    """Regression: half way up the flank, "there is a lump" at the end of the way."""
    run = make_run(seconds=3.0)
    said = _sentences(run, scan(11.0))[0].plain
    assert said.startswith("Harder up to "), said
    assert said.endswith("Go further to find the hard spot.")
    assert _sentences(run, scan())[0].plain.startswith("A hard spot at 1")
    said = _sentences(run, scan(5.0))[0].plain
    assert said.startswith("No hard spot along the way: "), said


@pytest.mark.parametrize(("std", "known"), [(0.01, True), (0.4, False), (np.nan, False)])
def test_an_answer_that_is_not_known_is_not_given(std: float, known: bool) -> None:
    """Regression: robots that were not tared, and "answers with 4.9 ± 7.7 N" at the end."""
    covariance = np.zeros((3, 4, 4))
    covariance[:, 0, 0] = std**2
    felt = SimpleNamespace(
        time_s=np.array([0.0, 0.5, 2.0]),
        contact=np.ones(3, bool),
        used=np.ones(3, bool),
        change_detected=np.zeros(3, bool),
        parameters=np.tile([0.5, 0.02, 1.5, 1.0], (3, 1)),
        covariance=covariance,
        force_n=np.ones(3),
        force_predicted_n=np.ones(3),
    )
    (said,) = (line.plain for line in _sentences(cast("Any", felt), None))
    assert ("takes 1.41" in said) == known, said
    assert ("hc doctor" in said) != known, said


def test_samples_of_two_publishers_make_no_picture(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """Regression: a second rig in the domain, and "No lump along the way" of a mixed bag."""
    both = np.column_stack([np.arange(300), 8000 + np.arange(300)]).ravel().astype(np.uint64)
    recording = SimpleNamespace(sequence=both)
    monkeypatch.setattr("hc_bringup.run_ending.read_recording", lambda _path, **_: recording)
    felt = SimpleNamespace(contact=np.ones(600, bool), used=np.ones(600, bool))
    monkeypatch.setattr("hc_bringup.run_ending.recorded", lambda _recording: felt)
    monkeypatch.setattr("hc_bringup.run_ending.ending", lambda *_: [Text("a picture")])
    show_ending(tmp_path)
    assert capsys.readouterr().out == (
        "no picture of this run: its bag holds the samples of several publishers, mixed\n"
    )
    recording.sequence = np.arange(600, dtype=np.uint64)
    show_ending(tmp_path)
    shown = capsys.readouterr().out
    assert "a picture" in shown
    assert "-o report.html    touch it yourself: hc run --control" in shown
    show_ending(tmp_path, controlled=True)  # regression: who had --control was advised to take it
    assert "-o report.html\n" in capsys.readouterr().out


def test_force_over_depth_in_dots() -> None:
    rows = np.full((400, len(COLUMNS)), np.nan)
    depth = np.linspace(0.0, 2.0, 400)
    rows[:, INDEX["displacement"]], rows[:, INDEX["force"]] = depth, depth**2
    rows[:, INDEX["contact"]] = 1.0
    lines = [line.plain for line in draw_depth(rows, 40)]
    assert "4.00 N" in lines[0]
    assert "2.0 mm" in lines[-1]
    assert lines[1].rstrip()[-1] != "\u2800"  # the deepest is the strongest: top right
    assert lines[-2][2] != "\u2800"
    assert draw_depth(rows[:10], 40) == []
