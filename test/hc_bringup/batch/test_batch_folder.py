"""hc batch: a folder holds the results of one study, and one process works in it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from hc_bringup.cli import main

MakeRecordings = Callable[..., Path]


def batch(*words: object) -> int:
    return main(["batch", *map(str, words), "--filter", "ukf", "-j", "1"])


def contents(folder: Path) -> dict[str, bytes]:
    files = sorted(p for p in folder.rglob("*") if p.is_file())
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in files}


@pytest.mark.parametrize(
    "words", [["--param", "force_noise_std=0.03"], ["--minimum-depth", "0.5"], ["--sites"]]
)
def test_resume_does_not_replace_the_tables_of_another_study(
    make_recordings: MakeRecordings,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    words: list[str],
) -> None:
    """Regression: one --resume with another setting replaced a finished study without a word."""
    folder, target = make_recordings(1), tmp_path / "out"
    assert batch(folder, "-o", target) == 0
    before = contents(target)
    capsys.readouterr()
    assert batch(folder, "-o", target, "--resume", *words) == 2
    said = capsys.readouterr().err
    assert "holds another study, whose tables would be replaced: choose another folder" in said
    assert f"hc batch {folder} --filter ukf -o DIR" in said
    assert contents(target) == before
    assert batch(folder, "-o", target, "--resume", "--estimates") == 0  # more of the same


@pytest.mark.process
def test_two_do_not_work_in_one_folder(
    make_recordings: MakeRecordings,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    processes: Any,
) -> None:
    """Regression: both said that they had written the tables; and a lock must not stay behind."""
    folder, target = make_recordings(1), tmp_path / "out"
    target.mkdir()
    (tmp_path / "link").symlink_to(target)
    here = target.stat()
    holds = (
        "import sys, time; from hc_bringup.named_lock import take\n"
        "lock = take(sys.argv[1]); print('held', flush=True); time.sleep(600)"
    )
    name = f"hc_batch_in_folder_{here.st_dev}_{here.st_ino}"
    other = processes.start("-c", holds, name)
    try:
        assert other.stdout.readline() == "held\n"
        assert batch(folder, "-o", tmp_path / "link") == 1
        assert f"process {other.pid} works in" in capsys.readouterr().err
        assert not list(target.iterdir())
    finally:
        other.kill()
        other.wait()
    assert batch(folder, "-o", target) == 0


def test_a_batch_without_any_result_is_a_failure(tmp_path: Path) -> None:
    """Regression: status 0, and a script went on with empty tables."""
    for name in ("a.csv", "b.csv"):
        (tmp_path / name).write_text("")
    assert batch(tmp_path / "a.csv", tmp_path / "b.csv", "-o", tmp_path / "out") == 1
    assert (tmp_path / "out" / "recordings.csv").is_file()
