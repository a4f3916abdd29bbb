"""Helpers: processes in a domain of their own, on this machine only, and hc within the test.

The latter is for many hostile files one after another.
"""

import json
import math
import os
import re
import shutil
import signal
import struct
import subprocess
import sys
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest

from hc_bringup import heartbeat
from hc_bringup.cli import main
from hc_bringup.commands.simulate import _write_bag
from hc_msgs_py.node_processes import Processes
from hc_sim_rig.rig import Rig
from hc_sim_rig.scenario import load_scenario

HEARTBEAT = re.compile(rf"^{re.escape(heartbeat.MARK)}.*\n", re.MULTILINE)
NAMES = "time_s,displacement_mm,force_N"
SHIM = Path(__file__).resolve().parents[1] / "clock_shim.c"


def is_node(process: Path) -> bool:
    """True if a process of hc_bringup.standby has become the node: nobody sends it a line more."""
    return os.readlink(process / "fd" / "0") == os.devnull


class CommandLine(Processes):
    """Runs hc as a process in one ROS domain."""

    def __init__(self, domain_id: int, folder: Path) -> None:
        super().__init__(domain_id, folder, COLUMNS="100")
        self.folder = folder

    def run(self, *words: str, timeout: float = 60.0) -> subprocess.CompletedProcess[str]:
        """Run a command to its end; what it says of itself on a busy machine is left out."""
        done = super().run("-m", "hc_bringup", *words, timeout_s=timeout)
        done.stderr = HEARTBEAT.sub("", done.stderr)
        return done

    def start(
        self, *words: str, module: str = "hc_bringup", through: Sequence[str] = ()
    ) -> subprocess.Popen[str]:
        """Start a command (or another module), through another program if given; it goes on."""
        return super().start("-m", module, *words, through=through)

    def node_process(self, module: str = "hc_estimator.node") -> int | None:
        """Return the process id of a node in this domain, None if none lives."""
        domain_id = self.environment["ROS_DOMAIN_ID"]
        for folder in Path("/proc").glob("[0-9]*"):
            try:
                command = (folder / "cmdline").read_bytes()
                environment = (folder / "environ").read_bytes()
                waits = b"hc_bringup.standby\0" in command and not is_node(folder)
            except OSError:
                continue
            mine = f"ROS_DOMAIN_ID={domain_id}\0".encode() in environment
            if mine and f"{module}\0".encode() in command and not waits:
                return int(folder.name)
        return None


@pytest.fixture
def command_line(ros_domain: int, tmp_path: Path) -> Iterator[CommandLine]:
    """A command line in a domain of its own; what it started is ended with the test."""
    line = CommandLine(ros_domain, tmp_path)
    yield line
    line.close(signal.SIGKILL)


@pytest.fixture
def other_command_line(other_domain: int, tmp_path: Path) -> Iterator[CommandLine]:
    """A second one in the same folder, in another domain."""
    line = CommandLine(other_domain, tmp_path)
    yield line
    line.close(signal.SIGKILL)


@pytest.fixture
def set_clock(command_line, tmp_path: Path):
    """Preload a clock into what the command line starts, and return what sets it [s]."""
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("needs cc, to compile test/clock_shim.c")
    library = tmp_path / "clock.so"
    command = [compiler, "-shared", "-fPIC", "-O2", "-o", library, SHIM, "-ldl"]
    built = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert built.returncode == 0, built.stderr
    offset = tmp_path / "offset"
    offset.write_bytes(bytes(8))
    command_line.environment |= {"LD_PRELOAD": str(library), "HC_TEST_CLOCK": str(offset)}

    def set_to(seconds: float) -> None:
        with offset.open("r+b", buffering=0) as file:
            file.write(struct.pack("<q", round(seconds * 1e9)))

    return set_to


SECONDS_A_FILE = 20.0


