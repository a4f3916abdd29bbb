"""The clock of received messages: what a clock that is set does to a bag's stamps."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hc_logger.reader import BagReader
from hc_logger.reception_clock import ReceptionClock
from hc_logger.recording import read_recording
from hc_logger.session import RecordingSession
from hc_logger.writer import BagWriter

SAMPLE = "hc_msgs/msg/IndenterSample"


class SetClock:
    """A system clock and a steady one that a test moves."""

    def __init__(self) -> None:
        self.wall = 1_700_000_000_000_000_000
        self.steady = 5_000_000_000

    def pass_ms(self, milliseconds: float) -> None:
        self.wall += round(milliseconds * 1e6)
        self.steady += round(milliseconds * 1e6)


@pytest.mark.parametrize("jump_s", [3600.0, 0.5, 0.02, -0.02, -0.5, -3600.0])
def test_a_clock_that_is_set_tears_no_hole_into_the_bag(
    tmp_path: Path, sample_messages: Any, jump_s: float
) -> None:
    """1 kHz for 2 s, the clock set at 1.0035 s: log times go on by 1 ms, stamps as they came."""
    source = SetClock()
    clock = ReceptionClock(lambda: source.wall, lambda: source.steady)
    session = RecordingSession(BagWriter(tmp_path / "bag"), fsync_interval_s=0)
    topic = session.add_topic("indenter/sample", SAMPLE, [])
    stamps, waiting = [], []
    for k in range(2000):
        source.pass_ms(1.0)
        waiting.append(source.wall)  # received now, by the system clock
        stamps.append(source.wall)
        if k == 1003:
            source.wall += round(jump_s * 1e9)
        if k % 10 == 9:
            clock.update()
            data = sample_messages(np.arange(k - 9, k + 1), np.array(waiting))
            for received, message in zip(waiting, data, strict=True):
                session.add_many(topic, [clock.steady(received)], [message], [received], [None])
            waiting = []
    session.close()
    assert [round(j * 1e-9, 6) for j in clock.jumps_ns] == [jump_s]
    with BagReader(tmp_path / "bag") as reader:
        messages = list(reader.messages())
    log = np.array([m.log_time for m in messages])
    np.testing.assert_array_equal(np.diff(log), 1_000_000)
    np.testing.assert_array_equal([m.publish_time for m in messages], stamps)
    np.testing.assert_array_equal(read_recording(tmp_path / "bag").stamps, stamps)


@pytest.mark.parametrize("jump_s", [3600.0, 0.5, -0.5, -3600.0])
@pytest.mark.parametrize("late", [False, True])
def test_a_clock_that_is_set_while_a_batch_is_taken(jump_s: float, late: bool) -> None:
    """After the batch began, or while some of it waited: none of it is torn from the others."""
    source = SetClock()
    clock = ReceptionClock(lambda: source.wall, lambda: source.steady)
    taken = []
    for batch in range(30):
        received = []
        if not late:
            clock.update()
        for k in range(10):
            source.pass_ms(1.0)
            if batch == 10 and k == 5:
                source.wall += round(jump_s * 1e9)
            received.append(source.wall)
        if late:
            clock.update()
        taken += [clock.steady(time) for time in received]
    np.testing.assert_array_equal(np.diff(taken), 1_000_000)
    assert clock.jumps_ns == [round(jump_s * 1e9)]


@pytest.mark.parametrize("jump_s", [3600.0, -3600.0])
def test_a_clock_that_is_set_and_set_back_while_the_recorder_stands_still(jump_s: float) -> None:
    """Regression: on a busy machine a bag ended in seconds that lay an hour ahead."""
    source = SetClock()
    clock = ReceptionClock(lambda: source.wall, lambda: source.steady)
    received = []
    for k in range(3000):
        source.pass_ms(1.0)
        source.wall += round(jump_s * 1e9) * ((k == 1000) - (k == 2000))
        received.append(source.wall)
    clock.update()
    taken = [clock.steady(time) for time in received]
    assert min(np.diff(taken[:1000])) == min(np.diff(taken[2000:])) == 1_000_000
    assert all(source.wall - 3_000_000_000 <= time <= source.wall for time in taken)
    assert clock.jumps_ns == []


@pytest.mark.parametrize("jump_s", [3600.0, -3600.0])
def test_what_still_waits_after_a_jump_was_noticed(jump_s: float) -> None:
    """More messages than one batch takes: those of the next one came before the jump, too."""
    source = SetClock()
    clock = ReceptionClock(lambda: source.wall, lambda: source.steady)
    received = []
    for _ in range(1000):
        source.pass_ms(1.0)
        received.append(source.wall)
    source.wall += round(jump_s * 1e9)
    taken = []
    for k in range(0, 1000, 250):
        clock.update()
        taken += [clock.steady(time) for time in received[k : k + 250]]
        source.pass_ms(10.0)
    np.testing.assert_array_equal(taken, received)


def test_a_process_that_is_held_up_between_two_clocks_sees_no_jump() -> None:
    source = SetClock()
    held = iter((0.0, 0.0, *(25.0, 0.0, 0.0, 0.0) * 40))

    def wall() -> int:
        now = source.wall
        source.pass_ms(next(held))
        return now

    clock = ReceptionClock(wall, lambda: source.steady)
    for _ in range(20):
        source.pass_ms(10.0)
        clock.update()
    assert clock.jumps_ns == []


def test_a_steady_clock_is_left_alone() -> None:
    source = SetClock()
    clock = ReceptionClock(lambda: source.wall, lambda: source.steady)
    for _ in range(1000):
        source.pass_ms(10.0)
        source.wall += 500  # slewed by 50 ppm
        clock.update()
        assert clock.steady(source.wall) == source.wall
    assert clock.jumps_ns == []


def test_a_batch_is_corrected_as_its_messages_one_by_one() -> None:
    """Batches of one topic after another, the clock set between and within them."""
    rng = np.random.default_rng(2)
    source = SetClock()
    together = ReceptionClock(lambda: source.wall, lambda: source.steady)
    one_by_one = ReceptionClock(lambda: source.wall, lambda: source.steady)
    for batch in range(400):
        waiting = []
        for _ in range(int(rng.integers(1, 6))):
            source.pass_ms(float(rng.uniform(0.0, 2.0)))
            waiting.append(source.wall)
            if rng.uniform() < 0.03:
                source.wall += int(rng.choice([-1, 1]) * rng.uniform(1e7, 5e9))
        if batch % 3 == 0:
            together.update()
            one_by_one.update()
        found = together.steady_all(waiting)
        assert found == [one_by_one.steady(time) for time in waiting]
    assert together.jumps_ns == one_by_one.jumps_ns
    assert len(together.jumps_ns) > 10
