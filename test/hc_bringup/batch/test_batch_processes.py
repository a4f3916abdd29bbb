"""hc batch with real workers: killed, interrupted, refused; nothing is lost or comes twice."""

from __future__ import annotations

import csv
import json
import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from hc_bringup import heartbeat
from hc_bringup.batch import engines
from hc_bringup.batch.campaign import Campaign, has_pyarrow
from hc_bringup.batch.work import Answer, Task
from hc_bringup.cli import main
from hc_msgs_py.node_processes import Processes

pytestmark = [pytest.mark.slow, pytest.mark.process, pytest.mark.timeout(600)]
HC = (sys.executable, "-m", "hc_bringup", "batch")
RECORDINGS = 60
MakeRecordings = Callable[..., Path]


def contents(folder: Path) -> dict[str, bytes]:
    files = sorted(p for p in folder.rglob("*") if p.is_file())
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in files}


def plain(folder: Path, target: Path) -> dict[str, bytes]:
    """What one process makes of the recordings."""
    assert main(["batch", str(folder), "-o", str(target), "-j", "1", "--filter", "ukf"]) == 0
    return contents(target)


def complaints(error: str) -> list[str]:
    """What was said on standard error, but for the progress of a slow machine."""
    return [line for line in error.splitlines() if not line.startswith(heartbeat.MARK)]


def results(folder: Path) -> int:
    return len(list(folder.glob("results/*/*.json")))


def wait(condition: Callable[[], Any], what: str, seconds: float = 240.0) -> Any:
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if found := condition():
            return found
        time.sleep(0.02)
    pytest.fail(f"not within {seconds:.0f} s: {what}")


