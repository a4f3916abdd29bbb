"""Tests of several cycles, of which each counts its time anew, as testing machines write them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hc_logger import csv_rows
from hc_logger.recording import read_recording

STEP_S, ROWS = 0.02, 200


def cycles(*starts: float, head: str = "Cycle,Time (s),Extension (mm),Load (N)") -> str:
    lines = [head]
    for number, start in enumerate(starts, 1):
        for k in range(ROWS):
            lines.append(f"{number},{start + STEP_S * k:.3f},{0.01 * k:.3f},{0.02 * k:.3f}")
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize("block_rows", [65536, 150])
def test_cycles_are_put_one_behind_the_other(
    tmp_path: Path, block_rows: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Regression: they lay upon one another, and each lost the first 49 samples of its cycle."""
    monkeypatch.setattr(csv_rows, "BLOCK_ROWS", block_rows)
    path = tmp_path / "cyclic.csv"
    path.write_text(cycles(0.0, 0.0, STEP_S))
    recording = read_recording(path)
    one = STEP_S * np.arange(ROWS)
    length = one[-1] + 1.0
    expected = np.concatenate([one, one + length, one + 2.0 * length])
    np.testing.assert_allclose(recording.time_s, expected, atol=1e-9)
    said = "\n".join(recording.findings.lines())
    assert "the time begins anew 2 times: cycles of one test" in said
    assert "before that of the row before" not in said


def test_a_clock_that_was_set_back_is_no_new_cycle(tmp_path: Path) -> None:
    """What goes back to elsewhere is data: the estimator refuses it, or takes it for a clock."""
    path = tmp_path / "back.csv"
    path.write_text(cycles(0.0, 2.0))
    recording = read_recording(path)
    assert recording.time_s[ROWS] == 2.0
    assert "the clock was set back (a driver" in "\n".join(recording.findings.lines())


def test_our_own_files_are_read_as_they_stand(tmp_path: Path) -> None:
    path = tmp_path / "own.csv"
    path.write_text(cycles(0.0, 0.0, head="number,time_s,displacement_mm,force_N"))
    assert read_recording(path).time_s[ROWS] == 0.0
