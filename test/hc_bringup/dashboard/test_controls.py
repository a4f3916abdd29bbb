"""Requests of the page on their way to a node: sent once, and only when the answer will arrive."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from rcl_interfaces.msg import ParameterType

from hc_bringup.dashboard import controls as module
from hc_bringup.dashboard.controls import ANSWER_S, READY_S, SETTLE_S, Controls
from hc_bringup.dashboard.recording import Recording


class Answer:
    """What a client's call returns: an answer that comes, or does not."""

    def __init__(self) -> None:
        self.response: Any = None

    def done(self) -> bool:
        return self.response is not None

    def result(self) -> Any:
        return self.response


class Client:
    """A client of a service; remembers what was asked."""

    def __init__(self) -> None:
        self.ready = True
        self.asked: list[Answer] = []

    def service_is_ready(self) -> bool:
        return self.ready

    def call_async(self, _request: Any) -> Answer:
        self.asked.append(Answer())
        return self.asked[-1]


class ParameterClient:
    """A parameter client whose first answers to changes are lost, as before discovery is over."""

    def __init__(self, lost: int, kind: int = ParameterType.PARAMETER_DOUBLE) -> None:
        self.lost, self.kind = lost, kind
        self.changes: list[list[Any]] = []

    def services_are_ready(self) -> bool:
        return True

    def get_parameters(self, names: list[str]) -> Answer:
        answer = Answer()
        answer.response = SimpleNamespace(values=[SimpleNamespace(type=self.kind) for _ in names])
        return answer

    def set_parameters_atomically(self, messages: list[Any]) -> Answer:
        self.changes.append(messages)
        answer = Answer()
        if len(self.changes) > self.lost:
            answer.response = SimpleNamespace(result=SimpleNamespace(successful=True, reason=""))
        return answer


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """The time that the controls see."""
    now = SimpleNamespace(s=100.0)
    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: now.s))
    return now


@pytest.fixture
def made(clock: SimpleNamespace) -> Any:
    """Controls on a node without ROS, and the clients that they made."""
    clients: dict[str, Client] = {}
    node = SimpleNamespace(
        create_publisher=lambda *_arguments: None,
        create_client=lambda _kind, name, **_qos: clients.setdefault(name, Client()),
        resolve_topic_name=lambda name: f"/{name}",
    )
    anything: Any = SimpleNamespace()
    controls = Controls(node, anything, anything, allowed=True)  # type: ignore[arg-type]
    return SimpleNamespace(controls=controls, clients=clients, clock=clock)


def test_a_service_is_asked_once_and_only_when_it_knows_its_client(made: Any) -> None:
    tare = made.clients["/estimator/tare"]  # made before anybody asks
    answer = made.controls.request({"op": "call", "node": "estimator", "service": "tare"})
    made.controls.tick()
    assert tare.asked == []
    made.clock.s += SETTLE_S
    made.controls.tick()
    assert len(tare.asked) == 1
    made.clock.s += 0.9 * ANSWER_S
    made.controls.tick()
    assert len(tare.asked) == 1
    assert not answer.done()
    tare.asked[0].response = SimpleNamespace(success=True, message="tared")
    made.controls.tick()
    assert answer.result(0) == {"ok": True, "message": "tared"}
    # A node that has started anew does not know the client yet.
    tare.ready = False
    made.controls.tick()
    tare.ready = True
    made.controls.request({"op": "call", "node": "estimator", "service": "tare"})
    made.controls.tick()
    assert len(tare.asked) == 1


def test_a_node_that_is_not_there_is_told_soon(made: Any) -> None:
    made.clients["/estimator/reset"].ready = False
    answer = made.controls.request({"op": "call", "node": "estimator", "service": "reset"})
    made.controls.tick()
    made.clock.s += READY_S + 0.1
    made.controls.tick()
    assert answer.result(0)["message"] == "/estimator/reset does not answer: is the node running?"


def test_a_change_is_made_once_although_answers_are_lost(made: Any) -> None:
    client = ParameterClient(lost=2)
    made.controls._parameter_clients["indenter"] = client
    wanted = {"stiffness": 0.33}
    answer = made.controls.request({"op": "set", "node": "indenter", "parameters": wanted})
    for _ in range(40):
        made.controls.tick()
        made.clock.s += 0.2
    assert answer.result(0) == {"ok": True, "message": "stiffness = 0.33"}
    assert [len(messages) for messages in client.changes] == [0, 0, 0, 1]


@pytest.mark.parametrize(
    ("kind", "value"),
    [
        (ParameterType.PARAMETER_DOUBLE_ARRAY, ["abc"]),
        (ParameterType.PARAMETER_DOUBLE_ARRAY, [[1.0]]),
        pytest.param(ParameterType.PARAMETER_DOUBLE, 10**400, id="huge-number"),
        pytest.param(ParameterType.PARAMETER_INTEGER, 10**400, id="huge-whole"),
        (ParameterType.PARAMETER_INTEGER, 2**63),
        (ParameterType.PARAMETER_INTEGER, float("inf")),
        (ParameterType.PARAMETER_BOOL, None),
    ],
)
def test_a_value_that_cannot_be_is_refused_and_the_node_lives(
    made: Any, kind: int, value: object
) -> None:
    client = ParameterClient(lost=0, kind=kind)
    made.controls._parameter_clients["indenter"] = client
    wanted = {"op": "set", "node": "indenter", "parameters": {"gain": value}}
    answer = made.controls.request(wanted)
    made.controls.tick()
    assert not answer.result(0)["ok"]
    assert not client.changes


@pytest.mark.parametrize(
    "message",
    [
        {"op": "mark", "text": "\ud800"},
        {"op": "set", "node": "indenter", "parameters": {"\ud800": 1}},
        {"op": "set", "node": "indenter", "parameters": {"gain": "\ud800"}},
    ],
)
def test_a_text_that_is_none_is_refused(made: Any, message: dict[str, Any]) -> None:
    answer = made.controls.request(message)
    made.controls.tick()
    assert "is no text" in answer.result(0)["message"]


@pytest.mark.parametrize("text", ["recorder: 5", "other:\n  ros__parameters: {a: 1}", "{", None])
def test_a_recording_without_a_parameter_file_is_refused(
    made: Any, tmp_path: Path, text: str | None
) -> None:
    file = tmp_path / "recorder.yaml"
    if text is not None:
        file.write_text(text)
    made.controls._recording = Recording(tmp_path, lambda: file)
    answer = made.controls.request({"op": "record", "on": True})
    made.controls.tick()
    assert not answer.result(0)["ok"]
    assert "recorder.yaml" in answer.result(0)["message"]
