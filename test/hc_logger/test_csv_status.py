"""Status words of a force sensor in a CSV file: a force that the sensor itself disowns is none."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hc_logger.csv_file import CsvReader
from hc_logger.recording import read_recording

NAMES = "{},F/T Sequence,Fz (N),Time (s),Depth (mm)\n"
BROKEN, LATCHED = range(300, 331), range(400, 411)


def table(
    head: str = "Status (hex)", row: str = "{0},{1},{2:.4f},{3:.4f},{4:.4f}", healthy: str = "0x0"
) -> str:
    lines = []
    for i in range(1000):
        word = "0x80020000" if i in BROKEN else "0x00010000" if i in LATCHED else healthy
        force = 0.0 if i in BROKEN else 0.4 + 0.1 * np.sin(0.02 * i)
        lines.append(row.format(word, i, force, 0.005 * i, 2.0 + np.sin(0.02 * i)))
    return NAMES.format(head) + "\n".join(lines) + "\n"


def check(path: Path) -> str:
    recording = read_recording(path)
    assert np.array_equal(np.flatnonzero(np.isnan(recording.force_n)), BROKEN)
    assert np.isfinite(recording.displacement_mm).all()
    return "\n".join(recording.findings.lines())


@pytest.mark.parametrize("head", ["Status (hex)", "status_hex", "Status Code [Hex]"])
def test_forces_that_the_sensor_disowns_are_left_out_and_that_is_said(
    tmp_path: Path, head: str
) -> None:
    """They were read as they stand: zeros in the midst of a press."""
    path = tmp_path / "ati.csv"
    path.write_text(table(head))
    said = check(path)
    assert "status tells an error in 31 rows (the first in line 302: 0x80020000)" in said


def test_semicolons_and_words_without_a_prefix(tmp_path: Path) -> None:
    path = tmp_path / "ati.csv"
    path.write_text(table(healthy="00000000").replace(",", ";").replace("0x", "").replace(".", ","))
    assert "(the first in line 302: 80020000)" in check(path)


def test_a_file_with_our_names_and_a_status(tmp_path: Path) -> None:
    path = tmp_path / "ati.csv"
    path.write_text(table().replace("Fz (N),Time (s),Depth (mm)", "force_N,time_s,displacement_mm"))
    assert "in 31 rows" in check(path)


def test_a_sensor_that_is_well_is_not_spoken_of(tmp_path: Path) -> None:
    path = tmp_path / "ati.csv"
    path.write_text(table().replace("0x80020000", "0x0"))
    recording = read_recording(path)
    assert np.isfinite(recording.force_n).all()
    assert "status" not in "\n".join(recording.findings.lines())


def test_another_status_is_none_of_a_force_sensor(tmp_path: Path) -> None:
    """A machine's status may be any number: 1 while it runs, say."""
    path = tmp_path / "machine.csv"
    path.write_text(table("Status").replace("0x", ""))
    reader = CsvReader(path)
    rows = np.concatenate(list(reader.blocks()))
    assert np.isfinite(rows).all()
    assert not any("status" in note for note in reader.notes)
