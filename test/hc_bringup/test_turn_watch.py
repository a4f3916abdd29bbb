"""hc doctor says of a bag, and of a node, that the tool turned while it was recorded."""

import argparse
import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped, TransformStamped, WrenchStamped
from hc_msgs.msg import EstimatorConfiguration
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message

from hc_bringup import recording_input
from hc_bringup.cli import main
from hc_bringup.turn_watch import bag_turn_deg
from hc_estimator.ros.node_settings import NODE_SETTINGS
from hc_estimator.ros.sample_flow import SampleFlow
from hc_estimator.stream.vocabulary import ALONG_SENSOR_AXES, CONTACT_FRAME
from hc_logger.reader import BagReader
from hc_logger.writer import BagWriter
from hc_msgs_py.wire import SampleEncoder
from tf2_msgs.msg import TFMessage

START_NS = 1_700_000_000_000_000_000


def robot_bag(path: Path, reading, turn_deg: float, poses: tuple[str, ...] = ("/pose",)) -> Path:
    """A bag of another robot that presses along z, and turns about y meanwhile."""
    generator = np.random.default_rng(5)
    with BagWriter(path) as writer:
        force = writer.add_topic("/wrench", "geometry_msgs/msg/WrenchStamped")
        names = [writer.add_topic(name, "geometry_msgs/msg/PoseStamped") for name in poses]
        for k in range(1500):
            stamp = START_NS + k * 2_000_000
            depth, true_force = reading(k * 2e-3)
            wrench = WrenchStamped()
            wrench.header.stamp.sec, wrench.header.stamp.nanosec = divmod(stamp, 10**9)
            wrench.wrench.force.z = true_force + 0.005 * generator.standard_normal()
            writer.write(force, stamp, serialize_message(wrench))
            at = PoseStamped(header=wrench.header)
            at.pose.position.z = (depth + 0.002 * generator.standard_normal()) * 1e-3
            half = np.radians(turn_deg) / 2.0 * (k / 1500)
            at.pose.orientation.y, at.pose.orientation.w = float(np.sin(half)), float(np.cos(half))
            for name in names:
                writer.write(name, stamp, serialize_message(at))
    return path


def test_the_turn_of_a_bag_is_that_of_its_poses(tmp_path, reading) -> None:
    bag = robot_bag(tmp_path / "one", reading, 40.0)
    assert bag_turn_deg(bag) == bag_turn_deg(bag, "pose") == pytest.approx(20.0, abs=0.5)
    assert bag_turn_deg(bag, "/other") == 0.0
    two = robot_bag(tmp_path / "two", reading, 40.0, ("/a", "/b"))
    assert bag_turn_deg(two) == 0.0  # which is the tool's is not known
    assert bag_turn_deg(two, "/b") == pytest.approx(20.0, abs=0.5)


@pytest.mark.parametrize("turn_deg", [40.0, 0.0])
def test_doctor_says_of_a_bag_that_the_tool_turned(tmp_path, capsys, reading, turn_deg) -> None:
    """Regression: it gave wrong parameters of such a bag, and not a word of the attitude."""
    bag = robot_bag(tmp_path / "bag", reading, turn_deg)
    status = main(["doctor", str(bag), "--json"])
    said = [f["what"] for f in json.loads(capsys.readouterr().out)["findings"]]
    told = [line for line in said if line.startswith("the tool turned by up to 20 degrees")]
    assert len(told) == (turn_deg > 0.0), said
    assert status == 1 or not told


@pytest.mark.parametrize("turn_deg", [40.0, 0.0])
def test_what_reads_a_bag_says_that_the_tool_turned(tmp_path, reading, turn_deg) -> None:
    """Regression: a report began with a hard spot, of a tool that had turned."""
    parser = argparse.ArgumentParser()
    recording_input.add_options(parser)
    bag = robot_bag(tmp_path / "bag", reading, turn_deg)
    said = recording_input.load(parser.parse_args([str(bag)])).findings.lines()
    told = [line for line in said if line.startswith("the tool turned by up to 20 degrees")]
    assert len(told) == (turn_deg > 0.0), said


def frames_bag(path: Path, turn_deg: float, names: tuple[str, ...], *, tf: bool) -> Path:
    """A bag that tells the tool's place in TransformStamped, or in frames of tf alone."""
    kind = "tf2_msgs/msg/TFMessage" if tf else "geometry_msgs/msg/TransformStamped"
    with BagWriter(path) as writer:
        force = writer.add_topic("/wrench", "geometry_msgs/msg/WrenchStamped")
        topic = writer.add_topic("/tf" if tf else "/tracker", kind)
        for k in range(600):
            stamp = START_NS + k * 5_000_000
            wrench = WrenchStamped()
            wrench.header.stamp.sec, wrench.header.stamp.nanosec = divmod(stamp, 10**9)
            wrench.header.frame_id = "ft"
            writer.write(force, stamp, serialize_message(wrench))
            for name in names:
                at = TransformStamped(header=wrench.header, child_frame_id=name)
                at.header.frame_id = "base"
                half = np.radians(turn_deg) / 2.0 * (k / 600) * (name == names[0])
                turned = at.transform.rotation
                turned.y, turned.w = float(np.sin(half)), float(np.cos(half))
                at.transform.translation.z = 1e-6 * k
                message = TFMessage(transforms=[at]) if tf else at
                writer.write(topic, stamp, serialize_message(message))
    return path


