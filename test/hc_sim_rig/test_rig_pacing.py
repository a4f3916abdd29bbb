"""The deadline thread: exact stamps, nothing left out after a stall, a clock that may misbehave."""

from __future__ import annotations

import threading
import time

import pytest

from hc_sim_rig.pacing import DeadlineThread

pytestmark = pytest.mark.clock


def run(rate_hz: float, count: int, clock_ns=time.time_ns, during=lambda index: None) -> tuple:
    acts: list[tuple[int, int]] = []

    def act(index: int, stamp_ns: int) -> bool:
        acts.append((index, stamp_ns))
        during(index)
        return len(acts) < count

    thread = DeadlineThread(rate_hz, act, clock_ns)
    begin = time.monotonic()
    thread.start()
    while thread.running:
        time.sleep(0.005)
    return acts, thread, time.monotonic() - begin


def test_stamps_are_exact_and_time_passes() -> None:
    acts, thread, seconds = run(1000.0, 300)
    first = acts[0][1]
    assert [stamp for _, stamp in acts] == [first + k * 1_000_000 for k in range(300)]
    assert seconds > 0.29
    assert thread.report.acts == 299
    assert abs(first - time.time_ns()) < 60e9


def test_a_stall_is_caught_up_without_a_gap() -> None:
    acts, thread, seconds = run(
        500.0, 300, during=lambda index: time.sleep(0.2) if index == 50 else None
    )
    first = acts[0][1]
    assert [stamp for _, stamp in acts] == [first + k * 2_000_000 for k in range(300)]
    assert thread.report.overruns >= 90
    assert thread.take_largest_delay_ns() > 0.15e9
    assert thread.take_largest_delay_ns() == 0
    assert seconds > 0.59


def test_a_jump_of_the_clock_is_counted_and_not_followed() -> None:
    origin = time.monotonic_ns()

    def clock() -> int:
        now = time.monotonic_ns() - origin
        return now + (3600 * 10**9 if now > 0.3e9 else 0)

    acts, thread, _ = run(1000.0, 900, clock_ns=clock)
    assert thread.report.clock_jumps == 1  # regression: one more every quarter of a second
    assert acts[-1][1] - acts[0][1] == 899 * 1_000_000


def test_a_clock_that_jumped_is_followed_from_there_on() -> None:
    """Regression: after a jump it was never followed again."""
    origin = time.monotonic_ns()

    def clock() -> int:
        now = time.monotonic_ns() - origin
        return int(now * 1.05) - (3600 * 10**9 if now > 0.1e9 else 0)

    _, thread, seconds = run(1000.0, 1500, clock_ns=clock)
    assert thread.report.clock_jumps == 1
    assert seconds < 1.5 * 0.99


def test_a_clock_that_runs_fast_is_followed() -> None:
    origin = time.monotonic_ns()
    _, _, seconds = run(1000.0, 1500, clock_ns=lambda: int((time.monotonic_ns() - origin) * 1.05))
    assert seconds < 1.5 * 0.99  # deadlines follow: 5 % fast, after each comparison


def test_stop_ends_a_slow_thread_soon_and_an_error_is_kept() -> None:
    called = threading.Event()

    def act(index: int, _stamp: int) -> bool:
        called.set()
        return True

    thread = DeadlineThread(0.1, act, time.time_ns)
    thread.start()
    assert called.wait(1.0)
    begin = time.monotonic()
    thread.stop()
    assert time.monotonic() - begin < 5.0  # its period is 10 s
    assert not thread.running

    def fails(_index: int, _stamp: int) -> bool:
        raise ZeroDivisionError("told so")

    thread = DeadlineThread(100.0, fails, time.time_ns)
    thread.start()
    thread.stop()
    assert isinstance(thread.error, ZeroDivisionError)
