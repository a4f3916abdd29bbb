"""A node that compiles is waited for while it answers now and then; one that never does is not."""

import itertools
from types import SimpleNamespace

import pytest

from hc_bringup import runner
from hc_bringup.errors import UserError
from hc_bringup.monitor import NOT_STARTED
from hc_bringup.run_state import RunState
from hc_bringup.runner import Runner
from hc_bringup.statistics import EstimateStatistics
from hc_msgs_py.background import STARTING

COMPILING = f"{STARTING}compiling the filters, 8 of 9 done"


class Monitor:
    """Answers for the nodes, and lets the time pass."""

    def __init__(self, clock, answers):
        self._clock, self._answers = clock, answers

    def missing(self, name):
        return self._answers[name](self._clock[0])

    def namesakes(self, _name):
        return 1

    def spin(self, _seconds):
        self._clock[0] += 5.0


@pytest.fixture
def wait(monkeypatch):
    """Wait for nodes that answer as functions of the time say; return the phases shown."""

    def run(**answers):
        clock = [0.0]
        monkeypatch.setattr(runner.time, "monotonic", lambda: clock[0])
        phases = []
        waiting = Runner(SimpleNamespace(), lambda state: phases.append(state.phase))
        waiting._processes = [SimpleNamespace(name=name) for name in answers]
        monkeypatch.setattr(waiting, "_check_alive", lambda _state: None)
        waiting._wait_until_ready(Monitor(clock, answers), RunState(EstimateStatistics(), 1.0))
        return [phase for phase, _ in itertools.groupby(phases)]

    return run


def test_a_node_that_compiles_and_is_too_busy_to_answer_each_time_is_waited_for(wait):
    """Regression: "offers no ~/ready service after 240 s" while it said "8 of 9 done"."""

    def estimator(now):
        if now >= 900.0:
            return None
        return COMPILING if now % 100.0 < 50.0 else NOT_STARTED

    phases = wait(indenter=lambda _: None, estimator=estimator)
    assert "starting estimator" in phases
    assert any("8 of 9 done" in phase for phase in phases)


def test_a_node_that_never_answers_is_given_up_and_so_is_one_that_ceases_to(wait):
    with pytest.raises(UserError, match=r"^node recorder has not answered its ~/ready .* 240 s"):
        wait(estimator=lambda _: COMPILING, recorder=lambda _: NOT_STARTED)
    with pytest.raises(UserError, match=r"^node estimator has not answered"):
        wait(estimator=lambda now: COMPILING if now < 500.0 else NOT_STARTED)
