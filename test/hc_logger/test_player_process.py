"""The player as a process: everything comes out, unchanged, in order and once."""

from __future__ import annotations

import itertools
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from hc_logger.definitions import installed_definition
from hc_logger.player_node import PlayerNode
from hc_logger.reader import BagReader
from hc_logger.writer import BagWriter
from hc_msgs_py.node_processes import Processes

PLAYER = "hc_logger.player_node"
Start = Callable[..., Any]
MakeBag = Callable[..., Path]


def listen(graph: Any) -> list[Any]:
    from hc_msgs.msg import IndenterSample

    from hc_msgs_py.qos import ESTIMATE_QOS

    got: list[Any] = []
    graph.create_subscription(IndenterSample, "indenter/sample", got.append, ESTIMATE_QOS, raw=True)
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
        rate=3.0,
    )
    assert graph.spin_until(lambda: node.process.poll() is not None)
    assert node.wait() == 0, node.error
    graph.spin_until(lambda: len(got) >= 1500, timeout=5)
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
    assert graph.call(SetBool, "/player/run", SetBool.Request(data=False)).message.startswith(
        "paused"
    )
    graph.spin_until(lambda: False, timeout=0.2)
    count = len(got)
    assert not graph.spin_until(lambda: len(got) > count, timeout=0.3)
    graph.call(SetBool, "/player/run", SetBool.Request(data=True))
    assert graph.spin_until(lambda: node.process.poll() is not None)
    assert node.wait() == 0, node.error
    graph.spin_until(lambda: len(got) >= 1001, timeout=5)
    assert len(got) == 1001


@pytest.mark.parametrize(
    ("parameters", "expected"),
    [
        ({}, "parameter bag is empty"),
        ({"bag": "/nowhere/bag"}, "/nowhere/bag does not exist"),
        ({"start_offset": 99.0}, "start offset is 99 s, the bag lasts only"),
        ({"topics": "['/else']"}, "no topic of"),
        ({"rate": -1.0}, "rate"),
        ({"keyboard": True}, "there is no keyboard"),
        ({"remap": "['a']"}, "'a' is not recorded:=played"),
        ({"remap": "['/no:=/b']"}, "has no topic /no"),
        ({"clock_rate": 1e-12}, "clock_rate = 1e-12 is not 0 or from 0.001 Hz"),
    ],
)
def test_a_wrong_start_is_refused(
    refusal: Callable[..., str], make_bag: MakeBag, parameters: dict[str, Any], expected: str
) -> None:
    if parameters and "bag" not in parameters:
        parameters = parameters | {"bag": make_bag(count=100)}
    assert expected in refusal(PlayerNode, **parameters)


def test_an_empty_bag_is_one_line(start_node: Start, make_bag: MakeBag) -> None:
    node = start_node(PLAYER, bag=make_bag(count=0))
    assert node.wait() == 2
    assert "has no messages" in node.error
    assert len(node.error.splitlines()) == 1