def children(parent: int) -> list[int]:
    """Processes that a process started, those that work for it rather than watch."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                words = (entry / "stat").read_text().rsplit(")", 1)[1].split()
                name = (entry / "cmdline").read_text()
            except OSError:
                continue
            if int(words[1]) == parent and "resource_tracker" not in name:
                found.append(int(entry.name))
    return found


@pytest.fixture
def started() -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """Function (*words) -> a process; ended with the test."""
    processes = Processes(None)
    yield lambda *words: processes.launch([*map(str, words)])
    processes.close(signal.SIGKILL)


def test_a_killed_process_of_this_machine_loses_nothing(
    make_recordings: MakeRecordings,
    tmp_path: Path,
    started: Callable[..., subprocess.Popen[str]],
) -> None:
    folder, target = make_recordings(RECORDINGS, 4.0), tmp_path / "two"
    process = started(*HC, folder, "-o", target, "-j", 2, "--filter", "ukf", "--json")
    wait(lambda: results(target) >= 3, "the first results")
    os.kill(children(process.pid)[0], signal.SIGKILL)
    out, error = process.communicate(timeout=400)
    assert process.returncode == 0, error
    assert json.loads(out)["made"] == RECORDINGS
    assert "Traceback" not in error
    assert contents(target) == plain(folder, tmp_path / "one")


def test_interrupt_keeps_what_is_done_and_resume_goes_on(
    make_recordings: MakeRecordings,
    tmp_path: Path,
    started: Callable[..., subprocess.Popen[str]],
) -> None:
    folder, target = make_recordings(RECORDINGS, 4.0), tmp_path / "two"
    words = (*HC, folder, "-o", target, "-j", 2, "--filter", "ukf", "--resume", "--json")
    process = started(*words)
    wait(lambda: results(target) >= 3, "the first results")
    process.send_signal(signal.SIGINT)
    out, error = process.communicate(timeout=100)
    assert process.returncode == 130
    assert complaints(error) == []
    first = json.loads(out)
    assert not first["complete"]
    assert 0 < first["results"] < RECORDINGS
    with (target / "recordings.csv").open(newline="") as file:
        assert len(list(csv.DictReader(file))) == first["results"]
    wait(lambda: not children(process.pid), "the end of the workers")
    out, error = started(*words).communicate(timeout=400)
    again = json.loads(out)
    assert again["complete"]
    assert first["results"] <= again["kept"] < RECORDINGS
    assert contents(target) == plain(folder, tmp_path / "one")


def test_a_recording_that_ends_its_process_is_a_row(
    make_recordings: MakeRecordings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = make_recordings(6)

    def murderous(task: Task) -> Answer:
        import os
        import signal

        from hc_bringup.batch.work import analyse

        if task.path.name == "r0002.csv":
            os.kill(os.getpid(), signal.SIGKILL)
        return analyse(task)

    monkeypatch.setattr(engines, "analyse", murderous)
    words = ["batch", str(folder), "-o", str(tmp_path / "out"), "-j", "2", "--filter", "ukf"]
    assert main(words) == 0
    with (tmp_path / "out" / "recordings.csv").open(newline="") as file:
        reasons = {row["recording"]: row["reason"] for row in csv.DictReader(file)}
    assert len(reasons) == 6
    assert "the worker process ended" in reasons.pop("r0002.csv")
    assert not any(reasons.values())


def start_cluster(
    started: Callable[..., subprocess.Popen[str]], folder: Path, count: int
) -> tuple[str, list[subprocess.Popen[str]]]:
    """Start a scheduler and workers; returns its address, and the processes, scheduler first."""
    address_file = folder / "scheduler.json"
    scheduler = started(
        *(sys.executable, "-m", "distributed.cli.dask_scheduler", "--port", 0),
        *("--host", "127.0.0.1", "--no-dashboard", "--scheduler-file", address_file),
    )
    wait(lambda: address_file.is_file() and address_file.stat().st_size, "the scheduler")
    address = json.loads(address_file.read_text())["address"]
    worker = (sys.executable, "-m", "distributed.cli.dask_worker", address, "--no-dashboard")
    options = ("--no-nanny", "--nthreads", 1, "--local-directory", folder, "--death-timeout", 60)
    return address, [scheduler, *(started(*worker, *options) for _ in range(count))]


def test_a_dask_worker_killed_in_mid_run_loses_nothing(
    make_recordings: MakeRecordings,
    tmp_path: Path,
    started: Callable[..., subprocess.Popen[str]],
) -> None:
    pytest.importorskip("distributed", reason="needs Dask: pip install 'dask[distributed]'")
    folder, target = make_recordings(RECORDINGS, 4.0), tmp_path / "cluster"
    address, cluster = start_cluster(started, tmp_path, 2)
    process = started(*HC, folder, "-o", target, "--scheduler", address, "--filter", "ukf")
    wait(lambda: results(target) >= 5, "the first results")
    cluster[1].kill()
    _, error = process.communicate(timeout=400)
    assert process.returncode == 0, error
    assert complaints(error) == []
    assert results(target) == RECORDINGS
    with (target / "recordings.csv").open(newline="") as file:
        names = [row["recording"] for row in csv.DictReader(file) if not row["reason"]]
    assert names == [f"r{i:04d}.csv" for i in range(RECORDINGS)]
    assert contents(target) == plain(folder, tmp_path / "one")


def test_a_scheduler_that_dies_is_one_line_and_the_work_is_kept(
    make_recordings: MakeRecordings,
    tmp_path: Path,
    started: Callable[..., subprocess.Popen[str]],
) -> None:
    pytest.importorskip("distributed", reason="needs Dask: pip install 'dask[distributed]'")
    folder, target = make_recordings(RECORDINGS, 4.0), tmp_path / "cluster"
    address, cluster = start_cluster(started, tmp_path, 1)
    process = started(*HC, folder, "-o", target, "--scheduler", address, "--filter", "ukf")
    wait(lambda: results(target) >= 5, "the first results")
    cluster[0].kill()
    out, error = process.communicate(timeout=200)
    assert process.returncode == 1
    (line,) = complaints(error)
    assert "the scheduler does not answer any more" in line
    assert "--resume" in line
    assert "ended early with" in out
    assert not json.loads((target / "manifest.json").read_text())["complete"]


def test_a_cluster_of_this_machine_makes_the_same_bytes(
    make_recordings: MakeRecordings, tmp_path: Path
) -> None:
    pytest.importorskip("distributed", reason="needs Dask: pip install 'dask[distributed]'")
    folder, target = make_recordings(5), tmp_path / "cluster"
    words = (*HC, folder, "-o", target, "--local-cluster", 2, "--filter", "ukf")
    done = subprocess.run([*map(str, words)], capture_output=True, text=True, timeout=400)
    assert done.returncode == 0
    assert complaints(done.stderr) == []
    assert contents(target) == plain(folder, tmp_path / "one")


def test_without_a_scheduler_there_is_one_line(
    make_recordings: MakeRecordings,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pytest.importorskip("distributed", reason="needs Dask: pip install 'dask[distributed]'")
    monkeypatch.setattr(engines, "PATIENCE_S", 2.0)
    words = ["batch", str(make_recordings(1)), "-o", str(tmp_path / "out"), "--scheduler"]
    for address in ("tcp://127.0.0.1:9", "nonsense://"):
        assert main([*words, address]) == 1
        assert f"no Dask scheduler at {address}" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_memory_stays_flat_over_a_thousand_recordings(
    make_recordings: MakeRecordings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The largest that one process ever was: after a hundred recordings, a thousand, the tables."""
    if has_pyarrow():
        import pyarrow.csv
        import pyarrow.parquet  # noqa: F401 - it is large, whatever the tables are
    folder, target = make_recordings(1000, 1.0), tmp_path / "out"
    largest: list[int] = []
    run = Campaign.run

    def watched(self: Campaign, engine: Any, tasks: Any, tell: Any) -> None:
        def told(done: int, total: int) -> None:
            if done in (100, total):
                largest.append(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
            tell(done, total)

        run(self, engine, tasks, told)

    monkeypatch.setattr(Campaign, "run", watched)
    assert main(["batch", str(folder), "-o", str(target), "-j", "1", "--filter", "ukf"]) == 0
    largest.append(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
    early, late, end = largest
    assert (late - early) / 1024.0 < 10.0, f"{largest} KiB"
    assert (end - late) / 1024.0 < 40.0, f"{largest} KiB"


def test_the_command_in_the_manifest_makes_the_same_again(
    make_recordings: MakeRecordings, tmp_path: Path
) -> None:
    folder = make_recordings(2)
    given = [
        *("batch", str(folder), "-o", str(tmp_path / "a"), "-j", "1", "--sweep", "filter=ekf,ukf"),
        *("--param", "force_noise_std=0.01", "--input", "force.zero=0.01", "--minimum-depth"),
        *("0.5", "--release", "0.1", "--estimates", "csv", "--units", "force=N"),
    ]
    assert main(given) == 0
    words = json.loads((tmp_path / "a" / "manifest.json").read_text())["command"]
    assert words[-2:] == ["-o", "DIR"]
    assert main([*words[1:-1], str(tmp_path / "b"), "-j", "2"]) == 0
    assert contents(tmp_path / "b") == contents(tmp_path / "a")
