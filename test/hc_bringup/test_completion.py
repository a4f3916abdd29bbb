"""Shells complete the words of hc."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from hc_bringup.cli import main

BINARIES = str(Path(sys.executable).parent)


def complete(lines: list[str], folder: Path) -> list[list[str]]:
    """What bash offers for each line with the cursor at its end."""
    script = (
        'eval "$(hc completion bash)"; COMP_TYPE=9; for COMP_LINE; do COMP_POINT=${#COMP_LINE}; '
        'COMPREPLY=(); _python_argcomplete hc; echo "${COMPREPLY[@]}"; done'
    )
    done = subprocess.run(
        ["bash", "--norc", "-c", script, "bash", *lines],
        cwd=folder,
        env=os.environ | {"PATH": f"{BINARIES}:{os.environ['PATH']}"},
        capture_output=True,
        text=True,
        timeout=100,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return [line.split() for line in done.stdout.splitlines()]


@pytest.mark.skipif(shutil.which("bash") is None, reason="there is no bash")
def test_bash_completes_commands_options_and_files(tmp_path: Path) -> None:
    (tmp_path / "presses.csv").touch()
    lines = ["hc est", "hc estimate --fi", "hc estimate pre", "hc bag conv"]
    commands, options, files, actions = complete(lines, tmp_path)
    assert commands == ["estimate"]
    assert {"--filter", "--find-surface"} <= set(options)
    assert files == ["presses.csv"]
    assert actions == ["convert"]


@pytest.mark.skipif(shutil.which("bash") is None, reason="there is no bash")
def test_bash_completes_what_only_the_suite_knows(tmp_path: Path) -> None:
    (tmp_path / "robots_of_mine.yaml").touch()
    lines = ["hc estimate x.csv --filter rw", "hc run --scenario palp", "hc run robot"]
    lines += ["hc estimate x.csv --preset robots/b", "hc simulate tissue_"]
    filters, scenarios, runs, presets, simulated = complete(lines, tmp_path)
    assert filters == ["rwstukf"]
    assert scenarios == ["palpation_scan"]
    assert {"robot_run", "robots/franka", "robots_of_mine.yaml"} <= set(runs)
    assert "robots/texture_analyser" not in runs
    assert presets == ["robots/bench_indenter"]
    assert simulated == ["tissue_change"]


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_every_shell_gets_a_script(shell: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["completion", shell]) == 0
    told = capsys.readouterr().out
    assert "_ARGCOMPLETE" in told
    syntax = {"bash": ["bash", "-n"], "zsh": ["zsh", "-n"], "fish": ["fish", "--no-execute"]}[shell]
    if shutil.which(syntax[0]):
        done = subprocess.run(syntax, input=told, text=True, capture_output=True, check=False)
        assert done.returncode == 0, done.stderr


def test_another_shell_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["completion", "tcsh"])
    assert ended.value.code == 2
    assert capsys.readouterr().err.count("\n") == 1
