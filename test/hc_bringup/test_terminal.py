"""The panel of the terminal: straight at every width, and outspoken about what is wrong."""

from __future__ import annotations

import math
import os
import pty
import signal
import sys
import time
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from rich.console import Console

from hc_bringup.live import Display, _load_line
from hc_bringup.run_state import RunState
from hc_bringup.statistics import EstimateStatistics
from hc_bringup.terminal.numbers import SteadyDecimals, decimals_of, engineering, file_size
from hc_bringup.terminal.panel import PanelPainter
from hc_bringup.terminal.sparkline import STEPS, sparkline
from hc_bringup.terminal.view import PanelHistory, PanelView

numbers = st.floats(allow_nan=True, allow_infinity=True, width=64)
words = st.text(st.characters(codec="ascii", exclude_categories=("Cc",)), max_size=80)


def lines_of(view: PanelView, width: int) -> list[str]:
    console = Console(width=width, force_terminal=True, color_system=None)
    with console.capture() as capture:
        console.print(PanelPainter().draw(view, width))
    return capture.get().splitlines()


def usual(**fields: Any) -> PanelView:
    history = PanelHistory()
    for number in range(200):
        history.force.append(math.sin(number / 4))
        history.depth.append(math.cos(number / 4))
        for curve in history.parameters:
            curve.append(float(number % 17))
    values: dict[str, Any] = {
        "phase": "running",
        "elapsed_s": 12.3,
        "duration_s": 60.0,
        "rate_hz": 1000.0,
        "silent_s": 0.01,
        "latency_s": (3e-4, 8e-4),
        "parameters": (0.20005, 0.02, 1.6, 1.0),
        "deviations": (1e-4, 2e-5, 4e-4, 4e-4),
        "known": (0.999, 0.98, 1.0, 0.5),
        "truth": (0.2, 0.02, 1.6, 1.0),
        "force_n": 1.234,
        "depth_mm": 2.345,
        "force_error_n": 0.0121,
        "contact": True,
        "filter": "self_tuning_ukf",
        "scenario": "palpation_scan",
        "bag": "run_20260101_000000",
        "bag_bytes": 12_345_678.0,
        "processor": {"indenter": 19.0, "estimator": 20.0},
        "keys": (("q", "stop"), ("m", "mark")),
        "history": history,
    }
    return PanelView(**(values | fields))


def test_nothing_is_shown_of_estimates_that_others_hear() -> None:
    """Regression: `hc bench latency` printed K=- B=- n=- p=-."""
    view = usual(with_estimates=False, phase="running")
    text = "\n".join(lines_of(view, 100))
    assert "estimates go to the subscribers" in text
    for word in ("± 2 sd", "force", "Hz", "refused", "latency", "no estimate yet"):
        assert word not in text, word
    state = RunState(EstimateStatistics(), 65.0, "running", 12.0, {"indenter": 17.4})
    assert _load_line(state) == "  12.0 of 65 s  of a core: indenter 17 %"


@pytest.mark.parametrize("width", [60, 61, 72, 79, 80, 100, 133, 200])
def test_every_line_is_as_wide_as_the_panel(width: int) -> None:
    lines = lines_of(usual(), width)
    assert {len(line) for line in lines} == {width}
    text = "\n".join(lines)
    for part in ("0.20005", "0.02000", "palpation_scan", "12.3 MB", "12.1 mN", "1000 Hz", "[q]"):
        assert part in text, part
    assert any(step in text for step in STEPS)
    rows = [line for line in lines if line[2:3] in "KBnp" and line[3:5] == "  "]
    assert len(rows) == 4
    ends = {len(row[:16].rstrip()) for row in rows}  # the estimates are aligned to the right
    assert len(ends) == 1


