"""The end of every error: one line, a status, and a file with the traceback where it is a fault."""

import errno
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from hc_bringup import cli
from hc_bringup.commands import simulate
from hc_msgs_py.free_memory import NotEnoughMemoryError
from hc_msgs_py.node_processes import Processes, end

ROOT = Path(__file__).resolve().parents[2]
HC = [sys.executable, "-m", "hc_bringup"]


@pytest.fixture
def fault(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    """Let `hc simulate` raise what a test gives; files of tracebacks go to the test's folder."""
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))

    def run(error: BaseException) -> int:
        def fail(_arguments) -> int:
            raise error

        monkeypatch.setattr(simulate, "run", fail)
        return cli.main(["simulate"])

    return run


def test_a_fault_is_one_line_and_a_file(fault, capsys: pytest.CaptureFixture[str]) -> None:
    assert fault(ZeroDivisionError("a\nb\x1b[31m")) == 1
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert err.startswith(
        "hc simulate: internal error: ZeroDivisionError: a b [31m (where it arose"
    )
    path = Path(re.search(r"is in (\S+);", err)[1])
    text = path.read_text()
    assert "Traceback (most recent call last)" in text
    assert "hc 'simulate'" in text
    assert path.stat().st_mode & 0o777 == 0o600


@pytest.mark.parametrize(
    ("error", "line"),
    [
        (MemoryError(), "hc simulate: not enough memory for this (see ulimit -v)\n"),
        (NotEnoughMemoryError("cut it into parts"), "hc simulate: cut it into parts\n"),
        (PermissionError(13, "Permission denied", "/x"), "hc simulate: /x: Permission denied\n"),
        (BrokenPipeError(32, "Broken pipe"), ""),
        (KeyboardInterrupt(), ""),
    ],
)
def test_what_is_no_fault_of_the_suite_leaves_no_file(
    fault, capsys: pytest.CaptureFixture[str], tmp_path: Path, error: BaseException, line: str
) -> None:
    assert fault(error) in (0, 1, 130)
    assert capsys.readouterr().err == line
    assert list(tmp_path.iterdir()) == []


def test_a_fault_where_no_file_can_be_written(
    fault, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tempfile.tempdir", "/proc/nowhere")
    assert fault(ValueError("x")) == 1
    assert "could not be written down: No such file or directory" in capsys.readouterr().err


@pytest.mark.parametrize(("number", "ours"), [(errno.ENOSPC, False), (errno.EBADF, True)])
def test_what_the_machine_lacks_need_not_be_reported(
    fault, capsys: pytest.CaptureFixture[str], number: int, ours: bool
) -> None:
    assert fault(OSError(number, os.strerror(number))) == 1
    err = capsys.readouterr().err
    assert os.strerror(number) in err
    assert ("please report it" in err) == ours


def test_closed_streams_lead_nowhere_and_no_file_takes_their_number(tmp_path: Path) -> None:
    """Regression: the summary went into a file that was opened as number 1, or nowhere at all."""
    script = 'exec "$@" >&- 2>&- <&-'
    command = ["sh", "-c", script, "sh", sys.executable, "-m", "hc_bringup", "simulate"]
    target = tmp_path / "out.csv"
    status = subprocess.run(
        [*command, "multisine", "--duration", "0.1", "-o", str(target)], timeout=120, check=False
    ).returncode
    assert status == 0
    lines = target.read_text().splitlines()
    assert len(lines) == 101
    assert all(line.count(",") == lines[0].count(",") for line in lines)


def test_a_folder_that_was_deleted_is_one_line(tmp_path: Path) -> None:
    script = f'mkdir "{tmp_path}/gone"; cd "{tmp_path}/gone"; rmdir "{tmp_path}/gone"; exec "$@"'
    command = ["sh", "-c", script, "sh", sys.executable, "-m", "hc_bringup", "estimate", "/x.csv"]
    # Python itself fails at a path that is empty or relative to such a folder.
    given = filter(None, os.environ.get("PYTHONPATH", "").split(os.pathsep))
    paths = os.environ | {"PYTHONPATH": os.pathsep.join(map(os.path.abspath, given))}
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=120, check=False, env=paths
    )
    assert done.returncode == 1
    assert done.stderr == (
        "hc estimate: the folder where you are was deleted: change to another one\n"
    )


