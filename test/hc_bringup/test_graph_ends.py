"""hc topic, service and record on what is misspelt, of another type, or ends meanwhile."""

import re
import signal
import sys
import time

import pytest
from std_srvs.srv import Trigger

from hc_bringup import topic_tools
from hc_bringup.errors import UserError
from hc_bringup.graph import Graph, topic_name
from hc_bringup.service_calls import Client
from hc_bringup.topic_tools import QuietTopic, silence
from hc_msgs_py.node_processes import end

# A node that publishes, and offers a service that it never answers.
MUTE = """
import time, rclpy
from std_msgs.msg import Float64
from std_srvs.srv import Trigger

rclpy.init()
node = rclpy.create_node("mute")
publisher = node.create_publisher(Float64, "/readings", 10)
node.create_timer(0.02, lambda: publisher.publish(Float64(data=1.0)))
node.create_service(Trigger, "~/ask", lambda request, answer: time.sleep(60.0) or answer)
rclpy.spin(node)
"""


@pytest.fixture
def mute(command_line, tmp_path):
    path = tmp_path / "mute_node.py"
    path.write_text(MUTE)
    process = command_line.launch([sys.executable, str(path)])
    deadline = time.monotonic() + 60.0
    while "/mute" not in command_line.run("node", "list").stdout:
        assert process.poll() is None
        assert time.monotonic() < deadline
    return process


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("bad topic", "it must not contain characters other than alphanumerics"),
        ("a//b", "it must not contain repeated '/'"),
        ("/1a", "it must not have a token that starts with a number"),
        ("", "it must not end with a '/'"),
    ],
)
def test_what_no_topic_can_be_called_is_one_line(name: str, reason: str) -> None:
    with pytest.raises(UserError, match=reason):
        topic_name(name)


def test_patterns_are_names_of_topics() -> None:
    assert topic_name("*") == "*"
    assert topic_name("hc/est*") == "/hc/est*"
    assert topic_name("/a?") == "/a?"


def test_two_nodes_with_one_name_are_told(monkeypatch, capsys):
    """Regression: a parameter was set, or a tare made, and nobody knew of which of the two."""
    graph = Graph()
    names = ["/estimator", "/recorder"]
    monkeypatch.setattr(graph, "node_names", lambda **_: names)
    assert graph.require_node("estimator") == "/estimator"
    assert capsys.readouterr().err == ""
    names.append("/estimator")
    assert graph.require_node("estimator") == "/estimator"
    assert capsys.readouterr().err.startswith("2 nodes are called /estimator, and any of them")


class Publishers:
    """A graph with so many publishers of any topic."""

    def __init__(self, number: int) -> None:
        self.node = self
        self._number = number

    def count_publishers(self, _topic: str) -> int:
        return self._number


def test_silence_is_told_by_what_was_usual() -> None:
    now = time.monotonic()
    assert silence(Publishers(1), "/a", []) == ""
    assert silence(Publishers(1), "/a", [now - 0.2, now - 0.1]) == ""
    assert silence(Publishers(1), "/a", [now - 10.1, now - 10.0]) == "no message on /a for 10 s"
    assert silence(Publishers(1), "/a", [now - 40.0, now - 10.0]) == ""  # one each half a minute
    assert silence(Publishers(0), "/a", [now - 10.1, now - 10.0]).endswith(
        " (nobody publishes it any more)"
    )


def test_who_prints_messages_says_once_that_none_come(monkeypatch) -> None:
    now = 100.0
    monkeypatch.setattr(topic_tools.time, "monotonic", lambda: now)
    quiet = QuietTopic(Publishers(0), "/a")
    assert quiet.tell(0) == ""
    now += 2.5
    assert quiet.tell(0) == "no message on /a yet (nobody publishes it)"
    assert quiet.tell(0) == ""
    for _ in range(50):
        now += 0.02
        assert quiet.tell(1) == ""
    now += 2.5
    assert quiet.tell(0) == "no message on /a for 2 s (nobody publishes it any more)"
    now += 2.5
    assert quiet.tell(0) == ""
    assert quiet.tell(1) == ""
    now += 4.0
    assert quiet.tell(0) == "no message on /a for 4 s (nobody publishes it any more)"


