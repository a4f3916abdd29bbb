"""hc doctor says of a bag, and of a node, that the tool turned while it was recorded."""

import json
from pathlib import Path

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped, WrenchStamped
from rclpy.serialization import serialize_message

from hc_bringup.cli import main
from hc_bringup.turn_watch import bag_turn_deg
from hc_logger.writer import BagWriter

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
