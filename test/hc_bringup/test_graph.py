"""How long a command waits for discovery before it answers."""

from itertools import count

import pytest

from hc_bringup import graph as graph_module
from hc_bringup.graph import Graph


@pytest.fixture
def waited(monkeypatch: pytest.MonkeyPatch):
    """Run `settle` on a clock of its own, with nodes that never change; returns seconds."""

    def run(**words) -> float:
        clock = [0.0]
        graph = Graph()
        graph._started = 0.0
        monkeypatch.setattr(graph_module.time, "monotonic", lambda: clock[0])
        monkeypatch.setattr(graph, "node_names", lambda hidden: ["/rig"])
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