def test_a_damaged_file_with_any_name_is_played(
    start_node: Start, make_bag: MakeBag, tmp_path: Path
) -> None:
    """Regression: a name that is not UTF-8 ended the player, in its log and its diagnostics."""
    whole = (make_bag(count=500, chunk_bytes=4096) / "bag_0.mcap").read_bytes()
    folder = tmp_path / "odd"
    folder.mkdir()
    (folder / os.fsdecode(b"\xff_0.mcap")).write_bytes(whole[: len(whole) // 2])
    node = start_node(PLAYER, bag=folder, exit_when_done=True)
    assert node.wait() == 0
    assert "\\udcff_0.mcap: cut off at byte" in node.error
    assert "Traceback" not in node.error


def values(graph: Any) -> dict[str, str]:
    """The player's next diagnostics."""
    from diagnostic_msgs.msg import DiagnosticArray

    got: list[Any] = []
    subscription = graph.create_subscription(DiagnosticArray, "/diagnostics", got.append, 10)
    assert graph.spin_until(lambda: any(m.status[0].name == "player" for m in got))
    graph.destroy_subscription(subscription)
    status = next(m.status[0] for m in got if m.status[0].name == "player")
    return {"message": status.message} | {v.key: v.value for v in status.values}


def set_parameter(graph: Any, name: str, value: Any) -> Any:
    from rcl_interfaces.srv import SetParameters
    from rclpy.parameter import Parameter

    request = SetParameters.Request(parameters=[Parameter(name, value=value).to_parameter_msg()])
    return graph.call(SetParameters, "/player/set_parameters", request).results[0]


@pytest.mark.slow
def test_step_burst_and_seek(start_node: Start, graph: Any, make_bag: MakeBag) -> None:
    from hc_msgs.msg import IndenterSample
    from rclpy.serialization import deserialize_message
    from std_srvs.srv import Trigger

    raw = listen(graph)

    def sequences() -> list[int]:
        return [deserialize_message(data, IndenterSample).sequence for data in raw]

    def settled(count: int) -> list[int]:
        assert graph.spin_until(lambda: len(raw) >= count)
        graph.spin_until(lambda: False, timeout=0.1)
        return sequences()

    node = start_node(
        PLAYER,
        bag=make_bag(count=3000),
        start_paused=True,
        topics="['indenter/*']",
        burst_count=25,
        expected_sample_subscribers=1,
    )
    assert graph.spin_until(lambda: graph.call(Trigger, "/player/ready").success)
    assert graph.spin_until(
        lambda: values(graph)["message"] == "waits for ~/run or its subscribers"
    )
    graph.call(Trigger, "/player/play_next")
    assert settled(1) == [0]
    graph.call(Trigger, "/player/play_next")
    assert settled(2) == [0, 1]
    graph.call(Trigger, "/player/burst")
    assert settled(27) == list(range(27))
    assert set_parameter(graph, "position", 2.0).successful
    graph.call(Trigger, "/player/play_next")
    assert settled(28)[-1] == 2000
    refused = set_parameter(graph, "position", 99.0)
    assert "outside 0 to 2.999 s" in refused.reason
    assert set_parameter(graph, "position", 1.0).successful
    assert set_parameter(graph, "rate", 10.0).successful
    assert graph.call(Trigger, "/player/toggle_paused").message.startswith("plays from 1.000 s")
    assert settled(28 + 2000)[28:] == list(range(1000, 3000))
    # from the end back to where one likes
    assert set_parameter(graph, "position", 2.5).successful
    assert settled(28 + 2500)[2028:] == list(range(2500, 3000))
    assert node.end() == 0, node.error


@pytest.mark.slow
def test_clock_loop_and_new_names(start_node: Start, graph: Any, make_bag: MakeBag) -> None:
    from hc_msgs.msg import IndenterSample
    from rosgraph_msgs.msg import Clock

    from hc_msgs_py.qos import ESTIMATE_QOS

    times: list[float] = []
    got: list[int] = []
    graph.create_subscription(
        Clock, "/clock", lambda m: times.append(m.clock.sec + m.clock.nanosec * 1e-9), 100
    )
    graph.create_subscription(
        IndenterSample, "other/name", lambda m: got.append(m.sequence), ESTIMATE_QOS
    )
    node = start_node(
        PLAYER,
        bag=make_bag(count=1000),
        remap="['indenter/sample:=other/name']",
        expected_sample_subscribers=1,
        clock_rate=100.0,
        rate=2.0,
        loop=True,
    )
    assert graph.spin_until(lambda: len(got) >= 2500, timeout=60.0), (len(got), len(times))
    assert got[:2500] == [*range(1000), *range(1000), *range(500)]
    start = 1_700_000_000.123456789
    assert all(start - 1e-3 <= t <= start + 1.0 for t in times)
    steps = [b - a for a, b in itertools.pairwise(times)]
    assert sum(step < 0 for step in steps) == 2  # two jumps back to the start
    forward = sorted(step for step in steps if step > 0)
    assert forward[len(forward) // 2] == pytest.approx(0.02, abs=0.004)  # 100 Hz at twice the speed
    assert node.end() == 0, node.error


@pytest.mark.slow
def test_keys_of_a_terminal(processes: Processes, graph: Any, make_bag: MakeBag) -> None:
    """A player on a pseudo terminal: space, right, up; and the terminal is given back."""
    import os
    import pty
    import sys
    import termios

    from std_srvs.srv import Trigger

    got = listen(graph)
    path = make_bag(count=800)
    controller, terminal = pty.openpty()
    before = termios.tcgetattr(terminal)
    command = [sys.executable, "-m", PLAYER, "--ros-args"]
    for parameter in (
        f"bag:={path}",
        "keyboard:=true",
        "start_paused:=true",
        "exit_when_done:=true",
    ):
        command += ["-p", parameter]

    def take_terminal() -> None:
        import fcntl

        os.setsid()
        fcntl.ioctl(terminal, termios.TIOCSCTTY, 0)

    process = processes.launch(command, stdin=terminal, stdout=None, preexec_fn=take_terminal)
    try:
        assert graph.spin_until(lambda: graph.call(Trigger, "/player/ready").success)
        assert graph.spin_until(lambda: not termios.tcgetattr(terminal)[3] & termios.ICANON)
        graph.spin_until(lambda: False, timeout=0.3)
        os.write(controller, b"\x1b[C")
        assert graph.spin_until(lambda: len(got) >= 1)
        os.write(controller, b"\x1b[A\x1b[A\x1b[A\x1b[Bx ")
        assert graph.spin_until(lambda: process.poll() is not None)
        assert process.wait(5) == 0
        graph.spin_until(lambda: len(got) >= 800, timeout=5)
        assert len(got) == 800
        assert termios.tcgetattr(terminal) == before
        text = process.stderr.read()
        for line in ("rate 1.1", "rate 1.21", "rate 1.33", "plays one message", "plays from"):
            assert line in text
    finally:
        if process.poll() is None:
            process.kill()
        process.communicate(timeout=10)
        os.close(controller)
        os.close(terminal)


def test_a_name_that_ros_does_not_permit_is_left_out(
    start_node: Start, graph: Any, make_bag: MakeBag, tmp_path: Path
) -> None:
    """Regression: "the node failed: InvalidTopicNameException", and nothing was played."""
    with BagReader(make_bag(count=40)) as reader, BagWriter(tmp_path / "odd") as writer:
        definition = reader.topics["/indenter/sample"].definition
        for name in ("/a b\x1b[2J", "/indenter/sample"):
            number = writer.add_topic(name, definition.name, definition=definition)
            for message in reader.messages({"/indenter/sample"}):
                writer.write(number, message.log_time, message.data)
    got = listen(graph)
    node = start_node(
        PLAYER, bag=tmp_path / "odd", exit_when_done=True, expected_sample_subscribers=1
    )
    assert graph.spin_until(lambda: node.process.poll() is not None)
    assert node.wait() == 0, node.error
    graph.spin_until(lambda: len(got) >= 40, timeout=5)
    assert len(got) == 40
    assert "/a b\\u001b[2J is not played: ROS permits no such name" in node.error


def test_messages_of_another_definition_are_not_played(
    refusal: Callable[..., str], tmp_path: Path
) -> None:
    """Others would read wrong numbers out of them without a word."""
    definition = installed_definition("hc_msgs/msg/IndenterSample")
    other = definition._replace(type_hash="RIHS01_" + 64 * "0")
    with BagWriter(tmp_path / "bag") as writer:
        topic = writer.add_topic("/indenter/sample", other.name, definition=other)
        writer.write(topic, 1, b"\0\1\0\0" + bytes(60))
    line = refusal(PlayerNode, bag=tmp_path / "bag")
    assert "was recorded with another definition than the one installed here" in line


@pytest.mark.parametrize(
    ("topics", "said"),
    [
        ("['header']", "/header has 0 of 1 subscribers"),
        ("['indenter/sample', '/header']", "/indenter/sample has 0 of 1 subscribers"),
    ],
)
def test_whose_subscribers_are_counted_can_be_named(
    start_node: Start, graph: Any, make_bag: MakeBag, topics: str, said: str
) -> None:
    from std_msgs.msg import Header
    from std_srvs.srv import Trigger

    node = start_node(
        PLAYER,
        bag=make_bag(count=300),
        start_paused=True,
        expected_topics=topics,
        expected_sample_subscribers=1,
    )
    answer = graph.call(Trigger, "/player/ready")
    assert (answer.success, answer.message.partition(";")[0]) == (False, said)
    listen(graph)
    graph.create_subscription(Header, "/header", print, 10)
    assert graph.spin_until(lambda: graph.call(Trigger, "/player/ready").success)
    assert node.end() == 0, node.error


def test_a_topic_to_wait_for_that_is_not_played_is_refused(
    refusal: Callable[..., str], make_bag: MakeBag
) -> None:
    said = refusal(PlayerNode, bag=make_bag(count=10), expected_topics="['/no']")
    assert "has nothing to play on /no: /header, /indenter/sample" in said
