"""Byte code that a full disk cut off: the next command makes it anew, and no more is written."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from hc_bringup import byte_code
from hc_bringup.guard import explain

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = [str(path) for path in (ROOT / "src").glob("hc_*")]


@pytest.fixture
def environment(tmp_path: Path) -> Path:
    """A checkout's environment whose Python is this one, with the packages of this checkout."""
    folder = tmp_path / ".venv"
    (folder / "bin").mkdir(parents=True)
    python = folder / "bin" / "python"
    python.symlink_to(Path(sys.base_prefix) / "bin" / f"python3.{sys.version_info.minor}")
    (folder / "pyvenv.cfg").write_text(f"home = {sys.base_prefix}/bin\n")
    hc = folder / "bin" / "hc"
    hc.write_text(f"#!{python}\nimport sys\nfrom hc_bringup.entry import main\nsys.exit(main())\n")
    hc.chmod(0o755)
    (tmp_path / "hc").write_text(_start_only())
    (tmp_path / "hc").chmod(0o755)
    return folder


def _start_only() -> str:
    """Return ./hc for an environment that is there and current."""
    text = (ROOT / "hc").read_text()
    making = text.index("if ! is_current environment ||")
    return text[:making] + text[text.index("# A start takes the marker") :]


def _version(environment: Path) -> subprocess.CompletedProcess[str]:
    paths = [*PACKAGES, *(path for path in sys.path if path.endswith("-packages"))]
    return subprocess.run(
        [environment.parent / "hc", "--version"],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
        capture_output=True,
        text=True,
        timeout=120,
    )


def _cut_off(environment: Path, name: str) -> None:
    """Leave the beginning of a module's byte code, as Python 3.11 does on a full disk."""
    (file,) = (environment / "byte_code").rglob(f"{name}.cpython-*.pyc")
    file.write_bytes(file.read_bytes()[:100])


def test_a_module_that_was_cut_off_is_made_anew_at_once(environment: Path) -> None:
    assert _version(environment).returncode == 0
    _cut_off(environment, "hc_bringup/last_resort")
    done = _version(environment)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout


def test_a_python_that_did_not_reach_our_code_is_healed_by_the_next_start(
    environment: Path,
) -> None:
    assert _version(environment).returncode == 0
    _cut_off(environment, "hc_bringup/entry")
    assert _version(environment).returncode != 0
    healed = _version(environment)
    assert healed.returncode == 0
    assert "its byte code is made anew" in healed.stderr
    assert _version(environment).stderr == ""
    assert not list(environment.glob(".starting.*"))


def test_a_start_that_is_under_way_is_left_alone(environment: Path) -> None:
    (environment / f".starting.{os.getpid()}").touch()
    assert _version(environment).stderr == ""


def test_a_command_that_meets_it_later_clears_it_and_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "byte_code"
    folder.mkdir()
    monkeypatch.setattr(sys, "prefix", str(tmp_path))
    monkeypatch.setattr(sys, "pycache_prefix", str(folder))
    line = str(explain(EOFError("marshal data too short"), ["report"]))
    assert "has been cleared: give the command once more" in line
    assert not folder.exists()


def test_a_folder_of_somebody_else_is_named_and_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "pycache_prefix", str(tmp_path))
    assert f"delete {tmp_path}" in byte_code.clear()
    assert tmp_path.exists()


def test_other_ends_of_files_are_no_byte_code() -> None:
    assert not byte_code.is_damaged(EOFError("Compressed file ended"))
    cause = ImportError("numpy")
    cause.__cause__ = EOFError("marshal data too short")
    assert byte_code.is_damaged(cause)


def test_nothing_is_written_where_a_file_may_not_grow(environment: Path) -> None:
    command = f"ulimit -f 40; exec {environment.parent / 'hc'} --version"
    paths = [*PACKAGES, *(path for path in sys.path if path.endswith("-packages"))]
    subprocess.run(
        ["sh", "-c", command],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
        check=True,
        capture_output=True,
        timeout=120,
    )
    assert not list((environment / "byte_code").rglob("hc_bringup/cli.*.pyc"))


def test_a_start_from_a_folder_that_was_deleted_is_one_line(environment: Path) -> None:
    """Regression: "missing: Python 3.10 to 3.13", and the next start made all byte code anew."""
    gone = environment.parent / "gone"
    gone.mkdir()
    start = f"cd {gone} && rmdir {gone} && exec {environment.parent / 'hc'} --version"
    done = subprocess.run(["sh", "-c", start], capture_output=True, text=True, timeout=60)
    assert done.returncode == 1
    said = done.stderr.splitlines()[-1]  # the shell itself may complain before
    assert said == "hc: the folder that you are in has been deleted: go to another one (cd)"
    assert not list(environment.glob(".starting.*"))
