"""Shells complete the words of hc."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from hc_bringup.cli import main

BINARIES = str(Path(sys.executable).parent)


def complete(line: str, folder: Path) -> list[str]:
    """What bash offers for a line with the cursor at its end."""
    script = (
        'eval "$(hc completion bash)"; COMP_LINE=$1; COMP_POINT=${#1}; COMP_TYPE=9; '
        '_python_argcomplete hc; printf "%s\\n" "${COMPREPLY[@]}"'
    )
    done = subprocess.run(
        ["bash", "--norc", "-c", script, "bash", line],
        cwd=folder,
        env=os.environ | {"PATH": f"{BINARIES}:{os.environ['PATH']}"},
        capture_output=True,
        text=True,
        timeout=100,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return [word.rstrip() for word in done.stdout.splitlines() if word]


@pytest.mark.skipif(shutil.which("bash") is None, reason="there is no bash")
def test_bash_completes_commands_options_and_files(tmp_path: Path) -> None:
    (tmp_path / "presses.csv").touch()
    assert complete("hc est", tmp_path) == ["estimate"]
    assert {"--filter", "--find-surface"} <= set(complete("hc estimate --fi", tmp_path))
    assert complete("hc estimate pre", tmp_path) == ["presses.csv"]
    assert complete("hc bag conv", tmp_path) == ["convert"]


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
