"""A force across the press that shows along it is said, and the direction takes it off."""

import argparse
import re
from pathlib import Path

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped, WrenchStamped
from rclpy.serialization import serialize_message

from hc_bringup import recording_input
from hc_logger.cross_talk import find_cross_talk
from hc_logger.writer import BagWriter

START_NS = 1_700_000_000_000_000_000
READ = np.array([0.0, 0.0, 1.0])


def presses(share, across="cable", relaxing=0.0, duration_s=20.0):
    """Return stamps [s], depths [mm] and forces [N], shape (n, 3), read along z."""
    random = np.random.default_rng(6)
    times = np.arange(0.0, duration_s, 2e-3)
    depth = 2.0 - 2.5 * np.cos(2.0 * np.pi * 0.4 * times)
    touching = np.maximum(depth, 0.0) ** 1.5
    press = np.maximum(touching * (0.6 + 0.012 * np.gradient(depth, times)), 0.0)
    memory = 0.0
    for row in np.arange(len(times)):
        memory += 2e-3 / 1.5 * (press[row] - memory)
        press[row] = max(press[row] - relaxing * memory, 0.0)
    sideways = {
        "cable": 2.0 * np.sin(2.0 * np.pi * 0.17 * times),
        "slide": 0.4 * press * np.sign(np.sin(2.0 * np.pi * 0.21 * times)),
        "tilt": 0.3 * press,
    }[across]
    forces = np.column_stack([0.8 * sideways, 0.6 * sideways, press + share * sideways])
    noise = 0.01 * random.standard_normal(forces.shape)
    return times, depth + 0.002 * random.standard_normal(len(times)), forces + noise


@pytest.mark.parametrize("across", ["cable", "slide"])
@pytest.mark.parametrize("share", [0.02, 0.05, -0.05])
def test_cross_talk_is_found(share: float, across: str) -> None:
    found = find_cross_talk(*presses(share, across), READ)
    assert found is not None
    assert found.share == pytest.approx(abs(share), abs=0.005)
    assert found.direction == pytest.approx([-0.8 * share, -0.6 * share, 1.0], abs=0.01)


@pytest.mark.parametrize("across", ["cable", "slide", "tilt"])
@pytest.mark.parametrize("relaxing", [0.0, 0.4])
def test_none_is_found_where_there_is_none(across: str, relaxing: float) -> None:
    assert find_cross_talk(*presses(0.0, across, relaxing), READ) is None


def test_what_is_too_short_or_still_shows_none() -> None:
    times, depth, forces = presses(0.05)
    assert find_cross_talk(times[:100], depth[:100], forces[:100], READ) is None
    assert find_cross_talk(times, np.zeros(len(times)), forces, READ) is None
    assert find_cross_talk(times, np.full(len(times), np.nan), forces, READ) is None


def problems(path, *settings):
    parser = argparse.ArgumentParser()
    recording_input.add_options(parser)
    words = [word for setting in settings for word in ("--input", setting)]
    return recording_input.load(parser.parse_args([str(path), *words])).findings.problems


def test_a_bag_says_it_and_how_to_read_it(tmp_path: Path) -> None:
    """Regression: K was 0.79 of 0.6 N/mm, for "relaxing or layered tissue"."""
    path = tmp_path / "robot"
    with BagWriter(path) as writer:
        force = writer.add_topic("/ft/wrench", "geometry_msgs/msg/WrenchStamped")
        pose = writer.add_topic("/arm/pose", "geometry_msgs/msg/PoseStamped")
        for time_s, depth, vector in zip(*presses(0.05), strict=True):
            stamp = START_NS + round(time_s * 1e9)
            wrench = WrenchStamped()
            wrench.header.stamp.sec, wrench.header.stamp.nanosec = divmod(stamp, 10**9)
            wrench.wrench.force.x, wrench.wrench.force.y, wrench.wrench.force.z = vector.tolist()
            writer.write(force, stamp, serialize_message(wrench))
            position = PoseStamped(header=wrench.header)
            position.pose.position.z = depth * 1e-3
            writer.write(pose, stamp, serialize_message(position))
    (said,) = problems(path)
    assert said.startswith("5.0 % of the force across the press shows along it, up to 0.1 N in /ft")
    direction = re.search(r"--input force.direction=(\S+)", said)
    assert direction is not None
    assert not problems(path, "force.axis=direction", f"force.direction={direction[1]}")
