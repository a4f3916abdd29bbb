"""How long a command waits for discovery before it answers."""

from itertools import count

import pytest

from hc_bringup import graph as graph_module
from hc_bringup.graph import Graph


@pytest.fixture
def waited(monkeypatch: pytest.MonkeyPatch):
    """Run `settle` on a clock of its own, with nodes that never change; returns seconds."""

    def run(nodes=("/rig",), load="", **words) -> float:
        clock = [0.0]
        graph = Graph()
        graph._started = 0.0
        monkeypatch.setattr(graph_module.time, "monotonic", lambda: clock[0])
        monkeypatch.setattr(graph_module, "busy", lambda: load)
        monkeypatch.setattr(graph, "node_names", lambda hidden: list(nodes))
        monkeypatch.setattr(graph, "topics", lambda hidden: [("/sample", ["type"])])

        def spin(seconds: float) -> bool:
            clock[0] += seconds
            return True

        monkeypatch.setattr(graph, "spin", spin)
        graph.settle(**words)
        return clock[0]

    return run


def test_a_quiet_graph_is_answered_for_soon(waited) -> None:
    assert waited() == pytest.approx(0.8, abs=0.1)


def test_a_publisher_that_is_told_late_is_waited_for(waited) -> None:
    """Regression: `hc topic info` said 0 publishers on a busy machine."""
    asked = count()
    assert 0.9 < waited(expected=lambda: next(asked) > 4) < 1.5
    assert waited(expected=lambda: False) == pytest.approx(2.3, abs=0.1)


BUSY = " (machine busy: load 6.2 on 2 processors)"


def test_a_busy_machine_is_given_time_before_no_node_is_said_to_run(
    waited, capsys, monkeypatch
) -> None:
    """Regression: at a load of six `hc node list` said that no node was running."""
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    assert waited(nodes=(), load=BUSY) == pytest.approx(8.0, abs=0.1)
    assert capsys.readouterr().err == f"... not seen yet; looking for up to 8 s{BUSY}\n"
    assert waited(nodes=()) == pytest.approx(0.8, abs=0.1)
    assert waited(load=BUSY) == pytest.approx(0.8, abs=0.1)
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(("load", "longest_s"), [("", 2.3), (BUSY, 8.0)])
def test_what_is_asked_for_is_waited_for(monkeypatch, capsys, load, longest_s) -> None:
    clock = [0.0]
    graph = Graph()
    monkeypatch.setattr(graph_module.time, "monotonic", lambda: clock[0])
    monkeypatch.setattr(graph_module, "busy", lambda: load)
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    monkeypatch.setattr(graph, "spin", lambda seconds: clock.append(clock.pop() + seconds) or True)
    assert not graph.wait_for(lambda: False)
    assert clock[0] == pytest.approx(longest_s, abs=0.05)
    assert graph.wait_for(lambda: clock[0] > longest_s + 2.0)
    clock[0] = 0.0
    assert not graph.wait_for(lambda: False, 1.0)
    assert clock[0] == pytest.approx(1.0, abs=0.05)
    assert capsys.readouterr().err.count("looking for up to 8 s") == bool(load)
