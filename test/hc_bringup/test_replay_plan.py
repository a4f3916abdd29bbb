"""What `hc replay` starts for a bag: estimator and recorder take the messages that it holds."""

from __future__ import annotations

import argparse
import json
import shlex
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hc_msgs.msg import EstimatorConfiguration, EstimatorEvent
from rcl_interfaces.msg import Parameter as RosParameter
from rcl_interfaces.msg import ParameterValue
from rclpy.serialization import serialize_message
from std_msgs.msg import String

from hc_bringup.cli import main
from hc_bringup.commands import replay
from hc_bringup.errors import UserError
from hc_estimator.ros.node_settings import LARGEST_BACKLOG
from hc_estimator.stream.vocabulary import EventKind
from hc_logger.reader import BagReader
from hc_logger.recording import read_recording
from hc_logger.type_names import CONFIGURATION_TYPE, SAMPLE_TYPE, SAMPLES_TYPE
from hc_logger.writer import BagWriter
from hc_msgs_py.wire import SampleEncoder
from hc_msgs_py.wire_arrays import SamplesEncoder

START = 1_700_000_000_000_000_000
RATE_HZ = 4000
COUNT = 4000
TOGETHER = 4


def write_bag(folder: Path, *, arrays: bool) -> Path:
    """Write a second of pressing at 4 kHz, one by one or four in a message."""
    time = np.arange(COUNT) / RATE_HZ
    depth = 2.0 - 2.0 * np.cos(8.0 * time)
    force = 0.3 * depth**1.4
    stamps = START + np.round(time * 1e9).astype(np.int64)
    with BagWriter(folder) as writer:
        if arrays:
            topic, many = writer.add_topic("indenter/samples", SAMPLES_TYPE), SamplesEncoder()
            for i in range(0, COUNT, TOGETHER):
                part = slice(i, i + TOGETHER)
                data = many.encode(stamps[part], i, depth[part], force[part])
                writer.write(topic, int(stamps[i + TOGETHER - 1]), data)
        else:
            topic, one = writer.add_topic("indenter/sample", SAMPLE_TYPE), SampleEncoder()
            for i in range(COUNT):
                data = one.encode(int(stamps[i]), i, float(depth[i]), float(force[i]))
                writer.write(topic, int(stamps[i]), data)
    return folder


def write_arms(folder: Path, *names: str) -> Path:
    """Write what the nodes of arms in namespaces say: samples, an event, and the robot's own."""
    with BagWriter(folder) as writer:
        for name in names:
            topic = writer.add_topic(f"/{name}/indenter/sample", SAMPLE_TYPE)
            encode = SampleEncoder().encode
            for i in range(100):
                writer.write(topic, START + i * 10**6, encode(START + i * 10**6, i, 0.1 * i, 0.2))
            for other in ("hc/events", "mode"):
                topic = writer.add_topic(f"/{name}/{other}", "std_msgs/msg/String")
                writer.write(topic, START, serialize_message(String(data=name)))
    return folder


def plan_of(*words: str) -> Any:
    parser = argparse.ArgumentParser()
    replay.configure(parser)
    return replay._plan(parser.parse_args(words))[0]


@pytest.mark.parametrize(
    ("arrays", "given", "source", "form", "topics"),
    [
        (False, [], None, None, ["indenter/sample", "hc/estimate"]),
        (True, [], "samples", "arrays", ["indenter/samples", "hc/estimates"]),
        (True, ["each"], "samples", "each", ["indenter/samples", "hc/estimate"]),
        (True, ["both"], "samples", "both", ["indenter/samples", "hc/estimate"]),
        (False, ["arrays"], None, "arrays", ["indenter/sample", "hc/estimates"]),
    ],
)
def test_estimator_and_recorder_take_what_the_bag_holds(
    tmp_path: Path,
    arrays: bool,
    given: list[str],
    source: str | None,
    form: str | None,
    topics: list[str],
) -> None:
    bag = write_bag(tmp_path / "bag", arrays=arrays)
    words = [w for name in given for w in ("--param", f"output.estimates={name}")]
    plan = plan_of(str(bag), "--estimator", *words, "--bag", str(tmp_path / "out"))
    estimator = plan.node("estimator").parameters
    assert (estimator.get("input.source"), estimator.get("output.estimates")) == (source, form)
    assert plan.node("recorder").parameters["expected_topics"] == topics