@pytest.mark.slow
@pytest.mark.process
@pytest.mark.timeout(300)
def test_a_publisher_that_ends_is_told(command_line, mute) -> None:
    asking = {name: command_line.start("topic", name, "/readings") for name in ("hz", "bw")}
    # Data on standard output, what is said of them beside it.
    echo = command_line.start("topic", "echo", "/readings")
    assert "data: 1.0" in echo.stdout.readline()
    for process in asking.values():
        assert process.stdout.readline()
    end(mute, signal.SIGTERM)
    asking["echo"] = echo
    for name, process in asking.items():
        for line in process.stderr if name == "echo" else process.stdout:
            if line.rstrip().endswith("(nobody publishes it any more)"):
                break
        assert line.startswith("no message on /readings for ")
        process.send_signal(signal.SIGINT)
        assert process.wait(20) in (0, 130)


@pytest.mark.slow
@pytest.mark.process
@pytest.mark.timeout(300)
def test_a_node_that_ends_before_it_answers_is_told(command_line, mute, monkeypatch) -> None:
    for name, value in command_line.environment.items():
        monkeypatch.setenv(name, value)
    with Graph() as graph:
        client = Client(graph, Trigger, "/mute/ask")
        mute.send_signal(signal.SIGKILL)
        with pytest.raises(UserError, match="the node of /mute/ask ended before it answered"):
            client.call(Trigger.Request(), 250.0)


@pytest.mark.slow
@pytest.mark.process
@pytest.mark.timeout(300)
def test_a_node_that_is_stopped_is_there_and_does_not_answer(command_line, mute) -> None:
    """Regression: "there is no node", of one that somebody had stopped with Ctrl-Z."""
    mute.send_signal(signal.SIGSTOP)
    stopped = rf"stopped, so that it is there but does not answer: process {mute.pid} \(.*mute_node"
    for words, reason in (
        (("node", "info", "mute"), "there is no node /mute"),
        (("param", "list", "mute"), "there is no node /mute"),
        (("topic", "hz", "/readings"), "nobody publishes /readings"),
        (("service", "call", "/mute/ask"), "there is no service /mute/ask"),
    ):
        done = command_line.run(*words)
        assert (done.returncode, done.stdout, done.stderr.count("\n")) == (1, "", 1), done
        assert re.search(f"{reason}; .*{stopped}", done.stderr), done.stderr
        assert done.stderr.endswith(f"kill -CONT {mute.pid} lets it go on\n")
    done = command_line.run("node", "list")
    assert done.stdout == "no node is running\n"
    assert re.search(stopped, done.stderr), done.stderr
    mute.send_signal(signal.SIGCONT)
    done = command_line.run("node", "list")
    assert (done.stdout, done.stderr) == ("/mute\n", "")


@pytest.mark.slow
@pytest.mark.process
@pytest.mark.timeout(300)
def test_a_topic_of_another_type_is_not_published_on(command_line, mute) -> None:
    words = ("topic", "pub", "--once", "/readings", "std_msgs/msg/Int32", "{data: 1}")
    done = command_line.run(*words)
    assert (done.returncode, done.stdout) == (1, "")
    assert "/readings carries std_msgs/msg/Float64, and std_msgs/msg/Int32" in done.stderr
    done = command_line.run("topic", "bw", "/reading")
    assert (done.returncode, done.stderr.count("\n")) == (1, 1)
    assert "nobody publishes /reading; did you mean /readings?" in done.stderr


@pytest.mark.slow
@pytest.mark.process
@pytest.mark.timeout(300)
def test_a_recorder_says_which_names_nobody_publishes(command_line, mute) -> None:
    recorder = command_line.start("record", "/reading", "/readings", "-o", "bag")
    assert "recording into" in recorder.stdout.readline()
    told = recorder.stderr.readline()
    assert "nobody publishes /reading yet (did you mean /readings?)" in told
    recorder.send_signal(signal.SIGINT)
    assert recorder.wait(30) == 0
    count = int(recorder.stdout.readline().split()[0])
    assert count > 50
    done = command_line.run("bag", "filter", "bag", "part", "--topics", "/reading")
    assert "bag has no topic /reading; did you mean /readings?" in done.stderr
    done = command_line.run("bag", "split", "bag", "part", "--every", "0.0001")
    assert (done.returncode, done.stderr.count("\n")) == (1, 1)
    assert "10000 are the most" in done.stderr
    done = command_line.run("record", "-a", "-o", "bag")
    assert (done.returncode, "choose another folder with -o" in done.stderr) == (2, True)
