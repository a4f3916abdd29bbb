"""A soak kills a node only when what follows is the kill's doing, and says what came of it."""

import dataclasses
import math
import os
import time

import pytest
from hc_msgs.msg import HuntCrossleyEstimate

from hc_bringup import soak_kills
from hc_bringup.run_state import RunState
from hc_bringup.soak_kills import PERIOD_S, SETTLED_S, KillReport
from hc_bringup.statistics import EstimateStatistics

PIDS = {"estimator": 1, "recorder": 2, "indenter": 3}


@pytest.fixture
def killed(monkeypatch):
    """Processes that would have been killed; time goes by as `state.elapsed_s` says."""
    pids = []
    monkeypatch.setattr(os, "kill", lambda pid, _number: pids.append(pid))
    return pids


def estimate(state, sequence, stiffness=0.2, latency=0.001):
    message = HuntCrossleyEstimate(
        sequence=sequence,
        stiffness=stiffness,
        damping=0.01,
        displacement_exponent=1.8,
        velocity_exponent=1.0,
        latency=latency,
    )
    state.statistics.add(message)


def at(state, elapsed_s, monkeypatch):
    state.elapsed_s = elapsed_s
    monkeypatch.setattr(time, "time_ns", lambda: round(elapsed_s * 1e9))


def test_nobody_is_killed_before_the_estimator_has_settled(killed, monkeypatch):
    """Regression: a change of settings that was still under way was taken for the kill's."""
    state = RunState(EstimateStatistics(), 600.0, "running", pids=dict(PIDS))
    killer = soak_kills._Killer()
    at(state, PERIOD_S + 1.0, monkeypatch)
    killer.look(state, SETTLED_S)
    assert not killed  # no estimate yet
    estimate(state, 0, latency=3.0)
    killer.look(state, SETTLED_S)
    assert not killed  # the estimates are those of three seconds ago
    estimate(state, 1)
    killer.look(state, 0.0)
    killer.look(state, SETTLED_S - 0.1)
    assert not killed  # it has just taken its own settings again
    killer.look(state, SETTLED_S)
    assert killed == [1]
    assert killer.waiting


def test_the_first_estimate_after_a_kill_is_held_against_the_last_before(killed, monkeypatch):
    state = RunState(EstimateStatistics(), 600.0, "running", pids=dict(PIDS))
    killer = soak_kills._Killer()
    at(state, 20.0, monkeypatch)
    estimate(state, 0)
    killer.look(state, SETTLED_S)
    at(state, 20.1, monkeypatch)
    estimate(state, 1, stiffness=9.0)  # was on its way
    killer.look(state, SETTLED_S)
    assert killer.waiting
    at(state, 21.5, monkeypatch)
    killer.look(state, SETTLED_S)
    assert killer.waiting
    estimate(state, 2, stiffness=0.202)
    killer.look(state, SETTLED_S)
    (kill,) = killer.kills
    assert not killer.waiting
    assert kill.node == "estimator"
    assert kill.back_after_s == pytest.approx(1.5)
    assert kill.change == pytest.approx(0.01)
    at(state, 39.9, monkeypatch)
    killer.look(state, SETTLED_S)
    assert killed == [1]
    at(state, 40.0, monkeypatch)
    killer.look(state, SETTLED_S)
    assert killed == [1, 2]


def test_a_report_fails_by_each_of_its_bounds():
    good = KillReport(
        duration_s=60.0,
        kills={"estimator": 1},
        respawns=1,
        back_after_s={"estimator": {"p50": 1.0, "max": 1.9}, "recorder": {"p50": 9.0, "max": 9.0}},
        change={"estimator": 0.009},
        recorder_lost_s=0.09,
        samples_lost=0,
        invalid=0,
        reconfigurations=1,
        viewers=1,
        worst={},
    )
    assert good.passed
    for bad in (
        {"samples_lost": 1},
        {"invalid": 1},
        {"respawns": 0},
        {"change": {"recorder": 0.011}},
        {"back_after_s": {"indenter": {"p50": 1.0, "max": 2.1}}},
        {"back_after_s": {"indenter": {"p50": 1.0, "max": math.nan}}},
        {"recorder_lost_s": 0.11},
    ):
        assert not dataclasses.replace(good, **bad).passed, bad
