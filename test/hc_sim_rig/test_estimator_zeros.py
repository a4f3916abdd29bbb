"""The slave and its estimator's zeros: asked for, and again when the estimator begins anew."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from types import SimpleNamespace
from typing import Any

import pytest
from hc_msgs.msg import EstimatorConfiguration, EstimatorEvent

from hc_msgs_py.topics import CONFIGURATION, EVENTS
from hc_sim_rig.ros import estimator_zeros
from hc_sim_rig.ros.estimator_zeros import EstimatorZeros


class StandInNode:
    """Gives what EstimatorZeros wants of a node; the test is the graph."""

    def __init__(self) -> None:
        self.heard: dict[str, Callable[[Any], None]] = {}
        self.tick: Callable[[], None] = lambda: None
        self.asked: list[tuple[str, Future]] = []
        self.ready = self.free = True

    def create_client(self, _kind: Any, name: str, *, qos_profile: Any) -> Any:
        del qos_profile

        def call(_request: Any) -> Future:
            future: Future = Future()
            self.asked.append((name.rsplit("/", 1)[1], future))
            return future

        return SimpleNamespace(call_async=call, service_is_ready=lambda: self.ready)

    def create_subscription(self, _kind: Any, name: str, handler: Any, _qos: Any) -> None:
        self.heard[name] = handler

    def create_timer(self, _period: float, handler: Any) -> None:
        self.tick = handler

    def configure(self, revision: int, cause: int, origin_s: int = 0) -> None:
        message = EstimatorConfiguration(revision=revision, cause=cause)
        message.time_origin.sec = origin_s
        self.heard[CONFIGURATION](message)

    def report(self, kind: int, revision: int) -> None:
        self.heard[EVENTS](EstimatorEvent(kind=kind, configuration_revision=revision))

    def answer(self, name: str, **fields: Any) -> None:
        """Answer the newest question, which must be this one."""
        asked, future = self.asked.pop()
        assert asked == name
        future.set_result(SimpleNamespace(**fields))

    def answer_zero(self, zero_mm: float) -> None:
        self.answer("get_parameters", values=[SimpleNamespace(double_value=zero_mm)])


STARTED, RECONFIGURED = EstimatorConfiguration.STARTED, EstimatorConfiguration.RECONFIGURED
LOADED = EstimatorConfiguration.STATE_LOADED


@pytest.fixture
def node(monkeypatch: pytest.MonkeyPatch) -> StandInNode:
    monkeypatch.setattr(estimator_zeros, "ASK_PERIOD_S", 0.0)
    return StandInNode()


@pytest.fixture
def zeros(node: StandInNode) -> EstimatorZeros:
    """Of an estimator whose surface was found: zero 1.5 mm, revision 2."""
    made = EstimatorZeros(node, find_surface=True, is_free=lambda: node.free)  # type: ignore[arg-type]
    node.tick()
    assert not node.asked  # the tool does not move yet
    made.begin()
    node.configure(1, STARTED)
    node.tick()
    node.answer("find_surface", success=True)
    node.configure(1, STARTED, origin_s=5)  # its first sample; no other estimator
    node.tick()
    assert not node.asked
    assert made.lives == 1
    node.configure(2, RECONFIGURED)
    assert not made.hold_for(2)
    node.report(EstimatorEvent.TARED, 2)
    node.answer_zero(1.5)
    return made


def test_the_surface_is_asked_for_until_it_is_looked_for_and_found(
    node: StandInNode, monkeypatch: pytest.MonkeyPatch
) -> None:
    zeros = EstimatorZeros(node, find_surface=True, is_free=lambda: node.free)  # type: ignore[arg-type]
    node.report(EstimatorEvent.TARED, 1)  # of before this slave: nobody knows where it was then
    zeros.begin()
    node.ready = False
    node.tick()
    assert not node.asked
    node.ready, node.free = True, False  # the tool presses
    node.tick()
    assert not node.asked
    node.free = True
    node.tick()
    node.tick()  # no answer so far: two questions would be two searches
    assert [name for name, _ in node.asked] == ["find_surface"]
    monkeypatch.setattr(estimator_zeros, "PATIENCE_S", 0.0)
    node.tick()
    assert len(node.asked) == 2
    node.answer("find_surface", success=False)  # it presses
    node.tick()
    node.answer("find_surface", success=True)
    node.asked.clear()
    node.tick()
    assert not node.asked
    node.report(EstimatorEvent.TARE_REFUSED, 1)
    node.tick()
    node.answer("find_surface", success=True)
    assert zeros.zero_mm is None


def test_a_tool_that_is_never_free_is_not_waited_for_for_ever(node: StandInNode) -> None:
    EstimatorZeros(node, find_surface=True, is_free=lambda: False).begin()  # type: ignore[arg-type]
    for _ in range(99):
        node.tick()
    assert not node.asked
    for _ in range(3):
        node.tick()
    assert [name for name, _ in node.asked] == ["find_surface"]


def test_estimates_of_the_configuration_with_this_zero_count(
    zeros: EstimatorZeros, node: StandInNode
) -> None:
    assert zeros.zero_mm == 1.5
    assert zeros.hold_for(2)
    assert not zeros.hold_for(1)
    assert not zeros.hold_for(3)  # its zero may be another
    node.configure(3, RECONFIGURED)  # somebody set input.position.zero
    assert not zeros.hold_for(3)
    node.answer_zero(1.75)
    assert zeros.hold_for(3)
    assert zeros.zero_mm == 1.75


@pytest.mark.parametrize("first_word_comes", [True, False])
def test_an_estimator_that_begins_anew_is_asked_anew(
    zeros: EstimatorZeros, node: StandInNode, first_word_comes: bool
) -> None:
    """Its revisions begin anew below those of before: the slave was deaf for good."""
    if first_word_comes:
        node.configure(1, STARTED)
    node.configure(1, STARTED, origin_s=9)
    assert zeros.lives == 2
    assert not zeros.found
    assert not zeros.hold_for(1)
    node.tick()
    node.answer("find_surface", success=True)
    node.configure(2, RECONFIGURED)
    node.report(EstimatorEvent.TARED, 2)
    node.answer_zero(0.5)
    assert zeros.hold_for(2)
    assert zeros.zero_mm == 0.5


def test_an_estimator_that_goes_on_from_its_kept_state_has_its_zeros(
    zeros: EstimatorZeros, node: StandInNode
) -> None:
    node.configure(4, LOADED)
    node.answer_zero(1.5)
    assert zeros.hold_for(4)
    assert zeros.lives == 1


def test_zeros_that_are_given_are_taken_as_they_are(node: StandInNode) -> None:
    """Not as 0: the estimator's configuration may have another."""
    zeros = EstimatorZeros(node, find_surface=False, is_free=lambda: node.free)  # type: ignore[arg-type]
    zeros.begin()
    node.configure(1, STARTED)
    node.answer_zero(-2.0)
    assert zeros.hold_for(1)
    assert zeros.zero_mm == -2.0
