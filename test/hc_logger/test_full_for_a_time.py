"""A disk that was full and has room again: the recording goes on in the same bag, and says so."""

import errno
import os
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from hc_logger import session as session_module
from hc_logger.info import bag_info
from hc_logger.reader import BagReader
from hc_logger.session import INCOMPLETE, RecordingSession
from hc_logger.type_names import SAMPLE_TYPE
from hc_logger.writer import BagWriter

COUNT, FAILS_AT, AGAIN_AT = 300, 90, 220
REAL_OPEN, REAL_WRITE = os.open, os.write


class FullDisk:
    """Lets files be made and written in part, `takes` bytes more, while it is `full`."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.full, self.takes, self.number, self.folder = False, 0, errno.ENOSPC, str(folder)
        monkeypatch.setattr(os, "open", self._open)
        monkeypatch.setattr(os, "write", self._write)
        monkeypatch.setattr(os, "statvfs", self._statvfs)
        monkeypatch.setattr(session_module, "LOOK_S", 0.0)

    def _error(self) -> OSError:
        return OSError(self.number, os.strerror(self.number))

    def _open(self, path: Any, flags: int, *rest: Any, **more: Any) -> int:
        made = flags & os.O_CREAT and str(path).startswith(self.folder)
        if made and self.full and not self.takes:
            raise self._error()
        return REAL_OPEN(path, flags, *rest, **more)

    def _write(self, number: int, data: Any) -> int:
        if not (self.full and os.readlink(f"/proc/self/fd/{number}").startswith(self.folder)):
            return REAL_WRITE(number, data)
        some = data[: self.takes]
        self.takes -= len(some)
        if not len(some):
            raise self._error()
        return REAL_WRITE(number, some)

    def _statvfs(self, _path: Any) -> Any:
        return SimpleNamespace(f_bavail=0 if self.full else 10**6, f_frsize=4096, f_blocks=10**7)


def sequences(bag: Path) -> list[int]:
    with BagReader(bag) as reader:
        return [m.sequence for m in reader.messages({"/indenter/sample"})]


@pytest.fixture
def disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> FullDisk:
    return FullDisk(tmp_path, monkeypatch)


# Bytes that fit still: none, a part of a chunk, chunks, the end of a file and part of the next one.
@pytest.mark.parametrize("takes", list(range(0, 9000, 291)))
def test_the_recording_goes_on_in_the_same_bag_and_all_of_it_is_whole(
    disk: FullDisk, tmp_path: Path, sample_messages: Any, start_ns: int, takes: int
) -> None:
    stamps = start_ns + np.arange(COUNT) * 1_000_000
    data = sample_messages(np.arange(COUNT), stamps)
    writer = BagWriter(tmp_path / "bag", max_file_duration_s=0.079)
    session = RecordingSession(writer, flush_interval_s=0.0, fsync_interval_s=0)
    topic = session.add_topic("indenter/sample", SAMPLE_TYPE, [])
    for k, (stamp, message) in enumerate(zip(stamps.tolist(), data, strict=True)):
        if k == FAILS_AT:
            disk.full, disk.takes = True, takes
        if k == AGAIN_AT:
            assert "No space left on device" in session.failure
            assert session.waits
            assert not session.go_on()
            disk.full = False
            assert session.go_on()
            assert not session.go_on()
            other = session.add_topic("other", SAMPLE_TYPE, [])
        session.add_many(topic, [stamp], [message], [stamp], [k])
        if k > AGAIN_AT:
            session.add_many(other, [stamp], [message], [stamp], [k])
        if k % 10 == 9:
            session.flush_if_due()
    session.close()
    count = session.counts[topic]
    assert count.messages + session.unwritten == COUNT
    assert 0 < session.unwritten <= AGAIN_AT - FAILS_AT + 10
    assert session.incomplete == (
        f"{session.unwritten} messages were not written into {tmp_path / 'bag'} while its disk was "
        "full"
    )
    readable = sequences(tmp_path / "bag")
    lost = set(range(COUNT)) - set(readable)
    assert len(readable) == count.messages == COUNT - session.unwritten
    assert readable == sorted(readable)
    assert lost == set(range(AGAIN_AT - session.unwritten, AGAIN_AT))
    info = bag_info(tmp_path / "bag")
    assert not info.problems
    assert info.message_count == session.messages == len(readable) + COUNT - AGAIN_AT - 1


def test_a_disk_that_fails_otherwise_is_not_waited_for(
    disk: FullDisk, tmp_path: Path, sample_messages: Any, start_ns: int
) -> None:
    """What was taken by a broken disk may not be there."""
    disk.number = errno.EIO
    session = RecordingSession(BagWriter(tmp_path / "bag"), flush_interval_s=0.0)
    topic = session.add_topic("indenter/sample", SAMPLE_TYPE, [])
    (message,) = sample_messages(np.arange(1), np.array([start_ns]))
    session.add_many(topic, [start_ns], [message], [start_ns], [0])
    disk.full = True
    session.flush_if_due()
    disk.full = False
    assert (session.waits, session.go_on()) == (False, False)
    assert session.failure == session.incomplete
    session.close()
    assert session.unwritten == 1


def test_a_recorder_goes_on_and_its_end_tells_what_is_missing(
    start_node: Any, graph: Any, small_disk: Path
) -> None:
    """Regression: space that was made again after ten seconds of an hour helped nothing."""
    from diagnostic_msgs.msg import DiagnosticArray
    from std_msgs.msg import ByteMultiArray
    from std_srvs.srv import Trigger

    reports: list[Any] = []
    graph.create_subscription(
        DiagnosticArray, "/diagnostics", lambda m: reports.append(m.status[0]), 10
    )
    noise = graph.create_publisher(ByteMultiArray, "noise", 1000)
    (small_disk / "others").write_bytes(bytes(600_000))
    bag = small_disk / "bag"
    node = start_node(
        "hc_logger.recorder_node", output=bag, topics="[noise]", expected_topics="[noise]"
    )
    assert graph.spin_until(lambda: graph.call(Trigger, "/recorder/ready").success)
    rng = np.random.default_rng(1)

    def publish(count: int) -> None:
        for _ in range(count):
            noise.publish(ByteMultiArray(data=[bytes([b]) for b in rng.integers(0, 256, 8000)]))
            time.sleep(0.001)

    publish(100)
    assert graph.spin_until(lambda: bool(reports) and reports[-1].level == b"\x02")
    (small_disk / "others").unlink()
    assert graph.spin_until(lambda: reports[-1].level == b"\x01")
    assert "while its disk was full" in reports[-1].message
    publish(10)
    assert node.end() == INCOMPLETE, node.error
    assert "and so does the recording once there is room" in node.error
    assert "there is room again: recording goes on; " in node.error
    info = bag_info(bag)
    assert not info.problems
    values = {v.key: int(v.value) for v in reports[-1].values if v.key in ("messages", "unwritten")}
    assert values["unwritten"] + info.message_count == 110
    assert info.custom_data["unwritten"] == str(values["unwritten"])
