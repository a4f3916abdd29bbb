"""The player's core without ROS: order, timing, pause, seek, loop."""

from __future__ import annotations

import os
import pty
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from hc_logger.bag import Message
from hc_logger.edit import filter_bag
from hc_logger.errors import BagError
from hc_logger.keyboard import Keyboard, key_names
from hc_logger.origin import origin_ns
from hc_logger.playback import Playback
from hc_logger.reader import BagReader
from hc_logger.selection import TopicSelection
from hc_logger.writer import BagWriter

pytestmark = pytest.mark.clock

ALL = TopicSelection(["*"])
SAMPLES = TopicSelection(["indenter/sample"])
MakeBag = Callable[..., Path]


class Sink:
    """Keeps what is published and when."""

    def __init__(self) -> None:
        self.messages: list[Message] = []
        self.at: list[float] = []
        self.arrived = threading.Condition()

    def __call__(self, message: Message) -> None:
        with self.arrived:
            self.messages.append(message)
            self.at.append(time.monotonic())
            self.arrived.notify_all()

    def wait(self, count: int) -> None:
        with self.arrived:
            assert self.arrived.wait_for(lambda: len(self.messages) >= count, timeout=20)


def finish(playback: Playback) -> None:
    end = time.monotonic() + 20
    while not playback.finished and time.monotonic() < end:
        time.sleep(0.01)
    assert playback.finished
    playback.stop()


def test_everything_comes_in_order_and_never_early(make_bag: MakeBag) -> None:
    sink = Sink()
    with BagReader(make_bag(count=1000, chunk_bytes=4096)) as reader:
        expected = list(reader.messages())
        playback = Playback(reader, sink, ALL, rate=2.0)
        playback.prepare()
        playback.resume()
        finish(playback)
    assert sink.messages == expected
    due = np.array([m.log_time - expected[0].log_time for m in expected]) * 1e-9 / 2.0
    early = due - (np.array(sink.at) - sink.at[0])
    assert early.max() < 1e-3  # the first message may itself be late by so much
    assert sink.at[-1] - sink.at[0] > 0.49
    assert playback.published == {"/header": 100, "/indenter/sample": 1000}
    assert playback.delays().p50 <= playback.delays().p99 <= playback.delays().maximum


def test_it_begins_with_the_first_message_of_the_chosen_topics(
    tmp_path: Path, sample_messages: Callable[..., list[bytes]]
) -> None:
    """A recorder that waited a minute for the samples must not make a replay wait as well."""
    with BagWriter(tmp_path / "bag") as writer:
        samples = writer.add_topic("indenter/sample", "hc_msgs/msg/IndenterSample")
        other = writer.add_topic("/other", "std_msgs/msg/Header")
        writer.write(other, 0, b"\0\1\0\0" + bytes(13))
        for k, data in enumerate(sample_messages(np.arange(100), np.arange(100))):
            writer.write(samples, 60_000_000_000 + k * 1_000_000, data)
    sink = Sink()
    with BagReader(tmp_path / "bag") as reader:
        playback = Playback(reader, sink, SAMPLES, start_offset_s=0.05)
        playback.resume()
        sink.wait(50)
        finish(playback)
        with pytest.raises(ValueError, match="lasts only"):
            Playback(reader, sink, SAMPLES, start_offset_s=0.2)
    assert len(sink.messages) == 50


def test_seconds_count_from_the_first_sample_whatever_lies_before_it(
    tmp_path: Path, sample_messages: Callable[..., list[bytes]]
) -> None:
    """Regression: --start 2 meant the second second of the diagnostics before the samples."""
    with BagWriter(tmp_path / "bag") as writer:
        samples = writer.add_topic("indenter/sample", "hc_msgs/msg/IndenterSample")
        other = writer.add_topic("/other", "std_msgs/msg/Header")
        for k in range(40):
            writer.write(other, k * 100_000_000, b"\0\1\0\0" + bytes(13))
        for k, data in enumerate(sample_messages(np.arange(100), np.arange(100))):
            writer.write(samples, 5_000_000_000 + k * 1_000_000, data)
    with BagReader(tmp_path / "bag") as reader:
        whole = Playback(reader, Sink(), ALL, duration_s=0.02)
        assert (whole.first_ns, whole.last_ns) == (0, 5_020_000_000)
        part = Playback(reader, Sink(), ALL, start_offset_s=0.03, duration_s=0.02)
        assert (part.first_ns, part.last_ns) == (5_030_000_000, 5_050_000_000)
        with pytest.raises(ValueError, match=r"lasts only 0.099 s from its first sample on"):
            Playback(reader, Sink(), ALL, start_offset_s=0.2)
    count, _ = filter_bag(tmp_path / "bag", tmp_path / "part", start_s=0.03, duration_s=0.02)
    assert count == 21
    count, _ = filter_bag(tmp_path / "bag", tmp_path / "begin", duration_s=0.02)
    assert count == 40 + 21
    with pytest.raises(BagError, match=r"0.099 s long from its first sample on: nothing is left"):
        filter_bag(tmp_path / "bag", tmp_path / "none", start_s=2.0)


