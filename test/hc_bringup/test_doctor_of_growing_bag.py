"""A bag that is being recorded is nothing wrong: its verdict is that of what is there so far."""

from __future__ import annotations

import fcntl
import json
import os
from pathlib import Path

import numpy as np
import pytest

from hc_bringup.cli import main
from hc_logger.convert import csv_to_bag
from hc_logger.recording import read_recording


@pytest.fixture(scope="module")
def cut(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A bag of eight seconds of presses on a tissue, of which the end is missing."""
    folder = tmp_path_factory.mktemp("growing")
    time_s = np.arange(0.0, 8.0, 0.002)
    slow, quick = np.cos(2.0 * np.pi * 0.5 * time_s), np.cos(2.0 * np.pi * 2.0 * time_s)
    depth = 2.0 - 1.5 * slow - 0.6 * quick
    speed = np.gradient(depth, time_s)
    touching = np.maximum(depth, 0.0)
    noise = np.random.default_rng(1).normal(0.0, 1e-3, (2, len(time_s)))
    force = np.where(depth > 0.0, touching**1.4 * (0.5 + 0.02 * speed), 0.0) + noise[0]
    rows = np.column_stack([time_s, depth + noise[1], force])
    table = folder / "press.csv"
    np.savetxt(table, rows, delimiter=",", header="time_s,displacement_mm,force_N", comments="")
    csv_to_bag(table, folder / "bag")
    (file,) = (folder / "bag").glob("*.mcap")
    (folder / "bag" / "metadata.yaml").unlink()
    os.truncate(file, file.stat().st_size - 100)
    return file


def verdict(capsys: pytest.CaptureFixture[str], bag: Path) -> tuple[int, list[str], list[str]]:
    status = main(["doctor", str(bag), "--json"])
    told = json.loads(capsys.readouterr().out)
    return status, [finding["what"] for finding in told["findings"]], told["notes"]


def test_a_bag_that_is_being_recorded_has_a_note_and_no_finding(
    cut: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Regression: "1 finding(s): ... is being recorded", and status 1."""
    growing = f"{cut.name}: is being recorded: its first {cut.stat().st_size} bytes were read"
    with cut.open("rb") as recorder:
        fcntl.flock(recorder, fcntl.LOCK_EX)
        status, findings, notes = verdict(capsys, cut.parent)
        assert growing not in findings
        assert growing in notes
        recording = read_recording(cut.parent)
        assert recording.findings.problems == ()
        assert growing in recording.findings.lines()
        assert main(["contacts", str(cut.parent), "-o", str(tmp_path / "contacts.csv")]) == 0
        assert growing in capsys.readouterr().err
    assert (status, findings) == (0, [])


def test_one_that_was_cut_off_has_a_finding(cut: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, findings, notes = verdict(capsys, cut.parent)
    assert status == 1
    assert any("cut off" in finding for finding in findings)
    assert not any("recorded" in note for note in notes)
