"""The end of a run in a terminal: a picture of what was felt, and a sentence about it."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from rich.text import Text

from hc_bringup.commands.run import show_ending
from hc_bringup.dashboard.columns import COLUMNS, INDEX
from hc_bringup.terminal.ending import (
    Profile,
    _sentence_of_press,
    _sentence_of_scan,
    draw_depth,
    draw_profile,
    find_lump,
)


def scan(factor: float = 3.0, deviation: float = 0.01) -> Profile:
    x = np.linspace(0.0, 30.0, 61)
    stiffness = 0.5 * (1.0 + (factor - 1.0) * np.exp(-(((x - 12.0) / 3.5) ** 2)))
    return Profile(x, stiffness, np.full(61, deviation))


def test_a_lump_is_found_and_drawn_where_it_is() -> None:
    lump = find_lump(scan())
    assert lump is not None
    assert lump.x_mm == 12.0
    assert lump.factor == pytest.approx(3.0, rel=0.02)
    lines = [line.plain for line in draw_profile(scan(), 60)]
    tops = lines[1].index("█")
    assert abs(tops - 2 - 60 * 12.0 / 30.0) < 4
    assert {len(line) for line in lines[1:]} == {62}


@pytest.mark.parametrize("profile", [scan(1.1), scan(2.0, 0.3), scan(3.0, math.inf)])
def test_no_lump_is_made_up(profile: Profile) -> None:
    assert find_lump(profile) is None


def test_a_lump_that_was_not_passed_has_no_place_yet() -> None:
    """Regression: half way up the flank, "there is a lump" at the end of the way."""
    whole = scan()
    half = Profile(*(values[: np.argmax(whole.stiffness) - 2] for values in whole))
    said = _sentence_of_scan(half)
    assert said.startswith("The tissue grows harder up to "), said
    assert _sentence_of_scan(whole).startswith("There is a lump: 12.0 mm")


def test_one_stray_estimate_is_no_lump() -> None:
    profile = scan(1.0)
    profile.stiffness[20] = 5.0
    assert find_lump(profile) is None


@pytest.mark.parametrize(("std", "known"), [(0.01, True), (0.2, False), (math.nan, False)])
def test_an_answer_that_is_not_known_is_not_given(std: float, known: bool) -> None:
    """Regression: robots that were not tared, and "answers with 4.9 ± 7.7 N" at the end."""
    covariance = np.zeros((3, 4, 4))
    covariance[:, 0, 0] = std**2
    felt = SimpleNamespace(
        contact=np.ones(3, bool),
        used=np.ones(3, bool),
        parameters=np.tile([0.5, 0.02, 1.5, 1.0], (3, 1)),
        covariance=covariance,
        force_n=np.ones(3),
        force_predicted_n=np.ones(3),
    )
    said = _sentence_of_press(cast("Any", felt))
    assert ("answers with 1.41" in said) == known, said
    assert ("hc doctor" in said) != known, said


def test_samples_of_two_publishers_make_no_picture(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """Regression: a second rig in the domain, and "No lump along the way" of a mixed bag."""
    both = np.column_stack([np.arange(300), 8000 + np.arange(300)]).ravel().astype(np.uint64)
    recording = SimpleNamespace(sequence=both)
    monkeypatch.setattr("hc_logger.recording.read_recording", lambda _path: recording)
    felt = SimpleNamespace(contact=np.ones(600, bool), used=np.ones(600, bool))
    monkeypatch.setattr("hc_bringup.run_data.recorded", lambda _recording: felt)
    monkeypatch.setattr("hc_bringup.terminal.ending.ending", lambda *_: [Text("a picture")])
    show_ending(tmp_path)
    assert capsys.readouterr().out == (
        "no picture of this run: its bag holds the samples of several publishers, mixed\n"
    )
    recording.sequence = np.arange(600, dtype=np.uint64)
    show_ending(tmp_path)
    assert "a picture" in capsys.readouterr().out


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
