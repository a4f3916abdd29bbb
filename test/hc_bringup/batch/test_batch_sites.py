"""hc batch --sites: the places of many recordings, as hc contacts --sites finds those of one."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from hc_bringup.cli import main

MakeRecordings = Callable[..., Path]
SURFACES = (0.0, 1.1)


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def press_two_places(path: Path, seed: int, stiffness: tuple[float, float]) -> None:
    """Write a recording: at each place three presses, with a rest in the air between them."""
    random = np.random.default_rng(seed)
    depth, of = [np.full(500, -2.0)], [np.zeros(500, int)]
    for place, surface in enumerate(SURFACES):
        for seconds in (1.0, 0.5, 0.8):
            phase = np.linspace(0.0, 2.0 * np.pi, round(500 * seconds), endpoint=False)
            depth.append(-2.0 + (surface + 3.0 + 2.0) * 0.5 * (1.0 - np.cos(phase)))
            of.append(np.full(len(phase), place))
        depth.append(np.full(750, -2.0))
        of.append(np.full(750, place))
    d, place = np.concatenate(depth), np.concatenate(of)
    time_s = np.arange(len(d)) / 500.0
    inside = np.maximum(d - np.array(SURFACES)[place], 0.0)
    speed = np.gradient(d, time_s)
    force = np.array(stiffness)[place] * inside**1.5 * (1.0 + 0.02 * speed)
    noise = random.standard_normal((2, len(d)))
    table = np.column_stack([time_s, d + 2e-3 * noise[0], np.maximum(force, 0.0) + 5e-3 * noise[1]])
    header = "time_s,displacement_mm,force_N"
    np.savetxt(path, table, delimiter=",", header=header, comments="", fmt="%.9g")


def test_the_places_of_many_recordings_are_those_of_each(
    break_some: Callable[[Path], int], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Hc contacts --sites is the oracle."""
    folder, target = tmp_path / "in", tmp_path / "out"
    folder.mkdir()
    truth = {"a.csv": (0.3, 0.8), "b.csv": (0.5, 0.2)}
    for seed, (name, stiffness) in enumerate(truth.items()):
        press_two_places(folder / name, seed, stiffness)
    broken = break_some(folder)
    words = ["batch", str(folder), "-o", str(target), "-j", "1", "--sites", "--json"]
    assert main(words) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["without_result"] == broken
    assert str(target / "sites.csv") in summary["written"]
    sites, contacts = rows(target / "sites.csv"), rows(target / "contacts.csv")
    assert [(row["recording"], row["site [1]"]) for row in sites] == [
        (name, number) for name in truth for number in ("1", "2")
    ]
    for name, stiffness in truth.items():
        own = ["contacts", str(folder / name), "--sites", "-o", str(tmp_path / f"of_{name}")]
        assert main([*own, "--json"]) == 0
        expected = json.loads(capsys.readouterr().out)["sites"]
        found = [row for row in sites if row["recording"] == name]
        for row, one, true in zip(found, expected, stiffness, strict=True):
            assert float(row["stiffness [N/mm^n]"]) == one["parameters"]["stiffness"]
            assert float(row["stiffness [N/mm^n]"]) == pytest.approx(true, rel=0.05)
            assert float(row["surface [mm]"]) == one["surface_mm"]
            assert float(row["surface_std [mm]"]) == one["surface_std_mm"] > 0.0
        touches = rows(tmp_path / f"of_{name}")
        mine = [row for row in contacts if row["recording"] == name]
        assert [{key: row[key] for key in touches[0]} for row in mine] == touches
        counts = [sum(row["site [1]"] == n for row in touches) for n in ("1", "2")]
        assert [int(row["contacts [1]"]) for row in found] == counts
    # What an estimator knew in the end would be of the last place alone.
    for row in rows(target / "recordings.csv"):
        assert row["stiffness [N/mm^n]"] == row["contact_position [mm]"] == ""
    page = (target / "overview.html").read_text()
    assert "Each point is a place of a recording" in page
    for name in ("a.csv, site 1", "b.csv, site 2", "air.csv"):
        assert name in page
    assert "nan ±" not in page
    assert " --sites " in page  # the command that makes it again


def test_recordings_without_a_touch_that_counts_stay_on_the_page(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, target = tmp_path / "in", tmp_path / "out"
    folder.mkdir()
    press_two_places(folder / "a.csv", 0, (0.3, 0.8))
    words = ["batch", str(folder), "-o", str(target), "-j", "1", "--sites"]
    assert main([*words, "--minimum-force", "100"]) == 0
    assert (
        "1 recording: 1 result made, 0 kept, 0 without a result, 0 contacts"
        in capsys.readouterr().out
    )
    assert rows(target / "sites.csv") == []
    page = (target / "overview.html").read_text()
    assert "a.csv" in page
    assert "nan ±" not in page


def test_with_and_without_sites_are_other_results(
    make_recordings: MakeRecordings, call_it_another_study: Callable[[Path], None]
) -> None:
    folder = make_recordings(1)
    target = folder.parent / "out"
    words = ["batch", str(folder), "-o", str(target), "-j", "1", "--filter", "ukf"]
    assert main(words) == 0
    assert not (target / "sites.csv").exists()
    call_it_another_study(target)
    assert main([*words, "--resume", "--sites"]) == 0
    assert (target / "sites.csv").is_file()
    call_it_another_study(target)
    assert main([*words, "--resume"]) == 0
    assert not (target / "sites.csv").exists()  # of other results than those that are told now
    assert "site [1]" not in rows(target / "contacts.csv")[0]