def run(*words: str, **options) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*HC, *words], capture_output=True, text=True, timeout=60, check=False, **options
    )


@pytest.mark.parametrize("unbuffered", ["", "1"])
@pytest.mark.parametrize("words", [["simulate"], ["simulate", "--help"], ["completion", "bash"]])
def test_a_full_standard_output_is_told(words: list[str], unbuffered: str) -> None:
    """Regression: unbuffered, help ended with 0, all else as a fault that is written down."""
    environment = os.environ | {"PYTHONUNBUFFERED": unbuffered}
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [*HC, *words], stdout=full, stderr=subprocess.PIPE, text=True, env=environment
        )
    assert done.returncode == 1
    assert done.stderr == f"hc {words[0]}: cannot write standard output: No space left on device\n"


def test_an_early_interrupt_is_quiet() -> None:
    """./hc blocks the interrupt until Python can answer it; python -m alone cannot."""
    with Processes(101) as processes:
        for after_ms in (0, 10, 30, 50, 70, 100, 150, 250, 350):
            process = processes.launch([ROOT / "hc", "node", "list"])
            time.sleep(after_ms * 1e-3)
            status, _, err = end(process)
            assert err == "", after_ms
            assert status in (-signal.SIGINT, 130), after_ms


@pytest.mark.process
@pytest.mark.parametrize(
    "module", ["hc_sim_rig.node", "hc_estimator.node", "hc_logger.recorder_node"]
)
def test_a_node_that_still_imports_ends_by_an_interrupt_without_a_word(
    ros_domain: int, module: str
) -> None:
    with Processes(ros_domain) as processes:
        for after_ms in (0, 100, 300, 600):
            # Python tells what it has imported: before that module it answers in its own way.
            process = processes.launch([sys.executable, "-X", "importtime", "-m", module])
            assert process.stderr is not None
            while "hc_msgs_py.starting" not in process.stderr.readline():
                assert process.poll() is None
            time.sleep(after_ms * 1e-3)
            process.send_signal(signal.SIGINT)
            status, _, err = end(process)
            assert "Traceback" not in err, (after_ms, err)
            # The recorder needs a folder, and says so if it comes that far.
            assert status in (0, -signal.SIGINT) or "output is empty" in err, after_ms


def test_an_interrupt_noticed_while_its_error_is_told_is_quiet(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Regression: rclpy had made an error of the signal before Python's handler ran."""

    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    def broken(*_: object) -> None:
        raise RuntimeError

    monkeypatch.setattr("hc_bringup.cli._run", broken)
    monkeypatch.setattr("hc_bringup.cli.explain", interrupted)
    assert cli.main(["node", "list"]) == 130
    assert capsys.readouterr().err == ""


@pytest.mark.process
def test_without_a_home_the_graph_can_be_looked_at(ros_domain: int, tmp_path: Path) -> None:
    environment = {"PATH": os.environ["PATH"], "ROS_DOMAIN_ID": str(ros_domain)}
    done = run("node", "list", env=environment)
    assert (done.returncode, done.stdout, done.stderr) == (0, "no node is running\n", "")


@pytest.mark.slow
def test_any_file_name_works(tmp_path: Path) -> None:
    folder = os.fsencode(tmp_path) + b"/\xff \xc3\xa4 $b"
    os.mkdir(folder)
    environment = os.environ | {"LC_ALL": "POSIX"}
    csv, bag, page = (folder + b"/" + name for name in (b"\xfe.csv", b"\xfe", b"\xfe.html"))
    words: list[list[bytes]] = [
        [b"simulate", b"multisine", b"--duration", b"0.5", b"-o", csv],
        [b"bag", b"convert", csv, bag],
        [b"bag", b"info", bag],
        [b"estimate", bag, b"-o", folder + b"/\xfd.csv"],
        [b"report", bag, b"-o", page],
    ]
    for command in words:
        done = subprocess.run(
            [*(os.fsencode(w) for w in HC), *command],
            capture_output=True,
            timeout=60,
            env=environment,
        )
        assert b"internal error" not in done.stderr
        assert done.returncode == 0 or command[0] == b"estimate", done.stderr
    assert sorted(os.listdir(folder)) == [b"\xfd.csv", b"\xfe", b"\xfe.csv", b"\xfe.html"]