@pytest.mark.parametrize("tf", [True, False])
def test_the_turn_of_a_bag_is_that_of_its_transforms_and_frames(tmp_path, tf) -> None:
    """Regression: a bag of /tf or TransformStamped was not looked into."""
    one = frames_bag(tmp_path / "one", 40.0, ("tool0",), tf=tf)
    assert bag_turn_deg(one) == pytest.approx(20.0, abs=0.5)
    still = frames_bag(tmp_path / "still", 0.0, ("tool0",), tf=tf)
    assert bag_turn_deg(still) < 1.0
    two = frames_bag(tmp_path / "two", 40.0, ("tool0", "camera"), tf=tf)
    assert bag_turn_deg(two) == 0.0  # which is the tool's is not known
    sensor = frames_bag(tmp_path / "sensor", 40.0, ("ft",), tf=tf)
    assert bag_turn_deg(sensor) == pytest.approx(20.0, abs=0.5)


def test_of_several_transforms_the_tool_can_be_named(tmp_path) -> None:
    two = frames_bag(tmp_path / "two", 40.0, ("tool0", "camera"), tf=False)
    assert bag_turn_deg(two, "tracker", "tool0") == pytest.approx(20.0, abs=0.5)
    assert bag_turn_deg(two, "tracker", "camera") < 1.0


def add_samples(robot: Path, target: Path, settings: dict[str, str]) -> Path:
    """Copy a robot's bag with the samples that a node made of it, and the node's configuration."""
    with BagReader(robot) as bag, BagWriter(target) as writer:
        numbers = {n: writer.add_topic(n, t.definition.name) for n, t in bag.topics.items()}
        told = writer.add_topic("hc/configuration", "hc_msgs/msg/EstimatorConfiguration")
        made = writer.add_topic("indenter/sample", "hc_msgs/msg/IndenterSample")
        configuration = EstimatorConfiguration(revision=1, filter="ukf")
        configuration.parameters = [
            Parameter(name, value=value).to_parameter_msg() for name, value in settings.items()
        ]
        writer.write(told, START_NS, serialize_message(configuration))
        for message in bag.messages():
            writer.write(numbers[message.topic], message.log_time, message.data)
        for k in range(1500):
            stamp, depth = START_NS + k * 2_000_000, 2.0 - 2.0 * np.cos(0.02 * k)
            data = SampleEncoder().encode(stamp, k, float(depth), float(0.3 * depth**1.4))
            writer.write(made, stamp, data)
    return target


@pytest.mark.parametrize(
    ("turn_deg", "settings", "is_told"),
    [
        (40.0, {CONTACT_FRAME: ALONG_SENSOR_AXES}, True),
        (0.0, {CONTACT_FRAME: ALONG_SENSOR_AXES}, False),
        (40.0, {CONTACT_FRAME: "surface"}, False),
        (40.0, {}, False),  # of a node that reads samples, or a joint
    ],
)
def test_of_samples_that_a_node_made_along_axes_the_turn_is_told(
    tmp_path, reading, turn_deg, settings, is_told
) -> None:
    """Regression: of the bag of a run with a tool that turned nothing said why K was wrong."""
    parser = argparse.ArgumentParser()
    recording_input.add_options(parser)
    robot = robot_bag(tmp_path / "robot", reading, turn_deg)
    bag = add_samples(robot, tmp_path / "bag", settings)
    recording = recording_input.load(parser.parse_args([str(bag)]))
    assert len(recording.time_s) == 1500
    told = [f for f in recording.findings.lines() if f.startswith("the tool turned by up to 20 d")]
    assert len(told) == is_told


@pytest.mark.parametrize(
    ("source", "kind", "frame", "recorded"),
    [
        ("sensors", "pose", "sensor", "sensor"),
        ("sensors", "tf", "surface", "surface"),
        ("sensors", "joint", "sensor", None),
        ("sample", "pose", "sensor", None),
    ],
)
def test_a_configuration_says_along_what_its_samples_are_read(source, kind, frame, recorded):
    published = []
    flow = SampleFlow()
    defaults = {name: setting.default for name, setting in NODE_SETTINGS.items()}
    given = {"input.source": source, "input.position.type": kind, CONTACT_FRAME: frame}
    flow._settings = SimpleNamespace(values=defaults | given)
    flow._session = SimpleNamespace(estimator=None, loaded=None)
    flow._outputs = SimpleNamespace(publish_configuration=lambda *words: published.append(words))
    flow._keeper = SimpleNamespace(hasten=lambda: None)
    flow.on_revision(SimpleNamespace(number=1, cause=None))
    ((_revision, _estimator, beside, _loaded),) = published
    assert beside.get(CONTACT_FRAME) == recorded
