"""A recording that is piped in: read as the file would be, and nothing is left behind."""

from __future__ import annotations

import argparse
import bz2
import errno
import gzip
import io
import json
import lzma
import os
import shlex
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hc_bringup import standard_input
from hc_bringup.cli import main
from hc_logger.convert import csv_to_bag

PACK: dict[str, Callable[[bytes], bytes]] = {
    "plain": bytes,
    "gz": gzip.compress,
    "bz2": bz2.compress,
    "xz": lzma.compress,
}


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four seconds of presses on a tissue."""
    time_s = np.arange(0.0, 4.0, 0.005)
    depth = 1.0 - np.cos(2.0 * np.pi * time_s)
    speed = 2.0 * np.pi * np.sin(2.0 * np.pi * time_s)
    force = depth**1.5 * (0.3 + 0.02 * speed)
    path = tmp_path_factory.mktemp("piped") / "press.csv"
    rows = np.column_stack([time_s, depth, force])
    np.savetxt(path, rows, delimiter=",", header="time_s,displacement_mm,force_N", comments="")
    return path


@pytest.fixture
def piped(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[[bytes], None]:
    """Function (content): pipes it into the next command, which keeps it in tmp_path."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))

    def pipe(content: bytes) -> None:
        source = tmp_path / "standard_input"
        source.write_bytes(content)
        monkeypatch.setattr("sys.stdin", source.open())

    return pipe


def result_of(capsys: pytest.CaptureFixture[str], *words: str) -> dict[str, Any]:
    status = main(["estimate", *words, "--filter", "ukf", "--json"])
    out, err = capsys.readouterr()
    assert status == 0, err
    summary: dict[str, Any] = json.loads(out)
    del summary["microseconds_per_step"]
    return summary


