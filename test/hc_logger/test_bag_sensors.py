"""Bags of arms: which topics are the sensors, and what is said where that is open or one lacks."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped, WrenchStamped
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState

from hc_logger.errors import BagError
from hc_logger.recording import read_recording
from hc_logger.sensors import Sensor, read_sensors
from hc_logger.writer import BagWriter

JOINTS = [f"joint{i}" for i in range(1, 8)]
KINDS = {"/joint_states": JointState, "/ft/wrench": WrenchStamped, "/tool/pose": PoseStamped}
START_NS = 1_700_000_000_000_000_000


def arm_bag(path: Path, *topics: str) -> Path:
    """Half a second at 100 Hz: the tool at 100 + k mm, joint i at i + k mm, the force k N."""
    with BagWriter(path) as writer:
        packages = {"/joint_states": "sensor_msgs"}
        numbers = {
            topic: writer.add_topic(
                topic, f"{packages.get(topic, 'geometry_msgs')}/msg/{KINDS[topic].__name__}"
            )
            for topic in topics
        }
        for k in range(50):
            stamp = START_NS + k * 10_000_000
            for topic, number in numbers.items():
                message: Any = KINDS[topic]()
                message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
                if topic == "/joint_states":
                    message.name = JOINTS
                    message.position = [1e-3 * (i + k) for i in range(1, 8)]
                elif topic == "/ft/wrench":
                    message.wrench.force.z = float(k)
                else:
                    message.pose.position.z = 0.1 + 1e-3 * k
                writer.write(number, stamp, serialize_message(message))
    return path


def test_beside_a_pose_the_angles_of_an_arm_are_no_position(tmp_path: Path) -> None:
    """Regression: "several sensors, name them: --input force.topic=..." of one force and a pose."""
    bag = arm_bag(tmp_path / "bag", *KINDS)
    recording = read_recording(bag)
    np.testing.assert_allclose(recording.displacement_mm, 100.0 + np.arange(50), atol=1e-9)
    assert "displacement of /tool/pose" in " ".join(recording.findings.lines())
    named = read_sensors(bag, None, Sensor(topic="/joint_states", joint="joint3"))
    np.testing.assert_allclose(named.displacement_mm, 3.0 + np.arange(50), atol=1e-9)


def test_of_several_joints_one_has_to_be_named(tmp_path: Path) -> None:
    """Regression: the first of seven was read, an angle for metres, and K came out as 5,254."""
    bag = arm_bag(tmp_path / "bag", "/joint_states", "/ft/wrench")
    with pytest.raises(BagError) as raised:
        read_recording(bag)
    said = str(raised.value)
    assert "/joint_states tells 7 joints (joint1, joint2" in said
    assert "record the tool's pose, or /tf" in said
    assert "--input position.joint=joint7" in said
    named = read_sensors(bag, None, Sensor(joint="joint7"))
    np.testing.assert_allclose(named.displacement_mm, 7.0 + np.arange(50), atol=1e-9)


@pytest.mark.parametrize(
    ("topics", "said"),
    [
        (["/joint_states"], "no force is among them (geometry_msgs/msg/WrenchStamped)"),
        (["/ft/wrench"], "no position is among them (PoseStamped, TransformStamped"),
    ],
)
def test_what_lacks_is_named(tmp_path: Path, topics: list[str], said: str) -> None:
    """Regression: "has no topic of type hc_msgs/msg/IndenterSample; it has /joint_states"."""
    with pytest.raises(BagError) as raised:
        read_recording(arm_bag(tmp_path / "bag", *topics))
    assert said in str(raised.value)


@pytest.mark.parametrize(
    ("topics", "said"),
    [
        (
            {"/force": "std_msgs/msg/Float64", "/data": "std_msgs/msg/Float64MultiArray"},
            ("neither a force (geometry_msgs/msg/WrenchStamped) nor a position (PoseStamped, ",),
        ),
        (
            {"/tool/pose": "geometry_msgs/msg/PoseStamped", "/w": "geometry_msgs/msg/Wrench"},
            ("no force is among them", ": /w is geometry_msgs/msg/Wrench; let a node publish it"),
        ),
        (
            {"/ft": "geometry_msgs/msg/WrenchStamped", "/odom": "nav_msgs/msg/Odometry"},
            ("no position is among them", ": /odom is nav_msgs/msg/Odometry; let a node"),
        ),
    ],
)
def test_readings_of_another_type_are_named_and_what_to_do(
    tmp_path: Path, topics: dict[str, str], said: tuple[str, ...]
) -> None:
    """Regression: of plain numbers nothing was said but which topics there are."""
    with BagWriter(tmp_path / "bag") as writer:
        for name, kind in topics.items():
            writer.add_topic(name, kind)
    with pytest.raises(BagError) as raised:
        read_recording(tmp_path / "bag")
    for words in (*said, "or write a CSV file with time, displacement and force"):
        assert words in str(raised.value)