def numbers_are_results(status: int, out: str) -> bool:
    """Whether a summary is all numbers where it says that it is one."""
    if status:
        return True
    summary = json.loads(out)
    results = [*summary["parameters"].values(), *summary["parameters_std"].values()]
    results += [summary[n] for n in ("force_predicted_rmse_n", "nis_mean")]
    return all(isinstance(value, (int, float)) for value in results)


class Shell:
    """Runs hc in this process and judges how it ended; failures are counted, not raised."""

    def __init__(self, capsys: pytest.CaptureFixture[str]) -> None:
        self._capsys = capsys
        self.failures: list[str] = []

    def __call__(self, *words: object) -> tuple[int, str, str]:
        begin = time.process_time()  # a busy machine is not the file's fault
        with warnings.catch_warnings():
            warnings.simplefilter("error", RuntimeWarning)
            try:
                status = main([str(word) for word in words])
            except SystemExit as end:
                status = int(end.code or 0)
        seconds = time.process_time() - begin
        out, err = self._capsys.readouterr()
        last = err.splitlines()[-1] if err else ""
        good = (
            status in (0, 1, 2)
            and "internal error" not in err
            and "Traceback" not in err + out
            and (status == 0 or last.startswith(f"hc {words[0]}: ") or "recomputed, " in out)
            and seconds < SECONDS_A_FILE
        )
        if "--json" in words and words[0] == "estimate":
            good = good and numbers_are_results(status, out)
        if not good:
            self.failures.append(f"hc {words[0]}: {status} in {seconds:.1f} s: {err[-400:]!r}")
        return status, out, err


@pytest.fixture
def shell(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    shell = Shell(capsys)
    yield shell
    assert shell.failures == []


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a sound bag, its CSV and its files, to be damaged in copies."""
    folder = tmp_path_factory.mktemp("good")
    series = Rig(load_scenario("multisine"), 1).run(1.5)
    _write_bag(folder / "bag", series, "multisine")
    table = np.column_stack([series.time_s, series.displacement_mm, series.force_n])
    np.savetxt(
        folder / "good.csv",
        table,
        delimiter=",",
        header="time_s,displacement_mm,force_N",
        comments="",
        fmt="%.6f",
    )
    return folder


@pytest.fixture(scope="session")
def install():
    """Makes a folder look as pip leaves it: the entry points of a package."""

    def leave(folder: Path, name: str, points: str) -> None:
        """What pip would leave: the entry points of a package."""
        info = folder / f"{name}-0.1.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 0.1\n")
        (info / "entry_points.txt").write_text(points)

    return leave


@pytest.fixture(scope="session")
def run():
    """Runs Python with the packages of a folder."""

    def start(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
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

    return start


PRESSED = {"stiffness": 0.5, "damping": 0.015, "displacement_exponent": 1.5}
"""Of the tissue below, which never pulls; the speed's exponent is 1."""


def _reading(time_s: float) -> tuple[float, float]:
    depth = 3.0 + 1.5 * math.sin(9.0 * time_s) + 0.5 * math.sin(31.0 * time_s)
    speed = 13.5 * math.cos(9.0 * time_s) + 15.5 * math.cos(31.0 * time_s)
    stiffness, damping, exponent = PRESSED.values()
    return depth, depth**exponent * (stiffness + damping * speed)


@pytest.fixture(scope="session")
def reading() -> Callable[[float], tuple[float, float]]:
    """Give the true displacement [mm] and force [N] at a time [s]."""
    return _reading


@pytest.fixture
def press_table(tmp_path: Path) -> Callable[..., Path]:
    """Write two seconds of presses; `change` makes of time, depth and force what the file has."""

    def write(name: str, change: Callable[..., tuple], names: str = NAMES) -> Path:
        rows = [change(k * 1e-3, *_reading(k * 1e-3)) for k in range(2000)]
        path = tmp_path / name
        path.write_text(f"{names}\n" + "".join(",".join(map(repr, row)) + "\n" for row in rows))
        return path

    return write
