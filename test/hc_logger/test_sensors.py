"""Recordings from a wrench and a position topic, as other robots publish them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hc_logger.convert import bag_to_csv
from hc_logger.errors import BagError
from hc_logger.recording import read_recording
from hc_logger.sensors import Sensor, read_sensors
from hc_logger.writer import BagWriter

START_NS = 1_700_000_000_000_000_000


def robot_bag(path: Path, position: str) -> None:
    """Force at 1 kHz along -x, position at 100 Hz falling along y: d = 2 t, F = 3 t (mm, N)."""
    from geometry_msgs.msg import PoseStamped, TransformStamped, WrenchStamped
    from rclpy.serialization import serialize_message
    from sensor_msgs.msg import JointState

    kinds = {"joint": JointState, "pose": PoseStamped, "transform": TransformStamped}
    types = {
        "joint": "sensor_msgs/msg/JointState",
        "pose": "geometry_msgs/msg/PoseStamped",
        "transform": "geometry_msgs/msg/TransformStamped",
    }
    with BagWriter(path) as writer:
        force = writer.add_topic("/ft/wrench", "geometry_msgs/msg/WrenchStamped")
        other = writer.add_topic("/robot/position", types[position])

        def write(topic: int, message: Any, milliseconds: int) -> None:
            stamp = START_NS + milliseconds * 1_000_000
            message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
            writer.write(topic, stamp, serialize_message(message))

        for k in range(1001):
            t = k * 1e-3
            wrench = WrenchStamped()
            wrench.wrench.force.x = -3.0 * t - 0.5
            write(force, wrench, k)
            if k % 10 == 0:
                message = kinds[position]()
                y = 0.010 - 2e-3 * t
                if position == "joint":
                    message.name, message.position = ["other", "z"], [7.0, y]
                elif position == "pose":
                    message.pose.position.y = y
                else:
                    message.child_frame_id = "tool"
                    message.transform.translation.y = y
                write(other, message, k)


@pytest.mark.parametrize("position", ["joint", "pose", "transform"])
def test_two_sensors_make_one_recording(tmp_path: Path, position: str) -> None:
    robot_bag(tmp_path / "bag", position)
    recording = read_sensors(
        tmp_path / "bag",
        Sensor(axis="x", sign=-1, zero=0.5),
        Sensor(axis="y", sign=-1, zero=-10.0, joint="z", child_frame="tool"),
    )
    t = np.arange(1001) * 1e-3
    np.testing.assert_allclose(recording.time_s, t, atol=1e-9)
    whole = np.arange(1001) % 10 == 0  # the stamps that both sensors have
    np.testing.assert_allclose(recording.displacement_mm[whole], 2.0 * t[whole], atol=1e-9)
    assert np.isnan(recording.displacement_mm[~whole]).all()
    np.testing.assert_allclose(recording.force_n, 3.0 * t, atol=1e-12)
    along = "" if position == "joint" else " along y"
    assert recording.findings.lines() == [
        "900 rows with a force alone: each reading is used at its own stamp",
        f"force along x of /ft/wrench, displacement of /robot/position{along}: mind their signs "
        "and zeros",
    ]


def test_a_bag_with_one_wrench_and_one_position_needs_no_names(tmp_path: Path) -> None:
    robot_bag(tmp_path / "bag", "pose")
    recording = read_recording(tmp_path / "bag")
    assert len(recording.time_s) == 1001
    np.testing.assert_array_equal(recording.displacement_mm[::10], 0.0)  # along z, as it is
    np.testing.assert_array_equal(recording.force_n, 0.0)
    assert "displacement of /robot/position" in recording.findings.notes[0]
    count, lines = bag_to_csv(tmp_path / "bag", tmp_path / "bag.csv")
    assert (count, lines) == (1001, recording.findings.lines())
    np.testing.assert_array_equal(
        read_recording(tmp_path / "bag.csv").displacement_mm, recording.displacement_mm
    )


def test_a_time_offset_moves_the_force_against_the_position(tmp_path: Path) -> None:
    robot_bag(tmp_path / "bag", "pose")
    recording = read_sensors(
        tmp_path / "bag",
        Sensor("ft/wrench", axis="direction", direction=(-2.0, 0.0, 0.0), time_offset_s=-0.03),
        Sensor(axis="y", sign=-1, zero=-10.0),
    )
    t = recording.time_s  # from the first position on
    depth, force = recording.displacement_mm, recording.force_n
    has_depth, has_force = np.isfinite(depth), np.isfinite(force)
    np.testing.assert_allclose(depth[has_depth], 2.0 * t[has_depth], atol=1e-9)
    np.testing.assert_allclose(force[has_force], 3.0 * (t[has_force] + 0.03) + 0.5, atol=1e-12)
    assert (np.count_nonzero(has_depth), np.count_nonzero(has_force)) == (101, 971)
    assert recording.findings.problems == ()
    told = "30 readings left out before the other sensor began or after it ended"
    assert recording.findings.notes[1] == told


@pytest.mark.parametrize(("first", "told"), [(3, []), (400, ["400 readings left out befo"])])
def test_a_sensor_that_begins_before_the_other_is_no_problem(
    tmp_path: Path, first: int, told: list[str]
) -> None:
    """One of two always begins first; only a long time alone is worth a note."""
    from geometry_msgs.msg import PoseStamped, WrenchStamped
    from rclpy.serialization import serialize_message

    with BagWriter(tmp_path / "bag") as writer:
        force = writer.add_topic("/wrench", "geometry_msgs/msg/WrenchStamped")
        pose = writer.add_topic("/pose", "geometry_msgs/msg/PoseStamped")
        for k in range(1000):
            stamp = 10**12 + k * 10**6
            wrench, position = WrenchStamped(), PoseStamped()
            for message in (wrench, position):
                message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
            writer.write(force, stamp, serialize_message(wrench))
            if k >= first:
                writer.write(pose, stamp, serialize_message(position))
    recording = read_recording(tmp_path / "bag")
    assert recording.findings.problems == ()
    assert [line[:26] for line in recording.findings.notes[1:]] == told


def test_what_is_missing_is_one_line(tmp_path: Path, make_bag: Any) -> None:
    robot_bag(tmp_path / "robot", "pose")
    with pytest.raises(BagError, match="no force topic /nothing of type geometry_msgs"):
        read_sensors(tmp_path / "robot", Sensor("nothing"))
    with pytest.raises(BagError, match="0 force topics"):
        read_sensors(make_bag(count=10))
    with pytest.raises(BagError, match="give no sample"):
        read_sensors(tmp_path / "robot", force=Sensor(time_offset_s=5.0))
    with pytest.raises(ValueError, match=r"force.time_offset = 1e\+300 s is not a number up to"):
        read_sensors(tmp_path / "robot", Sensor(time_offset_s=1e300))
    with pytest.raises(ValueError, match="axis = 'w'"):
        read_sensors(tmp_path / "robot", Sensor(axis="w"))


def test_a_reading_that_is_repeated_counts_once(tmp_path: Path) -> None:
    robot_bag(tmp_path / "bag", "joint")  # its first joint stays, its force as well along z
    held = Sensor(held=True, joint="other")
    recording = read_sensors(tmp_path / "bag", Sensor(axis="x", held=True), held)
    assert not np.isnan(recording.force_n).any()
    places = np.flatnonzero(~np.isnan(recording.displacement_mm))
    assert places.tolist() == list(range(0, 1000, 90))  # it rests: once in 90 ms
    every = read_sensors(tmp_path / "bag", Sensor(axis="x"), Sensor(joint="other"))
    assert np.count_nonzero(~np.isnan(every.displacement_mm)) == 101


def test_forces_that_are_stamped_on_arrival_get_the_times_of_measurement(tmp_path: Path) -> None:
    from geometry_msgs.msg import PoseStamped, WrenchStamped
    from rclpy.serialization import serialize_message

    with BagWriter(tmp_path / "bag") as writer:
        force = writer.add_topic("/ft/wrench", "geometry_msgs/msg/WrenchStamped")
        pose = writer.add_topic("/pose", "geometry_msgs/msg/PoseStamped")
        for k in range(4000):
            measured_ns = START_NS + k * 1_000_000
            came_ns = START_NS + (k // 16 * 16 + 15) * 1_000_000 + k % 16 * 10_000
            wrench = WrenchStamped()
            wrench.wrench.force.z = 1e-3 * k
            stamp = wrench.header.stamp
            stamp.sec, stamp.nanosec = divmod(came_ns, 10**9)
            writer.write(force, came_ns, serialize_message(wrench))
            if k % 8 == 0:
                place = PoseStamped()
                place.pose.position.z = 1e-6 * k
                place.header.stamp.sec, place.header.stamp.nanosec = divmod(measured_ns, 10**9)
                writer.write(pose, measured_ns, serialize_message(place))
    offset = Sensor(stamps="arrival", time_offset_s=-0.01)
    for sensor, shifted_s in ((Sensor(stamps="arrival"), 0.0), (offset, 0.01)):
        read = read_sensors(tmp_path / "bag", sensor)
        there = ~np.isnan(read.force_n)
        assert np.count_nonzero(there) > 3900
        late = (read.stamps[there] - START_NS) * 1e-9 - read.force_n[there] + shifted_s
        assert np.max(np.abs(late - 0.00015)) < 2e-6  # what the last one of a packet took
        places = ~np.isnan(read.displacement_mm)
        assert np.array_equal(
            read.stamps[places] - START_NS, np.round(read.displacement_mm[places] * 1e9)
        )
    as_stamped = read_sensors(tmp_path / "bag")
    there = ~np.isnan(as_stamped.force_n)
    late = (as_stamped.stamps[there] - START_NS) * 1e-9 - as_stamped.force_n[there]
    assert np.max(late) > 0.014
    with pytest.raises(ValueError, match=r"force\.stamps=received is not measured or arrival"):
        read_sensors(tmp_path / "bag", Sensor(stamps="received"))


def test_readings_that_are_no_numbers_are_called_that(tmp_path: Path) -> None:
    """Regression: every third force a NaN was "comes at 666.7 Hz on average: lost or late"."""
    from geometry_msgs.msg import PoseStamped, WrenchStamped
    from rclpy.serialization import serialize_message

    with BagWriter(tmp_path / "bag") as writer:
        forces = writer.add_topic("/ft", "geometry_msgs/msg/WrenchStamped")
        poses = writer.add_topic("/pose", "geometry_msgs/msg/PoseStamped")
        for k in range(300):
            stamp = START_NS + k * 1_000_000
            for topic, message in ((forces, WrenchStamped()), (poses, PoseStamped())):
                message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
                if topic == forces:
                    message.wrench.force.z = float("nan") if k % 3 == 0 else 1.0
                writer.write(topic, stamp, serialize_message(message))
    problems = read_sensors(tmp_path / "bag").findings.problems
    said = "100 of 300 readings of /ft are no numbers (NaN): the sensor or its driver gave none"
    assert said in problems
    assert not [problem for problem in problems if "/pose" in problem]