@pytest.mark.parametrize("packed", PACK)
def test_a_table_that_is_piped_in_gives_what_the_file_gives(
    packed: str,
    table: Path,
    piped: Callable[[bytes], None],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Regression: refused, with the advice to write it to a file, which the command does now."""
    expected = result_of(capsys, str(table))
    for name in ("-", "/dev/stdin"):
        piped(PACK[packed](table.read_bytes()))
        assert result_of(capsys, name) == expected
    assert not list(tmp_path.glob("hc_pipe_*"))


def test_a_bag_that_is_piped_in_is_one(
    table: Path,
    piped: Callable[[bytes], None],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    csv_to_bag(table, tmp_path / "bag")
    (bag,) = (tmp_path / "bag").glob("*.mcap")
    piped(bag.read_bytes())
    assert result_of(capsys, "-") == result_of(capsys, str(bag))


@pytest.mark.timeout(60)
def test_a_named_pipe_is_read_to_its_end(
    table: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """As of a shell's <(zcat press.csv.gz), which is /dev/fd/63."""
    pipe = tmp_path / "press.csv"
    os.mkfifo(pipe)
    expected = result_of(capsys, str(table))
    writer = threading.Thread(target=lambda: pipe.write_bytes(table.read_bytes()))
    writer.start()
    assert result_of(capsys, str(pipe)) == expected
    writer.join()


@pytest.mark.timeout(60)
def test_a_named_pipe_that_nobody_writes_to_is_waited_for_with_words(
    table: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Regression: "starting hc doctor, since 30 s" was said all that time."""
    pipe = tmp_path / "press.csv"
    os.mkfifo(pipe)
    steps: list[str] = []
    waited = threading.Event()

    def doing(step: str) -> None:
        steps.append(step)
        waited.set()

    def write_late() -> None:
        waited.wait(30.0)
        pipe.write_bytes(table.read_bytes())

    monkeypatch.setattr(standard_input.heartbeat, "doing", doing)
    writer = threading.Thread(target=write_late)
    writer.start()
    result_of(capsys, str(pipe))
    writer.join()
    assert steps[0] == f"waiting for {pipe}"


@pytest.mark.process
@pytest.mark.timeout(60)
@pytest.mark.parametrize("name", ["estimate", "contacts", "report"])
def test_every_command_says_what_it_waits_for_and_ends_by_an_interrupt(
    command_line: Any, tmp_path: Path, name: str
) -> None:
    """Regression: estimate, contacts and report said nothing while nobody wrote to the pipe."""
    pipe = tmp_path / "press.csv"
    os.mkfifo(pipe)
    to = [] if name == "estimate" else ["-o", str(tmp_path / "new.html")]
    process = command_line.start(name, str(pipe), *to)
    said = process.stderr.readline()
    assert said.startswith(f"... waiting for {pipe}, since "), said
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=15)
    assert (process.returncode, out) == (130, "")
    assert all(line.startswith("... waiting for ") for line in err.splitlines())


@pytest.mark.timeout(60)
def test_a_heartbeat_ends_when_all_has_come(
    table: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pipe = tmp_path / "press.csv"
    os.mkfifo(pipe)
    calls: list[str] = []
    monkeypatch.setattr(standard_input.heartbeat, "begin", calls.append)
    monkeypatch.setattr(standard_input.heartbeat, "end", lambda: calls.append("end"))
    writer = threading.Thread(target=lambda: pipe.write_bytes(table.read_bytes()))
    writer.start()
    arguments = argparse.Namespace(input=str(pipe))
    with standard_input.kept(arguments, tell_waiting=True):
        assert calls == [f"waiting for {pipe}", "end"]
        assert Path(arguments.input).read_bytes() == table.read_bytes()
    writer.join()


def test_lines_call_it_what_it_is_and_can_be_typed_again(
    table: Path,
    piped: Callable[[bytes], None],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    piped(table.read_bytes().replace(b"time_s,displacement_mm", b"time (s),displacement (mm)"))
    page = tmp_path / "page.html"
    assert main(["report", "-", "--filter", "ukf", "-o", str(page)]) == 0
    assert f"hc report - --filter ukf -o {shlex.quote(str(page))}" in page.read_text("utf-8")
    piped(table.read_bytes().replace(b"time_s,displacement_mm", b"time (s),displacement (mm)"))
    main(["doctor", "-"])
    out, err = capsys.readouterr()
    assert "standard input" in out + err
    assert str(tmp_path / "hc_pipe_") not in out + err


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "standard input is empty: nothing was piped into it"),
        (b'  {"time": 1}', "standard input is JSON"),
        (b"\x89HDF\r\n\x1a\n", "standard input is written as HDF5"),
        (b"\x28\xb5\x2f\xfd" + bytes(20), "standard input is compressed: unpack it first (unzstd)"),
        (b"nothing\n", "standard input: no rows of three numbers"),
        (gzip.compress(b"1,2,3\n" * 9999, mtime=0)[:60], "standard input is damaged, cut off"),
        (b"\x89MCAP0\r\n", "standard input"),
    ],
    ids=["empty", "json", "hdf5", "zst", "words", "cut", "mcap"],
)
def test_what_is_no_recording_is_refused_in_a_line(
    content: bytes,
    said: str,
    piped: Callable[[bytes], None],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    piped(content)
    assert main(["estimate", "-"]) == 1
    out, err = capsys.readouterr()
    assert said in err.replace("\n", " ")
    assert str(tmp_path) not in out + err
    assert not list(tmp_path.glob("hc_pipe_*"))


def test_at_a_terminal_nobody_waits_for_what_is_typed(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    stream = io.TextIOWrapper(io.BytesIO(b""))
    monkeypatch.setattr(stream, "isatty", lambda: True)
    monkeypatch.setattr("sys.stdin", stream)
    assert main(["estimate", "-"]) == 2
    assert "pipe a recording into this" in capsys.readouterr().err


def test_a_full_disk_is_said_with_what_to_do(
    table: Path,
    piped: Callable[[bytes], None],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    class Full(io.RawIOBase):
        def write(self, _block: object) -> int:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    real = Path.open
    monkeypatch.setattr(
        Path, "open", lambda path, *a, **b: Full() if "piped" in path.name else real(path, *a, **b)
    )
    piped(table.read_bytes())
    assert main(["estimate", "-"]) == 1
    assert "No space left on device; TMPDIR=FOLDER" in capsys.readouterr().err.replace("\n", " ")
    assert not list(tmp_path.glob("hc_pipe_*"))


def test_a_file_called_so_is_no_pipe(tmp_path: Path) -> None:
    for name in ("./-", str(tmp_path / "nothing.csv"), "a\0b"):
        assert not standard_input._is_pipe(name)


@pytest.mark.process
@pytest.mark.timeout(60)
def test_an_interrupt_while_it_reads_leaves_nothing(command_line: Any, tmp_path: Path) -> None:
    process = command_line.launch(
        [sys.executable, "-m", "hc_bringup", "estimate", "-"],
        stdin=subprocess.PIPE,
        env=command_line.environment | {"TMPDIR": str(tmp_path)},
    )
    process.stdin.write("time_s,displacement_mm,force_N\n" * 9999)
    process.stdin.flush()
    # Regression: it was in the midst of what had come, and went on to wait for more.
    assert list(tmp_path.glob("hc_pipe_*/*"))
    process.send_signal(signal.SIGTERM)
    assert process.wait(timeout=15) == 143
    assert not list(tmp_path.glob("hc_pipe_*"))
