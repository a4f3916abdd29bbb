"""Logs of the ROS layer where the home, or the folder that was named for them, takes no file."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from hc_msgs_py.middleware import set_defaults

NOWHERE = "/proc/nobody"
SET = ("ROS_AUTOMATIC_DISCOVERY_RANGE", "FASTRTPS_DEFAULT_PROFILES_FILE", "ROS_LOCALHOST_ONLY")


@pytest.fixture
def clean(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> pytest.MonkeyPatch:
    for name in SET:  # what was set comes back at the end
        monkeypatch.setenv(name, os.environ.get(name, ""))
    for name in ("ROS_LOG_DIR", "ROS_HOME"):
        monkeypatch.setenv(name, "")  # counts as not set
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "tmp"))
    return monkeypatch


def chosen() -> str | None:
    set_defaults()
    return os.environ.get("ROS_LOG_DIR")


def test_a_home_that_takes_files_is_left_as_it_is(clean: pytest.MonkeyPatch) -> None:
    assert chosen() == ""


@pytest.mark.parametrize(("name", "below"), [("ROS_LOG_DIR", ""), ("ROS_HOME", "/log")])
def test_a_named_folder_that_takes_none_is_told(
    clean: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], name: str, below: str
) -> None:
    clean.setenv(name, NOWHERE)
    folder = chosen()
    said = capsys.readouterr().err
    assert folder is not None
    assert said.startswith(f"{name}: cannot write to {NOWHERE}{below} (")
    assert said.endswith(f"; logs go to {folder}\n")


def test_ros_starts_without_a_home_to_write_to(clean: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Regression: "internal error: RCLError: failed to initialize logging", to be reported."""
    clean.setenv("HOME", NOWHERE)
    clean.setenv("TMPDIR", str(tmp_path))
    code = (
        "from hc_msgs_py.middleware import set_defaults; set_defaults(); import rclpy;"
        "rclpy.init(); rclpy.create_node('a_node'); print('started')"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.stdout == "started\n", done.stderr
    assert "nobody" not in done.stderr


def test_pictures_are_drawn_without_a_home_to_write_to(
    clean: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Regression: two lines of Matplotlib about its folder."""
    clean.setenv("HOME", NOWHERE)
    clean.setenv("TMPDIR", str(tmp_path))
    for name in ("MPLCONFIGDIR", "XDG_CONFIG_HOME", "XDG_CACHE_HOME"):
        clean.delenv(name, raising=False)
    code = (
        "from hc_msgs_py.warnings_of_others import ignore_those_of_others as ignore; ignore();"
        "import matplotlib.pyplot; print('drawn')"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=100, check=False
    )
    assert (done.stdout, done.stderr) == ("drawn\n", "")
