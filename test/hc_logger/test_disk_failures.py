"""A disk that fails at any moment: every write, sync, rename and open of a run fails in turn.

As SQLite's tests do it: count what a job asks of the disk, then do the job again once for each of
these calls and let that one fail. What was readable before must be readable after, the message
must name the cause, and nothing may be left open.
"""

from __future__ import annotations

import errno
import os
import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hc_logger.convert import bag_to_bag, bag_to_csv, csv_to_bag
from hc_logger.csv_file import write_csv
from hc_logger.errors import BagError
from hc_logger.new_file import new_file
from hc_logger.reader import BagReader
from hc_logger.recover import recover_bag
from hc_logger.session import RecordingSession
from hc_logger.writer import BagWriter

SAMPLE = "hc_msgs/msg/IndenterSample"
ERRORS = (errno.ENOSPC, errno.EIO, errno.EDQUOT)
CALLS = ("open", "mkdir", "write", "fsync", "replace", "link")


class Disk:
    """Counts the calls that reach a folder, and lets one of them fail, and those after it.

    A short write writes half of what it is given; the next one then fails.
    """

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.folder = str(folder)
        self.calls: list[str] = []
        self.fail_at = -1
        self.number = errno.ENOSPC
        self.short = False
        self.lasting = True
        self._real = {name: getattr(os, name) for name in CALLS}
        for name in CALLS:
            monkeypatch.setattr(os, name, self._stand_in(name))

    def _is_here(self, name: str, arguments: tuple[Any, ...]) -> bool:
        if name == "open":
            flags = arguments[1]
            return bool(flags & os.O_CREAT) and str(arguments[0]).startswith(self.folder)
        if isinstance(arguments[0], int):
            try:
                return os.readlink(f"/proc/self/fd/{arguments[0]}").startswith(self.folder)
            except OSError:
                return False
        return str(arguments[0]).startswith(self.folder)

    def _stand_in(self, name: str) -> Callable[..., Any]:
        def call(*arguments: Any, **keywords: Any) -> Any:
            if not self._is_here(name, arguments):
                return self._real[name](*arguments, **keywords)
            now = len(self.calls)
            self.calls.append(name)
            if self.fail_at < 0 or now < self.fail_at or (now > self.fail_at and not self.lasting):
                return self._real[name](*arguments, **keywords)
            if self.short and now == self.fail_at:
                if name == "write":
                    data = arguments[1]
                    return self._real[name](arguments[0], data[: max(1, len(data) // 2)])
                return self._real[name](*arguments, **keywords)
            raise OSError(self.number, os.strerror(self.number))

        return call

    @contextmanager
    def failing(self, at: int, number: int, *, short: bool, lasting: bool) -> Iterator[None]:
        self.calls.clear()
        self.fail_at, self.number, self.short, self.lasting = at, number, short, lasting
        try:
            yield
        finally:
            self.fail_at = -1


def failures(disk: Disk, job: Callable[[int], None]) -> Iterator[tuple[int, int, bool]]:
    """Do the job without failure, then once for each way to fail.

    Yields:
        number of the job, errno, whether the disk recovers after that one call; the job fails
        while the caller has control.
    """
    disk.calls.clear()
    job(0)
    count = len(disk.calls)
    assert count > 3
    job_number = 1
    for at in range(count):
        for number in ERRORS:
            for lasting in (True, False):
                with disk.failing(at, number, short=False, lasting=lasting):
                    yield job_number, number, lasting
                job_number += 1
        with disk.failing(at, errno.ENOSPC, short=True, lasting=True):
            yield job_number, errno.ENOSPC, True
        job_number += 1


@pytest.fixture
def disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Disk:
    folder = tmp_path / "disk"
    folder.mkdir()
    return Disk(folder, monkeypatch)


def refusal(job: Callable[[int], None], number: int) -> str:
    """Do a job; return what it said if it refused, else nothing."""
    try:
        job(number)
    except BagError as error:
        return str(error)
    return ""


def open_files() -> int:
    return len(os.listdir("/proc/self/fd"))


def sequences(bag: Path) -> list[int]:
    with BagReader(bag) as reader:
        return [m.sequence for m in reader.messages({"/indenter/sample"})]


def test_a_recording_says_at_once_why_it_ends_and_keeps_what_it_had(
    disk: Disk, tmp_path: Path, sample_messages: Any, start_ns: int
) -> None:
    """A session of three files: whatever fails, its counts never claim what is not in the bag."""
    count = 240
    stamps = start_ns + np.arange(count) * 1_000_000
    data = sample_messages(np.arange(count), stamps)
    done: dict[int, RecordingSession] = {}

    def record(number: int) -> None:
        writer = BagWriter(tmp_path / "disk" / f"bag{number}", max_file_duration_s=0.079)
        session = RecordingSession(writer, flush_interval_s=0.0, fsync_interval_s=0)
        done[number] = session
        topic = session.add_topic("indenter/sample", SAMPLE, [])
        for k, (stamp, message) in enumerate(zip(stamps.tolist(), data, strict=True)):
            session.add_many(topic, [stamp], [message], [stamp], [k])
            if k % 20 == 19:
                session.flush_if_due()
        session.close()

    before = open_files()
    tried = 0
    for number, code, _ in failures(disk, record):
        tried += 1
        bag = tmp_path / "disk" / f"bag{number}"
        refused = refusal(record, number)
        if refused:  # the bag could not be made at all
            assert os.strerror(code) in refused
            assert not bag.exists() or list(bag.iterdir()) == []
            continue
        session = done[number]
        if not session.incomplete:  # a short write alone, made good by the next one
            assert session.messages == count
        elif not session.failure:  # full at one call, and room again in the end
            assert code == errno.ENOSPC
            assert "while its disk was full" in session.incomplete
        else:
            assert os.strerror(code) in session.failure
            assert str(bag) in session.failure
        assert session.messages + session.unwritten == count
        disk.fail_at = -1
        readable = sequences(bag) if bag_files_with_content(bag) else []
        # one chunk more can be readable than is claimed: whole, but its index is not
        more = 20 if session.failure else 0
        assert session.messages <= len(readable) <= session.messages + more
        assert readable == list(range(len(readable)))
    assert tried > 200
    assert open_files() == before


def test_a_bag_that_somebody_deletes_is_told_while_it_is_recorded(
    tmp_path: Path, sample_messages: Any, start_ns: int
) -> None:
    """Regression: hours were recorded into a file without a name, and told at the end of the run.

    A part that was finished before may go: who copies it elsewhere takes it away.
    """
    stamps = start_ns + np.arange(40) * 1_000_000
    data = sample_messages(np.arange(40), stamps)
    writer = BagWriter(tmp_path / "bag", max_file_duration_s=0.01)
    session = RecordingSession(writer, flush_interval_s=0.0, fsync_interval_s=0.01)
    topic = session.add_topic("indenter/sample", SAMPLE, [])
    rows = list(zip(stamps.tolist(), data, strict=True))

    def record(some: slice, wait_s: float) -> None:
        for stamp, message in rows[some]:
            session.add_many(topic, [stamp], [message], [stamp], [None])
        until = time.monotonic() + wait_s
        while not session.failure and time.monotonic() < until:
            session.flush_if_due()
            time.sleep(0.001)

    record(slice(0, 20), 0.0)
    (tmp_path / "bag" / "bag_0.mcap").unlink()
    record(slice(20, 30), 0.2)
    assert session.failure == ""
    shutil.rmtree(tmp_path / "bag")
    record(slice(30, 34), 20.0)
    assert session.failure == f"cannot write {tmp_path}/bag: its file was deleted meanwhile"
    session.close()


def bag_files_with_content(bag: Path) -> bool:
    return any(file.stat().st_size for file in bag.glob("*.mcap"))


@pytest.mark.parametrize("name", ["bag", "csv", "copy", "recovered", "rows"])
def test_a_conversion_is_whole_or_not_there(
    disk: Disk, tmp_path: Path, make_bag: Callable[..., Path], name: str
) -> None:
    source = make_bag(count=300)
    rows = tmp_path / "rows.csv"
    bag_to_csv(source, rows)
    table = np.loadtxt(rows, delimiter=",", skiprows=1)
    jobs: dict[str, Callable[[Path], Any]] = {
        "bag": lambda target: csv_to_bag(rows, target),
        "csv": lambda target: bag_to_csv(source, target),
        "copy": lambda target: bag_to_bag(source, target),
        "recovered": lambda target: recover_bag(source, target),
        "rows": lambda target: write_csv(target, [table, table]),
    }
    kept = {path: path.read_bytes() for path in (rows, *source.iterdir())}
    folder = tmp_path / "disk"

    def job(number: int) -> None:
        jobs[name](folder / f"{number}")

    before = open_files()
    failed = 0
    for number, code, _ in failures(disk, job):
        refused = refusal(job, number)
        disk.fail_at = -1
        assert (folder / f"{number}").exists() == (not refused)
        if refused:
            failed += 1
            assert os.strerror(code) in refused
            assert "\n" not in refused
            assert list(folder.glob(".*")) == []
    assert failed > 20
    assert {path: path.read_bytes() for path in kept} == kept
    assert open_files() == before


def test_what_was_there_before_survives_a_failed_replacement(disk: Disk, tmp_path: Path) -> None:
    path = tmp_path / "disk" / "file"

    def job(_number: int) -> None:
        with new_file(path, overwrite=True) as file:
            file.write(b"first half, ")
            file.write(b"second half")

    job(0)
    whole = path.read_bytes()
    for _ in failures(disk, job):
        path.write_bytes(b"what was there")
        try:
            job(0)
        except OSError:
            # only the sync of the folder comes after the new name
            assert path.read_bytes() in (b"what was there", whole)
        else:
            assert path.read_bytes() == whole
        assert [p.name for p in path.parent.iterdir()] == ["file"]


def test_a_new_file_does_not_follow_a_link_nor_overwrite(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(FileExistsError), new_file(tmp_path / "link") as file:
        file.write(b"x")
    assert not (tmp_path / "elsewhere").exists()


def test_a_name_that_somebody_takes_meanwhile_is_left_to_them(tmp_path: Path) -> None:
    path = tmp_path / "new"

    def write() -> None:
        with new_file(path) as file:
            file.write(b"mine")
            path.write_bytes(b"somebody else's")

    with pytest.raises(FileExistsError):
        write()
    assert path.read_bytes() == b"somebody else's"
    assert [p.name for p in tmp_path.iterdir()] == ["new"]