@given(
    st.integers(60, 200),
    st.tuples(numbers, numbers, numbers, numbers),
    st.tuples(numbers, numbers, numbers, numbers),
    numbers,
    words,
    words,
    st.booleans(),
)
def test_nothing_makes_it_ragged(
    width: int, values: Any, deviations: Any, force: float, name: str, said: str, contact: bool
) -> None:
    view = usual(
        parameters=values,
        deviations=deviations,
        truth=deviations,
        known=values,
        force_n=force,
        depth_mm=force,
        force_error_n=force,
        filter=name,
        scenario=said,
        bag=name,
        answer=said,
        explanation=said,
        problems={name: said},
        mismatch=True,
        contact=contact,
    )
    widths = {len(line) for line in lines_of(view, width)}
    assert widths == {width}


@pytest.mark.parametrize(
    ("fields", "says"),
    [
        ({"silent_s": 1.4}, "silent for 1.4 s"),
        ({"silent_s": 1.4, "silent_reason": "no force"}, "no force"),
        ({"silent_s": 7.4, "phase": "done"}, "silent for 7.4 s"),
        ({"contact": None, "elapsed_s": 2.0}, "does anybody publish"),
        (
            {"contact": None, "elapsed_s": 9.0, "silent_reason": "no joint"},
            "no estimate yet: no joint",
        ),
        ({"mismatch": True, "explanation": "it relaxes"}, "the law does not fit: it relaxes"),
        ({"depth_mm": 312.0}, "was nothing tared"),
        ({"bag_dropped": 3}, "3 messages did not get into the bag"),
        ({"problems": {"recorder": "disk full"}}, "recorder: disk full"),
        ({"contact": False}, "in the air"),
        ({"hypothesis": 2, "several_hypotheses": True}, "leads: stiffness trend"),
    ],
)
def test_what_is_wrong_is_said(fields: dict[str, Any], says: str) -> None:
    joined = " ".join(line.strip("│ ").strip() for line in lines_of(usual(**fields), 100))
    assert says in joined
    if "silent_s" in fields:
        assert "in contact" not in joined


