"""The recorder as a process: nothing lost, types and QoS right, clean ends, clear refusals."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from hc_logger.info import bag_info
from hc_logger.layout import records
from hc_logger.reader import BagReader
from hc_logger.recorder_node import RecorderNode
from hc_logger.recording import read_recording

RECORDER = "hc_logger.recorder_node"
Start = Callable[..., Any]


def ready(graph: Any) -> tuple[bool, str]:
    from std_srvs.srv import Trigger

    answer = graph.call(Trigger, "/recorder/ready")
    return answer.success, answer.message


def wait_until_ready(graph: Any) -> None:
    assert graph.spin_until(lambda: ready(graph)[0]), ready(graph)[1]


def publish_samples(publisher: Any, count: int, first: int = 0) -> None:
    from hc_msgs.msg import IndenterSample

    message = IndenterSample()
    for sequence in range(first, first + count):
        message.sequence = sequence
        message.header.stamp.sec = sequence
        publisher.publish(message)
        if sequence % 20 == 0:
            time.sleep(0.002)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGHUP])
@pytest.mark.parametrize(("removes", "messages"), [(True, 0), (True, 1), (False, 0)])
def test_a_bag_goes_where_that_was_asked_for_and_no_message_came(
    start_node: Start, graph: Any, tmp_path: Path, number: int, removes: bool, messages: int
) -> None:
    from hc_msgs.msg import IndenterSample

    from hc_msgs_py.qos import ESTIMATE_QOS

    samples = graph.create_publisher(IndenterSample, "indenter/sample", ESTIMATE_QOS)
    bag = tmp_path / "bag"
    node = start_node(
        RECORDER,
        output=bag,
        topics="[indenter/sample]",
        expected_topics="[indenter/sample]",
        remove_empty=str(removes).lower(),
    )
    wait_until_ready(graph)
    publish_samples(samples, messages)
    time.sleep(0.2)
    assert node.end(number) == 0, node.error
    assert [*tmp_path.iterdir()] == ([] if removes and not messages else [bag])
    if bag.exists():
        assert bag_info(bag).message_count == messages


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_everything_received_is_written(
    start_node: Start, graph: Any, tmp_path: Path, number: int
) -> None:
    from hc_msgs.msg import EstimatorConfiguration, IndenterSample

    from hc_msgs_py.qos import CONFIGURATION_QOS, ESTIMATE_QOS, SAMPLE_QOS

    bag = tmp_path / "bag"
    samples = graph.create_publisher(IndenterSample, "indenter/sample", ESTIMATE_QOS)
    configurations = graph.create_publisher(
        EstimatorConfiguration, "hc/configuration", CONFIGURATION_QOS
    )
    configurations.publish(EstimatorConfiguration(revision=1))  # before the recorder exists
    node = start_node(
        RECORDER,
        output=bag,
        expected_topics="[indenter/sample, hc/configuration, not/yet]",
        custom_data="['seed=7', 'text=a=b']",
    )
    assert graph.spin_until(lambda: ready(graph)[1] == "/not/yet has no publisher yet")
    late = graph.create_publisher(IndenterSample, "not/yet", SAMPLE_QOS)
    wait_until_ready(graph)
    publish_samples(samples, 2000)
    publish_samples(late, 10)
    hashes = {
        topic: graph.get_publishers_info_by_topic(topic)[0].topic_type_hash
        for topic in ("/indenter/sample", "/hc/configuration")
    }
    time.sleep(0.2)
    assert node.end(number) == 0, node.error
    with BagReader(bag) as reader:
        assert reader.complete
        assert reader.custom_data["seed"] == "7"
        assert reader.custom_data["text"] == "a=b"
        for topic, expected in hashes.items():
            assert reader.topics[topic].definition.type_hash == str(expected)
        definition = reader.topics["/indenter/sample"].definition
        for topic, count in (("/indenter/sample", 2000), ("/not/yet", 10)):
            table = records(definition, reader.columns(topic))
            np.testing.assert_array_equal(table["sequence"], np.arange(count))
        profiles = {n: t.qos_profiles[0] for n, t in reader.topics.items()}
        assert profiles["/hc/configuration"]["durability"] == "transient_local"
        assert profiles["/indenter/sample"]["reliability"] == "reliable"
        assert profiles["/not/yet"]["reliability"] == "best_effort"
    (configuration,) = read_recording(bag, topic="indenter/sample").configurations
    assert configuration.revision == 1
    metadata = yaml.safe_load((bag / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert metadata["version"] == 9
    assert metadata["message_count"] == bag_info(bag).message_count
    assert node.error == ""


def test_a_chosen_list_and_a_publisher_with_other_qos(
    start_node: Start, graph: Any, tmp_path: Path
) -> None:
    """A reliable publisher first, then a best-effort one on the same topic."""
    from hc_msgs.msg import IndenterSample

    from hc_msgs_py.qos import ESTIMATE_QOS, SAMPLE_QOS

    bag = tmp_path / "bag"
    first = graph.create_publisher(IndenterSample, "indenter/sample", ESTIMATE_QOS)
    other = graph.create_publisher(IndenterSample, "other/sample", SAMPLE_QOS)
    node = start_node(
        RECORDER, output=bag, topics="['indenter/*']", expected_topics="[indenter/sample]"
    )
    wait_until_ready(graph)
    assert graph.spin_until(lambda: first.get_subscription_count() == 1)
    publish_samples(first, 100)
    second = graph.create_publisher(IndenterSample, "indenter/sample", SAMPLE_QOS)
    assert graph.spin_until(lambda: second.get_subscription_count() == 1)
    time.sleep(0.3)
    publish_samples(second, 100, first=1000)
    publish_samples(other, 10)
    time.sleep(0.2)
    assert node.end() == 0, node.error
    with BagReader(bag) as reader:
        assert list(reader.topics) == ["/indenter/sample"]
    sequence = read_recording(bag).sequence
    np.testing.assert_array_equal(sequence, [*range(100), *range(1000, 1100)])


def test_nothing_of_the_others_is_lost_where_a_publisher_comes_with_other_qos(
    start_node: Start, graph: Any, tmp_path: Path
) -> None:
    """Regression: what was on its way while the recorder subscribed anew was lost, 1 to 5 of it."""
    from hc_msgs.msg import IndenterSample

    from hc_msgs_py.qos import ESTIMATE_QOS, SAMPLE_QOS

    bag = tmp_path / "bag"
    steady = graph.create_publisher(IndenterSample, "indenter/sample", ESTIMATE_QOS)
    node = start_node(RECORDER, output=bag, expected_topics="[indenter/sample]")
    wait_until_ready(graph)
    assert graph.spin_until(lambda: steady.get_subscription_count() == 1)
    sent = 0
    other = None
    end = time.monotonic() + 2.5
    while (now := time.monotonic()) < end:
        if other is None and now > end - 2.0:
            other = graph.create_publisher(IndenterSample, "indenter/sample", SAMPLE_QOS)
        publish_samples(steady, 1, first=sent)
        sent += 1
        time.sleep(0.0001)
    time.sleep(0.3)
    assert node.end() == 0, node.error
    np.testing.assert_array_equal(read_recording(bag).sequence, np.arange(sent))


@pytest.mark.slow
def test_losses_are_counted_and_reported(start_node: Start, graph: Any, tmp_path: Path) -> None:
    """More at once than the recorder's queue holds: what it missed shows in its diagnostics."""
    from diagnostic_msgs.msg import DiagnosticArray
    from hc_msgs.msg import IndenterSample

    from hc_msgs_py.qos import SAMPLE_QOS

    reports: list[dict[str, str]] = []
    graph.create_subscription(
        DiagnosticArray,
        "/diagnostics",
        lambda m: reports.append({v.key: v.value for v in m.status[0].values}),
        10,
    )
    samples = graph.create_publisher(IndenterSample, "indenter/sample", SAMPLE_QOS)
    bag = tmp_path / "bag"
    node = start_node(RECORDER, output=bag, queue_depth=5, expected_topics="[indenter/sample]")
    wait_until_ready(graph)
    for first in range(0, 600, 300):
        publish_samples(samples, 1, first=first)
        time.sleep(0.1)
        for sequence in range(first + 1, first + 300):
            samples.publish(IndenterSample(sequence=sequence))
        time.sleep(0.1)
    assert graph.spin_until(lambda: bool(reports) and int(reports[-1]["messages"]) > 4)
    reports.clear()
    assert graph.spin_until(lambda: bool(reports))
    dropped = int(reports[-1]["/indenter/sample dropped"])
    assert node.end() == 0, node.error
    info = next(t for t in bag_info(bag).topics if t.name == "/indenter/sample")
    assert dropped == info.lost
    assert 0 < dropped == 600 - info.message_count


