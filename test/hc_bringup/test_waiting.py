"""A run without a panel says what its start and its end wait for."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from hc_bringup import heartbeat
from hc_bringup.conclusion import conclude
from hc_bringup.errors import UserError
from hc_bringup.heartbeat import Heartbeat
from hc_bringup.live import Display
from hc_bringup.plan import NodePlan
from hc_bringup.processes import NodeProcess
from hc_bringup.run_state import RunState
from hc_bringup.statistics import EstimateStatistics
from hc_bringup.wrapping import say
from hc_estimator.stream.readings import MEANINGS


def test_a_headless_run_says_what_it_waits_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """Regression: on a busy machine a run of 22 s was silent for 40 s more."""
    clock = [100.0]
    load = [1.0]
    monkeypatch.setattr(heartbeat.time, "monotonic", lambda: clock[0])
    monkeypatch.setattr(heartbeat.os, "getloadavg", lambda: (load[0], 0.0, 0.0))
    monkeypatch.setattr(heartbeat.os, "sched_getaffinity", lambda _: {0, 1})
    beat = Heartbeat()
    monkeypatch.setattr(heartbeat, "_heartbeat", beat)
    heartbeat.spoke()
    state = RunState(EstimateStatistics(), 22.0)

    def pass_time(seconds: float, phase: str, enabled: bool = False) -> list[str]:
        state.phase = phase
        display = Display(enabled=enabled)
        told = []
        for _ in range(round(10 * seconds)):
            display.show(state)
            clock[0] += 0.1
            told.append(beat.due())
        return list(filter(None, told))

    assert pass_time(2.9, "starting estimator") == []  # an ordinary start
    assert pass_time(5.0, "starting estimator") == [
        "... starting estimator, since 3 s",
        "... starting estimator, since 7 s",
    ]
    assert pass_time(22.0, "running") == []
    load[0] = 15.0
    assert pass_time(4.0, "stopping recorder") == [
        "... stopping recorder, since 3 s (machine busy: load 15.0 on 2 processors)"
    ]
    load[0] = 1.0
    assert pass_time(2.5, "waiting for the last estimates") == []
    # Nothing was said for a while: the next step is told sooner.
    assert pass_time(2.0, "stopping estimator") == ["... stopping estimator, since 1 s"]
    assert len(pass_time(180.0, "stopping estimator")) in (22, 23)  # after a minute seldom
    assert pass_time(30.0, "done") == []
    # Where it is shown, a line says so once, and then that it lasts.
    assert pass_time(6.0, "starting estimator", enabled=True) == [
        "... starting estimator, since 3 s"
    ]


def test_what_the_command_says_itself_puts_the_next_line_off(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    clock = [100.0]
    monkeypatch.setattr(heartbeat.time, "monotonic", lambda: clock[0])
    monkeypatch.setattr(heartbeat.os, "getloadavg", lambda: (0.0, 0.0, 0.0))
    beat = Heartbeat()
    monkeypatch.setattr(heartbeat, "_heartbeat", beat)
    heartbeat.spoke()
    heartbeat.doing("looking")
    clock[0] += 2.9
    say("found")
    clock[0] += 0.2
    assert beat.due() == ""
    heartbeat.telling("looking", "looking: 3 of 7")  # the same step: what is told of it
    clock[0] += 3.0
    assert beat.due() == "... looking: 3 of 7"
    heartbeat.nothing()
    clock[0] += 60.0
    assert beat.due() == ""
    assert capsys.readouterr().out == "found\n"


def test_who_ends_a_node_is_heard_while_it_takes_its_time(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(
        NodeProcess,
        "_command_line",
        lambda _: ["sh", "-c", "trap '' INT; echo up; sleep 0.6; exit 7"],
    )
    process = NodeProcess(NodePlan("slow", "none"), tmp_path)
    while not process.tail():
        assert process.exit_status() is None
    shown: list[int | None] = []
    assert process.stop(5.0, while_waiting=lambda: shown.append(process.exit_status())) == 7
    assert shown[0] is None


def test_what_the_estimator_doubts_is_in_the_summary_and_may_be_a_failure(
    capsys: pytest.CaptureFixture[str],
) -> None:
    state = RunState(EstimateStatistics(), 22.0, elapsed_s=22.0, samples=10)
    state.diagnostics = {
        "estimator": {
            "level": "1",
            "message": "",
            "suspect: force zero of force": "the force reads 1.7 N free of contact",
        }
    }
    conclude(state, [], None, as_json=False, with_latency=False)  # a zero is a warning
    told = capsys.readouterr().out
    assert "what cannot be right: the force reads 1.7 N free of contact\n" in told
    assert MEANINGS in told
    state.diagnostics["estimator"]["suspect: sign of force"] = "turn its sign"
    state.statistics.estimates = 10
    with pytest.raises(UserError, match="for the sign of a channel is wrong"):
        conclude(state, ["estimator"], None, as_json=True, with_latency=False)
    assert json.loads(capsys.readouterr().out)["suspicions"] == {
        "force zero of force": "the force reads 1.7 N free of contact",
        "sign of force": "turn its sign",
    }


def test_a_run_without_an_estimate_says_why_while_it_runs_and_in_the_end(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Regression: attitudes without a quaternion ended in "does anybody publish samples?"."""
    display = Display(enabled=False)
    state = RunState(EstimateStatistics(), 22.0, phase="running", elapsed_s=2.0)
    why = "waits for the first sample: 125 attitudes whose quaternion has no length"
    state.diagnostics = {"estimator": {"level": "0", "message": why}}
    display.show(state)
    assert capsys.readouterr().err == ""  # it has just begun
    state.elapsed_s = 6.0
    state.diagnostics["estimator"]["level"] = "1"
    for _ in range(3):
        display.show(state)
    assert capsys.readouterr().err == f"6.0 s: no estimate yet: {why} ({MEANINGS})\n"
    with pytest.raises(UserError, match=f"no estimate came in 6 s: {why}"):
        conclude(state, ["estimator"], None, as_json=False, with_latency=False)

    # A warning beside estimates is no silence.
    state.statistics.estimates = 10
    assert state.silent_reason == ""
    display.show(state)
    assert capsys.readouterr().err == "6.0 s: samples come again\n"