def test_the_last_panel_shows_the_rate_of_the_run_and_not_of_its_end(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Regression: a run that waited for its last estimates left 0 Hz on the screen."""
    now = [100.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    display = Display(enabled=True, with_keys=False)
    state = RunState(EstimateStatistics(), 10.0, "running")
    for _ in range(30):
        now[0] += 0.1
        state.statistics.estimates += 100
        display.show(state)
    state.phase = "stopping"
    for _ in range(30):
        now[0] += 0.1
        display.show(state)
    assert 900.0 < display._rate.hz < 1100.0


@pytest.mark.parametrize(("with_estimates", "lines"), [(True, 12), (False, 3)])
def test_without_a_panel_a_step_is_told_once_and_the_load_every_few_seconds(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    with_estimates: bool,
    lines: int,
) -> None:
    """Regression: `hc bench latency` wrote the same "compiling the filters" twenty times."""
    now = [100.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    display = Display(enabled=True, with_keys=False, with_estimates=with_estimates)
    state = RunState(EstimateStatistics(), 10.0)
    state.cpu_percent = {"indenter": 17.0}

    def told(seconds: float, phase: str) -> list[str]:
        state.phase = phase
        for _ in range(round(8.0 * seconds)):
            now[0] += 0.125
            state.elapsed_s += 0.125
            display.show(state)
        return capsys.readouterr().err.splitlines()

    assert told(20.0, "estimator: 0 of 9 done") == ["estimator: 0 of 9 done"]
    assert told(20.0, "estimator: 1 of 9 done") == ["estimator: 1 of 9 done"]
    assert told(0.25, "waiting for indenter") == ["waiting for indenter"]
    assert told(0.25, "starting recorder") == []  # gone before anybody could read it
    running = told(12.0, "running")
    assert len(running) == lines
    assert told(3.0, "stopping indenter") == ["stopping indenter"]
    assert told(3.0, "done") == ["done"]


def test_why_a_sensor_is_silent_is_said_to_the_end() -> None:
    """Regression: at 100 columns the second sensor was cut off."""
    reason = (
        "no usable sample for 1.8 s: nobody publishes /ft_sensor/wrench; nobody publishes /pose"
    )
    for width in (60, 100):
        lines = lines_of(usual(silent_s=2.4, silent_reason=reason), width)
        assert {len(line) for line in lines} == {width}
        joined = " ".join(" ".join(line.strip("│ ").split()) for line in lines)
        assert reason in joined


def test_a_node_that_is_stopped_is_not_said_to_wait_for_samples() -> None:
    """Regression: of an estimator that was stopped (kill -STOP): "no samples come"."""
    state = RunState(EstimateStatistics(), 0.0, phase="running", silent_s=1.7, mute_s=0.4)
    assert state.silent_reason == ""
    state.mute_s = 1.8
    assert "it is stopped" in state.silent_reason
    state.silent_s = 0.1
    assert state.silent_reason == ""
    state.mute_s = math.nan
    assert state.silent_reason == ""


@given(st.floats(1e-9, 1e6), st.integers(2, 4))
def test_engineering_units_keep_the_value(value: float, digits: int) -> None:
    number, unit = engineering(value, "N", digits).split(" ")
    factor = {"n": 1e-9, "µ": 1e-6, "m": 1e-3, "": 1.0, "k": 1e3, "M": 1e6}[unit.removesuffix("N")]
    assert float(number) * factor == pytest.approx(value, rel=0.6 * 10.0 ** (1 - digits))
    assert 0.999 <= float(number) < 1000.5 or value < 1e-9


@given(numbers, numbers)
def test_decimals_are_always_possible(value: float, deviation: float) -> None:
    assert 0 <= decimals_of(value, deviation) <= 7


def test_decimals_stay_put_while_the_deviation_wanders() -> None:
    steady = SteadyDecimals()
    shown = [steady.update(0.2, 10.0**power) for power in (-3.0, -3.4, -2.9, -3.2, -2.7)]
    assert len(set(shown)) == 1
    assert steady.update(0.2, 1e-6) > shown[0]


@given(st.lists(numbers, max_size=50), st.integers(0, 80))
@example([-1.7e308, 1.7e308, 0.0], 8)  # their distance is no number
def test_sparkline_is_as_wide_as_asked(values: list[float], width: int) -> None:
    line = sparkline(values, width)
    assert len(line) == width
    assert set(line) <= set(STEPS) | {" "}


def test_sparkline_shows_the_curve() -> None:
    assert sparkline([0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0], 8) == STEPS
    assert sparkline([5.0, 5.0], 4) == "  ▁▁"


def test_file_sizes() -> None:
    assert file_size(999) == "999 B"
    assert file_size(12_345) == "12.3 kB"
    assert file_size(2.5e9) == "2.50 GB"


@pytest.mark.slow
@pytest.mark.process
@pytest.mark.timeout(180)
def test_keys_in_a_real_terminal(command_line: Any) -> None:
    """A run in a terminal of its own: m marks, q ends it cleanly, the panel is straight."""
    leader, follower = pty.openpty()
    os.set_blocking(leader, False)
    environment = command_line.environment | {"COLUMNS": "72", "LINES": "40", "TERM": "xterm"}
    process = command_line.launch(
        [sys.executable, "-m", "hc_bringup", "run", "--scenario", "palpation_scan"],
        env=environment,
        stdin=follower,
        stdout=follower,
        stderr=follower,
        start_new_session=True,
    )
    os.close(follower)
    text = ""

    def read_until(condition: Any, what: str, timeout_s: float) -> None:
        nonlocal text
        end = time.monotonic() + timeout_s
        while not condition():
            assert time.monotonic() < end, f"{what}:\n{text[-3000:]}"
            try:
                text += os.read(leader, 65536).decode(errors="replace")
            except BlockingIOError:
                time.sleep(0.02)
            except OSError:
                assert condition(), what
                return

    try:
        read_until(lambda: "in contact" in text and "leads:" in text, "estimates", 120.0)
        read_until(lambda: "live page: http://127.0.0.1:" in text, "the address", 20.0)
        os.write(leader, b"m")
        read_until(lambda: "marked sample" in text, "the mark", 20.0)
        os.write(leader, b"q")
        read_until(lambda: "bag:" in text, "the summary", 60.0)
        assert process.wait(30) == 0
    finally:
        if process.poll() is None:
            process.send_signal(signal.SIGKILL)
            process.wait()
        os.close(leader)
