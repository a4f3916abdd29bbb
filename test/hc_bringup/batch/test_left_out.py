"""hc batch says which files of a folder it does not take for recordings."""

from __future__ import annotations

from pathlib import Path

import pytest

from hc_bringup.batch import sources
from hc_bringup.cli import main


def test_files_with_other_endings_are_not_left_out_silently(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Regression: of a folder with .lvm and .txt files the batch took the others without a word."""
    folder = tmp_path / "study"
    bag = folder / "bag"
    bag.mkdir(parents=True)
    names = ("a.csv", "b.lvm", "c.txt", "d.csv.gz", "notes.tex", "bag/metadata.yaml", "bag/x.db3")
    for name in names:
        (folder / name).write_text("time_s,displacement_mm,force_N\n0,0,0\n")
    (tmp_path / "out").mkdir()
    found = sources.find_recordings([str(folder), str(folder / "a.csv")], tmp_path / "out")
    assert [path.name for path in found.left_out] == ["b.lvm", "c.txt"]
    assert [path.name for path in found.recordings] == ["a.csv", "bag", "d.csv.gz"]
    named = sources.find_recordings([str(folder / "*.lvm"), str(folder)], tmp_path / "out")
    assert [path.name for path in named.left_out] == ["c.txt"]  # what is named is not left out
    main(["batch", str(folder), "--filter", "ukf", "-o", str(tmp_path / "results"), "-j", "1"])
    said = " ".join(capsys.readouterr().err.split())
    assert "left out for their ending: 2 (such as b.lvm, c.txt)" in said
    assert "'**/*.lvm'" in said


def test_what_has_to_be_unpacked_is_not_said_to_be_taken_by_a_pattern(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Regression: "others by a pattern in quotes: '**/*.zst'", by which not one had a result."""
    folder = tmp_path / "study"
    folder.mkdir()
    for name in ("a.csv", "b.csv.zst"):
        (folder / name).write_text("time_s,displacement_mm,force_N\n0,0,0\n")
    main(["batch", str(folder), "--filter", "ukf", "-o", str(tmp_path / "results"), "-j", "1"])
    said = " ".join(capsys.readouterr().err.split())
    assert "left out for their ending: 1 (such as b.csv.zst)" in said
    assert ".zst when it is unpacked (unzstd)" in said
    assert "pattern" not in said


def test_a_folder_is_walked_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Once for the recordings and once more for what is left out: minutes on a slow disk."""
    (tmp_path / "a.csv").write_text("time_s,displacement_mm,force_N\n0,0,0\n")
    walked: list[object] = []
    walk = sources.os.walk
    monkeypatch.setattr(sources.os, "walk", lambda folder: walked.append(folder) or walk(folder))
    main(["batch", str(tmp_path), "--filter", "ukf", "-o", str(tmp_path / "results"), "-j", "1"])
    assert walked.count(tmp_path) == 1