def test_of_a_robot_they_count_from_where_both_sensors_are_there(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as writer:
        joints = writer.add_topic("/joint_states", "sensor_msgs/msg/JointState")
        force = writer.add_topic("/wrench", "geometry_msgs/msg/WrenchStamped")
        for k in range(4):
            writer.write(joints, 7_000 + k, b"\0\1\0\0")
        writer.write(force, 7_003, b"\0\1\0\0")
    with BagReader(tmp_path / "bag") as reader:
        assert origin_ns(reader) == 7_003


def test_loop_and_window(make_bag: MakeBag, start_ns: int) -> None:
    sink = Sink()
    with BagReader(make_bag(count=1000)) as reader:
        playback = Playback(
            reader, sink, SAMPLES, rate=100.0, loop=True, start_offset_s=0.2, duration_s=0.1
        )
        playback.resume()
        sink.wait(350)
        playback.stop()
        assert playback.loops >= 3
    times = [(m.log_time - start_ns) // 1_000_000 for m in sink.messages[:303]]
    assert times == [*range(200, 301)] * 3


def test_seek_pause_and_burst(make_bag: MakeBag, start_ns: int) -> None:
    sink = Sink()
    with BagReader(make_bag(count=1000, chunk_bytes=4096)) as reader:
        playback = Playback(reader, sink, SAMPLES)
        playback.burst(3)
        sink.wait(3)
        assert playback.paused
        assert playback.time_ns() == start_ns + 2_000_000
        assert playback.seek(start_ns + 500_000_000) == start_ns + 500_000_000
        playback.burst(1)
        sink.wait(4)
        assert playback.seek(0) == start_ns
        assert playback.seek(2**62) == start_ns + 999_000_000
        playback.burst(1)
        sink.wait(5)
        playback.seek(start_ns + 900_000_000)
        playback.set_rate(50.0)
        playback.resume()
        finish(playback)
        with pytest.raises(ValueError, match="burst of 0"):
            playback.burst(0)
        with pytest.raises(ValueError, match="rate is 0"):
            playback.set_rate(0.0)
    times = [(m.log_time - start_ns) // 1_000_000 for m in sink.messages]
    assert times == [0, 1, 2, 500, 999, *range(900, 1000)]


def test_a_duration_beyond_the_end_plays_all(make_bag: MakeBag, start_ns: int) -> None:
    """Regression: 1e300 s ended the player with a traceback."""
    with BagReader(make_bag(count=1000)) as reader:
        for duration_s in (0.0, 0.999, 5.0, 1e300):
            playback = Playback(reader, Sink(), SAMPLES, duration_s=duration_s)
            assert playback.last_ns == start_ns + 999_000_000
        assert Playback(reader, Sink(), SAMPLES, duration_s=0.5).last_ns == start_ns + 500_000_000


def test_a_jump_at_the_end_of_the_bag_is_not_taken_for_the_end(
    make_bag: MakeBag, start_ns: int
) -> None:
    """Regression: who jumped just as the last message went out was told that all was played."""
    with BagReader(make_bag(count=10)) as reader:
        playback = Playback(reader, Sink(), SAMPLES)
        before = playback._generation
        playback.seek(start_ns + 5_000_000)
        playback._end_of_bag(before)
        assert not playback.finished
        assert playback.loops == 0
        playback._end_of_bag(playback._generation)
        assert playback.finished


def test_time_stands_while_paused_and_runs_with_the_rate(make_bag: MakeBag) -> None:
    with BagReader(make_bag(count=5000)) as reader:
        playback = Playback(reader, Sink(), SAMPLES, rate=4.0)
        playback.resume()
        time.sleep(0.3)
        first, at = playback.time_ns(), time.monotonic()
        time.sleep(0.2)
        passed = (playback.time_ns() - first) * 1e-9 / (time.monotonic() - at)
        assert passed == pytest.approx(4.0, rel=0.05)
        playback.pause()
        stood = playback.time_ns()
        time.sleep(0.05)
        assert playback.time_ns() == stood
        playback.stop()


def test_damage_on_the_way_is_skipped(make_bag: MakeBag) -> None:
    path = make_bag(count=1000, chunk_bytes=4096)
    data = bytearray((path / "bag_0.mcap").read_bytes())
    with BagReader(path) as reader:
        place = reader.files[0].scan.chunks[5]
    data[place.offset + 100] ^= 1
    (path / "bag_0.mcap").write_bytes(data)
    sink = Sink()
    with BagReader(path) as reader:
        playback = Playback(reader, sink, SAMPLES, rate=1000.0)
        playback.resume()
        finish(playback)
        assert playback.error is None
        assert len(reader.problems) == 1
    assert 900 < len(sink.messages) < 1000


@pytest.mark.parametrize("error", [BagError("gone"), OSError(5, "gone")])
def test_a_bag_that_cannot_be_read_on_ends_the_playback(
    make_bag: MakeBag, monkeypatch: pytest.MonkeyPatch, error: Exception
) -> None:
    sink = Sink()
    with BagReader(make_bag(count=1000)) as reader:
        whole = list(reader.messages())

        def messages(*_: object) -> Iterator[Message]:
            yield from whole[:600]
            raise error

        monkeypatch.setattr(reader, "messages", messages)
        playback = Playback(reader, sink, ALL, rate=100.0)
        playback.resume()
        finish(playback)
    assert playback.error is error
    assert sink.messages == whole[:600]


def test_key_names() -> None:
    names = ["space", "up", "down", "q", "right", "left"]
    assert key_names(b" \x1b[A\x1b[Bq\x1bOC\x1b[D") == (names, b"")
    assert key_names(b"\x1b[5~") == ([], b"")
    assert key_names(b"a\x1b[") == (["a"], b"\x1b[")
    assert key_names(b"") == ([], b"")


def test_an_arrow_key_may_come_in_pieces() -> None:
    controller, terminal = pty.openpty()
    try:
        with Keyboard(terminal) as keyboard:
            names = []
            for byte in b"\x1b[A ":
                os.write(controller, bytes([byte]))
                names += keyboard.read(1.0)
            assert names == ["up", "space"]
            assert keyboard.read(0.01) == []
    finally:
        os.close(controller)
        os.close(terminal)


def test_no_terminal_is_said(tmp_path: Path) -> None:
    with open(tmp_path / "file", "w") as stream, pytest.raises(ValueError, match="no terminal"):
        Keyboard(stream.fileno())
