"""Filters and commands from packages outside the tree; hc new filter makes one."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from hc_bringup.cli import main


def install(folder: Path, name: str, points: str) -> None:
    """What pip would leave: the entry points of a package."""
    info = folder / f"{name}-0.1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 0.1\n")
    (info / "entry_points.txt").write_text(points)


def run(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    environment = os.environ | {
        "PYTHONPATH": str(folder),
        "NUMBA_CACHE_DIR": str(folder / "cache"),
        "COLUMNS": "100",
    }
    return subprocess.run(
        [sys.executable, *words],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        timeout=500,
        check=False,
    )


def test_a_command_of_another_package_and_one_that_is_broken(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(
        'HELP = "say something"\n'
        'def configure(parser):\n    parser.add_argument("--word", default="hello")\n'
        "def run(arguments):\n    print(arguments.word)\n    return 3\n"
    )
    points = "[hc.commands]\nhello = mine\n"
    install(tmp_path, "mine", points)
    done = run(tmp_path, "-m", "hc_bringup", "hello", "--word", "salve")
    assert (done.returncode, done.stdout) == (3, "salve\n"), done.stderr
    assert "say something" in run(tmp_path, "-m", "hc_bringup", "--help").stdout
    install(tmp_path, "broken", "[hc.commands]\nbad = nowhere\n")
    done = run(tmp_path, "-m", "hc_bringup", "bad")
    assert done.returncode != 0
    assert done.stderr.count("\n") == 1
    assert "nowhere" in done.stderr
    assert run(tmp_path, "-m", "hc_bringup", "hello").returncode == 3


def test_a_filter_that_cannot_be_loaded_says_why_and_disturbs_nobody(tmp_path: Path) -> None:
    (tmp_path / "recording.csv").write_text("time_s,displacement_mm,force_N\n0,1,2\n")
    install(tmp_path, "a", "[hc.filters]\nbad = nowhere:ENTRY\nukf = os:path\nodd = os:path\n")
    command = ("-m", "hc_bringup", "estimate", "recording.csv", "--filter")
    done = run(tmp_path, *command, "bad")
    assert done.returncode == 2
    assert "filter bad cannot be used: nowhere:ENTRY: ModuleNotFoundError" in done.stderr
    assert "os:path is a module, no FilterEntry" in run(tmp_path, *command, "odd").stderr
    code = (
        "from hc_estimator.filters.registry import FILTERS, PROBLEMS; print(len(FILTERS), PROBLEMS)"
    )
    done = run(tmp_path, "-c", code)
    assert done.returncode == 0
    assert "'ukf': 'a filter of that name is there already, not os:path'" in done.stdout


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["Filter"], "'Filter' is no name for a package"),
        (["class"], "'class' is no name"),
        (["ukf"], "there is a filter ukf already"),
        (["mine", "-o", "there"], "there exists already"),
    ],
)
def test_a_name_that_does_not_do_is_one_line(tmp_path, monkeypatch, capsys, words, expected):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "there").mkdir()
    assert main(["new", "filter", *words]) == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert expected in told


def test_a_new_filter_is_a_whole_package(tmp_path, capsys):
    folder = tmp_path / "held_ekf"
    assert main(["new", "filter", "held_ekf", "-o", str(folder)]) == 0
    assert "hc estimate RECORDING --filter held_ekf" in capsys.readouterr().out
    files = sorted(str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file())
    assert files == [
        "README.md",
        "held_ekf/__init__.py",
        "held_ekf/entry.py",
        "held_ekf/kernel.py",
        "pyproject.toml",
        "test/test_held_ekf.py",
    ]
    for file in folder.rglob("*.py"):
        text = file.read_text()
        assert "NAME" not in text
        compile(text, str(file), "exec")
    checked = subprocess.run(
        [sys.executable, "-m", "ruff", "check", "--isolated", "--line-length=100", str(folder)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert checked.returncode == 0, checked.stdout


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_the_new_filter_works_and_its_tests_pass(tmp_path: Path) -> None:
    assert main(["new", "filter", "held_ekf", "-o", str(tmp_path / "held_ekf_package")]) == 0
    package = tmp_path / "held_ekf_package"
    install(package, "held_ekf", "[hc.filters]\nheld_ekf = held_ekf.entry:ENTRY\n")
    done = run(package, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test")
    assert "3 passed" in done.stdout, done.stdout[-3000:]
    time_s = np.arange(0.0, 3.0, 0.002)
    depth = 2.0 - 1.5 * np.cos(7.0 * time_s)
    force = 0.5 * depth**1.5 * (1.0 + 0.04 * 10.5 * np.sin(7.0 * time_s))
    rows = "\n".join(f"{t},{d},{f}" for t, d, f in zip(time_s, depth, force, strict=True))
    (package / "presses.csv").write_text(f"time_s,displacement_mm,force_N\n{rows}\n")
    done = run(
        package, "-m", "hc_bringup", "estimate", "presses.csv", "--filter", "held_ekf", "--json"
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["filter"] == "held_ekf"
    assert found["parameters"]["stiffness"] == pytest.approx(0.5, rel=0.1)
