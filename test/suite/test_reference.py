"""docs/reference/ says what the programs say of themselves."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from hc_bringup.reference import PAGES, main

REFERENCE = Path(__file__).resolve().parents[2] / "docs" / "reference"


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The pages of now. A process of its own: the nodes are made with the usual parameters."""
    folder = tmp_path_factory.mktemp("reference")
    environment = os.environ | {"ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF"}
    subprocess.run(
        [sys.executable, "-m", "hc_bringup.reference", str(folder)],
        env=environment,
        check=True,
        timeout=100,
        capture_output=True,
    )
    return folder


@pytest.mark.process
@pytest.mark.parametrize("name", PAGES)
def test_the_page_is_current(name: str, written: Path) -> None:
    now = (written / name).read_text(encoding="utf-8")
    there = (REFERENCE / name).read_text(encoding="utf-8")
    assert there == now, "run: .venv/bin/python -m hc_bringup.reference docs/reference"


@pytest.mark.parametrize("words", [[], ["--help"], ["-h"]])
def test_a_word_that_is_no_folder_is_not_made_one(
    words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Regression: --help made a folder of that name."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.argv", ["reference", *words])
    with pytest.raises(SystemExit, match="usage: python -m hc_bringup"):
        main()
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
@pytest.mark.process
def test_nothing_waits_for_the_filters_to_be_compiled(tmp_path: Path) -> None:
    """Minutes, for all of them; whoever edits a description of a parameter has an old cache."""
    environment = os.environ | {
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF",
        "NUMBA_CACHE_DIR": str(tmp_path / "cold"),
    }
    subprocess.run(
        [sys.executable, "-m", "hc_bringup.reference", str(tmp_path)],
        env=environment,
        check=True,
        timeout=110,
        capture_output=True,
    )
    compiled = {file.name.split(".")[0] for file in tmp_path.glob("cold/**/*.nbc")}
    assert "rbpf" not in compiled  # the last one of them
    assert (tmp_path / "parameters.md").exists()
