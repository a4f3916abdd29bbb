"""The tree is a valid colcon workspace, and messages build in it against the ROS wheels."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
COLCON = Path(sys.executable).with_name("colcon")
PACKAGES = {
    "hc_bringup": "ros.ament_python",
    "hc_estimator": "ros.ament_python",
    "hc_evaluation": "ros.ament_python",
    "hc_logger": "ros.ament_python",
    "hc_msgs": "ros.ament_cmake",
    "hc_msgs_py": "ros.ament_python",
    "hc_sim_rig": "ros.ament_python",
}


def colcon(*words: str, folder: Path) -> subprocess.CompletedProcess[str]:
    environment = {
        **os.environ,
        "AMENT_PREFIX_PATH": sys.prefix,
        "CMAKE_PREFIX_PATH": sys.prefix,
        "COLCON_HOME": str(folder / "home"),
        "PATH": f"{COLCON.parent}:{os.environ['PATH']}",
    }
    environment.pop("PYTHONSAFEPATH", None)
    return subprocess.run(
        [COLCON, "--log-base", str(folder / "log"), *words],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        timeout=280,
        check=False,
    )


def test_colcon_sees_seven_ros_packages(tmp_path: Path) -> None:
    done = colcon("list", "--base-paths", str(ROOT / "src"), folder=tmp_path)
    assert done.returncode == 0, done.stderr
    found = {}
    for line in done.stdout.splitlines():
        name, _, kind = line.split("\t")
        found[name] = kind.strip("()")
    assert found == PACKAGES


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_colcon_builds_messages_and_what_uses_them(tmp_path: Path) -> None:
    done = colcon(
        *("build", "--base-paths", str(ROOT / "src"), "--packages-up-to", "hc_msgs_py"),
        "--cmake-args",
        f"-DCMAKE_PROJECT_hc_msgs_INCLUDE={ROOT / 'src/hc_msgs/wheels_fix.cmake'}",
        f"-DPython3_EXECUTABLE={sys.executable}",
        "-DBUILD_TESTING=OFF",
        folder=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    assert "Summary: 2 packages finished" in done.stdout
    messages = tmp_path / "install" / "hc_msgs"
    assert list(messages.rglob("_indenter_sample.py"))
    assert (messages / "share/hc_msgs/msg/IndenterSample.msg").is_file()
    assert list((tmp_path / "install" / "hc_msgs_py").rglob("topics.py"))