@pytest.mark.parametrize(
    ("parameters", "expected"),
    [
        ({}, "parameter output is empty"),
        ({"output": "there"}, "there exists already"),
        ({"output": "file/bag"}, "cannot make the bag folder"),
        ({"output": "new", "custom_data": "['novalue']"}, "'novalue' is not key=value"),
        ({"output": "new", "flush_interval": 100.0}, "flush_interval"),
        (
            {"output": "new", "expected_topics": "[a]", "exclude": "['/a*']"},
            "/a is among expected_topics and left out by exclude",
        ),
    ],
)
def test_a_wrong_start_is_refused(
    refusal: Callable[..., str], tmp_path: Path, parameters: dict[str, Any], expected: str
) -> None:
    (tmp_path / "there").mkdir()
    (tmp_path / "file").write_text("")
    if "output" in parameters:
        parameters = parameters | {"output": tmp_path / parameters["output"]}
    assert expected in refusal(RecorderNode, **parameters)
    assert not (tmp_path / "new").exists()
    assert list((tmp_path / "there").iterdir()) == []


def test_two_recorders_on_one_folder(start_node: Start, tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    nodes = [start_node(RECORDER, output=bag) for _ in range(2)]
    end = time.monotonic() + 15
    while all(n.process.poll() is None for n in nodes) and time.monotonic() < end:
        time.sleep(0.05)
    loser = next(n for n in nodes if n.process.poll() is not None)
    winner = next(n for n in nodes if n is not loser)
    assert loser.wait() == 2
    assert "exists already" in loser.error
    assert len(loser.error.splitlines()) == 1
    assert winner.end() == 0, winner.error
    assert bag_info(bag).problems == []


@pytest.mark.slow
def test_simulated_time_is_the_time_of_the_bag(
    start_node: Start, graph: Any, make_bag: Callable[..., Path], start_ns: int, tmp_path: Path
) -> None:
    """With use_sim_time log times are those of /clock; before the first one messages wait."""
    from hc_msgs.msg import IndenterSample

    from hc_msgs_py.qos import ESTIMATE_QOS

    bag = tmp_path / "bag"
    early = graph.create_publisher(IndenterSample, "early", ESTIMATE_QOS)
    recorder = start_node(RECORDER, output=bag, use_sim_time=True, expected_topics="[early]")
    wait_until_ready(graph)
    early.publish(IndenterSample(sequence=5))
    time.sleep(0.1)
    player = start_node(
        "hc_logger.player_node",
        bag=make_bag("played", count=500),
        clock_rate=200.0,
        expected_sample_subscribers=1,
        exit_when_done=True,
    )
    assert graph.spin_until(lambda: player.process.poll() is not None)
    assert recorder.end() == 0, recorder.error
    with BagReader(bag) as reader:
        log = {t: [m.log_time for m in reader.messages({t})] for t in reader.topics}
    assert len(log["/early"]) == 1
    assert len(log["/indenter/sample"]) == 500
    for times in (log["/early"], log["/indenter/sample"]):
        assert start_ns <= times[0] <= times[-1] <= start_ns + 500_000_000


@pytest.mark.slow
def test_without_a_clock_simulated_time_records_nothing_and_says_so(
    start_node: Start, graph: Any, tmp_path: Path
) -> None:
    node = start_node(RECORDER, output=tmp_path / "bag", use_sim_time=True)
    wait_until_ready(graph)
    assert node.end() == 0
    assert "nothing recorded: use_sim_time is set and /clock is silent" in node.error