@pytest.mark.parametrize(
    ("arrays", "topic"), [(False, "indenter/sample"), (True, "indenter/samples")]
)
def test_without_an_estimator_the_recorder_waits_for_what_is_played(
    tmp_path: Path, arrays: bool, topic: str
) -> None:
    bag = write_bag(tmp_path / "bag", arrays=arrays)
    plan = plan_of(str(bag), "--bag", str(tmp_path / "out"))
    assert plan.node("estimator") is None
    assert plan.node("recorder").parameters["expected_topics"] == [topic]


@pytest.mark.parametrize("given", [None, 300])
def test_a_busy_estimator_lets_a_replay_wait(tmp_path: Path, given: int | None) -> None:
    """Regression: at a load of 16 it left out 2,552 of 4,000 samples, as it does in a live run."""
    bag = write_bag(tmp_path / "bag", arrays=True)
    words = [] if given is None else ["--param", f"input.maximum_backlog={given}"]
    estimator = plan_of(str(bag), "--estimator", *words).node("estimator")
    assert estimator.parameters["input.maximum_backlog"] == (given or LARGEST_BACKLOG)


@pytest.mark.parametrize(
    "words",
    [
        ["--filter", "ukf", "--param", "filter=ekf"],
        ["--param", "initial_stiffness=1", "--param", "initial_stiffness=2"],
    ],
)
def test_what_is_given_twice_is_refused(tmp_path: Path, words: list[str]) -> None:
    bag = write_bag(tmp_path / "bag", arrays=True)
    with pytest.raises(UserError, match="given twice"):
        plan_of(str(bag), *words)


def test_an_estimator_takes_the_samples_of_a_namespace(tmp_path: Path) -> None:
    """Regression: it waited for /indenter/sample and the player for /left/indenter/sample."""
    bag = str(write_arms(tmp_path / "left", "left"))
    told = plan_of(bag, "--estimator").node("player").parameters
    assert told["remap"] == ["/left/indenter/sample:=/indenter/sample"]
    assert "/left/hc/*" in told["exclude"]
    assert "/hc/*" in told["exclude"]
    alone = plan_of(bag).node("player").parameters  # without one all is played as it was
    assert (alone["remap"], alone["exclude"]) == ([""], [""])
    plain = plan_of(str(write_bag(tmp_path / "plain", arrays=False)), "--estimator")
    assert plain.node("player").parameters["remap"] == [""]


def test_of_the_bag_of_two_arms_what_makes_one_of_it_is_told(tmp_path: Path, capsys: Any) -> None:
    """Regression: every command said "name one", and none has an option for that."""
    bag = str(write_arms(tmp_path / "two arms", "left", "right"))
    words = ["bag", "filter", bag, str(tmp_path / "one"), "--topics", "/left/*"]
    for command in (["estimate", bag], ["report", bag, "-o", str(tmp_path / "r.html")]):
        assert main(command) == 1
        said = capsys.readouterr().err
        typed = shlex.split(said.rpartition("make a bag of one: hc ")[2])
        assert typed == [*words[:2], "BAG", "NEW", *words[4:]], said
    with pytest.raises(UserError, match="make a bag of one"):
        plan_of(bag, "--estimator")
    assert plan_of(bag).node("player") is not None
    assert main(words) == 0
    assert len(read_recording(tmp_path / "one").time_s) == 100


