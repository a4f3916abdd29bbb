"""The player as a process: everything comes out, unchanged, in order and once."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from hc_logger.reader import BagReader

PLAYER = "hc_logger.player_node"
Start = Callable[..., Any]
MakeBag = Callable[..., Path]


def listen(graph: Any) -> list[Any]:
    from hc_msgs.msg import IndenterSample

    from hc_msgs_py.qos import SAMPLE_QOS

    got: list[Any] = []
    graph.create_subscription(IndenterSample, "indenter/sample", got.append, SAMPLE_QOS, raw=True)
    return got


def test_a_bag_comes_out_as_it_was_recorded(
    start_node: Start, graph: Any, make_bag: MakeBag
) -> None:
    from std_msgs.msg import Header

    path = make_bag(count=1500)
    got = listen(graph)
    headers: list[Any] = []
    graph.create_subscription(Header, "/header", headers.append, 100)
    node = start_node(
        PLAYER,
        bag=path,
        exit_when_done=True,
        expected_sample_subscribers=1,
        topics="['indenter/*']",
    )
    assert graph.spin_until(lambda: node.process.poll() is not None)
    assert node.wait() == 0, node.error
    with BagReader(path) as reader:
        assert got == [m.data for m in reader.messages({"/indenter/sample"})]
    assert headers == []


def test_services_start_and_pause_it(start_node: Start, graph: Any, make_bag: MakeBag) -> None:
    from std_srvs.srv import SetBool, Trigger

    node = start_node(
        PLAYER,
        bag=make_bag(count=3000),
        start_paused=True,
        expected_sample_subscribers=1,
        exit_when_done=True,
        start_offset=1.0,
        duration=1.0,
        rate=2.0,
    )
    answer = graph.call(Trigger, "/player/ready")
    assert not answer.success
    assert answer.message == "/indenter/sample has 0 of 1 subscribers"
    got = listen(graph)
    assert graph.spin_until(lambda: graph.call(Trigger, "/player/ready").success)
    assert not graph.spin_until(lambda: bool(got), timeout=0.3)
    assert graph.call(SetBool, "/player/run", SetBool.Request(data=True)).success
    assert graph.spin_until(lambda: len(got) > 100)
    assert graph.call(SetBool, "/player/run", SetBool.Request(data=False)).message == "paused"
    graph.spin_until(lambda: False, timeout=0.2)
    count = len(got)
    assert not graph.spin_until(lambda: len(got) > count, timeout=0.3)
    graph.call(SetBool, "/player/run", SetBool.Request(data=True))
    assert graph.spin_until(lambda: node.process.poll() is not None)
    assert node.wait() == 0, node.error
    assert len(got) == 1001


@pytest.mark.parametrize(
    ("parameters", "expected"),
    [
        ({}, "parameter bag is empty"),
        ({"bag": "/nowhere/bag"}, "/nowhere/bag does not exist"),
        ({"start_offset": 99.0}, "start offset is 99 s, the bag lasts only"),
        ({"topics": "['/else']"}, "no topic of"),
        ({"rate": -1.0}, "rate"),
    ],
)
def test_a_wrong_start_is_one_line(
    start_node: Start, make_bag: MakeBag, parameters: dict[str, Any], expected: str
) -> None:
    if parameters and "bag" not in parameters:
        parameters = parameters | {"bag": make_bag(count=100)}
    node = start_node(PLAYER, **parameters)
    assert node.wait() == 2
    assert expected in node.error
    assert len(node.error.splitlines()) == 1


def test_an_empty_bag_is_one_line(start_node: Start, make_bag: MakeBag) -> None:
    node = start_node(PLAYER, bag=make_bag(count=0))
    assert node.wait() == 2
    assert "has no messages" in node.error