def test_what_is_no_bag_is_said_before_anything_starts(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    with pytest.raises(UserError, match="empty"):
        plan_of(str(tmp_path / "empty"))


@pytest.mark.slow
@pytest.mark.process
def test_a_replay_of_arrays_records_arrays_and_loses_nothing(command_line: Any) -> None:
    folder = Path(command_line.folder)
    write_bag(folder / "bag", arrays=True)
    words = ("replay", "bag", "--filter", "ukf", "--bag", "out", "--json", "--headless")
    done = command_line.run(*words, timeout=240)
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert (summary["samples"], summary["estimates"], summary["lost"]) == (COUNT, COUNT, 0)
    recorded = read_recording(folder / "out")
    assert np.array_equal(recorded.estimates["sequence"], np.arange(COUNT))
    verified = command_line.run("estimate", "out", "--verify", "--json", timeout=240)
    assert verified.returncode == 0, verified.stderr
    checked = json.loads(verified.stdout)
    assert (checked["compared"], checked["different"]) == (COUNT, 0)


def test_an_estimator_is_not_left_waiting_for_samples_that_no_bag_has(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Regression: "node player does not get ready within 15 s: /ft has 0 of 1 subscribers"."""
    with BagWriter(tmp_path / "bag") as writer:
        topic = writer.add_topic("/note", "std_msgs/msg/String")
        writer.write(topic, START, serialize_message(String(data="x")))
    assert main(["replay", str(tmp_path / "bag"), "--filter", "ukf", "--headless"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "has no samples (hc_msgs/IndenterSample) for an estimator: hc estimate " in line


def add_what_the_node_said(folder: Path, target: Path, space: str = "") -> Path:
    """Copy a bag of samples with a search for the surface half a second behind the first one."""
    with BagReader(folder) as bag, BagWriter(target) as writer:
        names = {n: space + n for n in bag.topics}
        numbers = {n: writer.add_topic(names[n], t.definition.name) for n, t in bag.topics.items()}
        events = writer.add_topic(f"{space}/hc/events", "hc_msgs/msg/EstimatorEvent")
        told = writer.add_topic(f"{space}/hc/configuration", CONFIGURATION_TYPE)
        configuration = EstimatorConfiguration(revision=2, filter="ukf")
        for name, value in (("input.force.zero", 0.4), ("input.position.zero", 0.0)):
            number = ParameterValue(type=3, double_value=value)
            configuration.parameters.append(RosParameter(name=name, value=number))
        writer.write(told, START - 10**9, serialize_message(configuration))
        event = EstimatorEvent(kind=int(EventKind.RESET), reason="read otherwise: input.force.zero")
        event.reason += " = 0.4, input.position.zero = 0.0"
        event.header.stamp.sec, event.header.stamp.nanosec = divmod(START + 5 * 10**8, 10**9)
        for message in bag.messages():
            writer.write(numbers[message.topic], message.log_time, message.data)
        writer.write(events, START + 10**9, serialize_message(event))
    return target


@pytest.mark.parametrize("space", ["", "/left"])
def test_a_replay_says_what_the_estimator_beside_it_hears_nothing_of(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], space: str
) -> None:
    """Regression: K of a bag with a search for the surface inside was another, without a line."""
    plain = write_bag(tmp_path / "a", arrays=False)
    bag = str(add_what_the_node_said(plain, tmp_path / "b", space))
    plan_of(bag, "--estimator")
    said = capsys.readouterr().err
    assert f"{bag}: the sensors were read otherwise from 0.50 s on: input.force.zero = 0.4" in said
    assert "the estimator beside them hears none of that: hc bag filter --start and" in said
    assert "took off force.zero=0.4: for one that does, say --param input.force.zero=0.4" in said
    plan_of(bag, "--param", "input.force.zero=0.4")
    said = capsys.readouterr().err
    assert "took off" not in said
    assert "read otherwise" in said
    plan_of(bag)  # nobody estimates
    assert capsys.readouterr().err == ""


def test_nothing_is_said_of_a_bag_that_was_read_alike(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    plan_of(str(write_bag(tmp_path / "a", arrays=False)), "--estimator")
    assert capsys.readouterr().err == ""
