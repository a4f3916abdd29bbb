"""Two sensors of a bag whose stamps cannot be put together: why, and what to type."""

from pathlib import Path

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped, WrenchStamped
from rclpy.serialization import serialize_message

from hc_logger.errors import BagError
from hc_logger.recording import read_recording
from hc_logger.sensors import Sensor, read_sensors
from hc_logger.writer import BagWriter


def robot_bag(path: Path, force_ahead_s: float, *, stamped: bool = True) -> Path:
    """Four seconds at 250 Hz; the force's clock is ahead, or the driver stamps nothing."""
    with BagWriter(path) as writer:
        force = writer.add_topic("/ft/wrench", "geometry_msgs/msg/WrenchStamped")
        pose = writer.add_topic("/tool/pose", "geometry_msgs/msg/PoseStamped")
        for k in range(1000):
            now_ns = 1_700_000_000 * 10**9 + k * 4_000_000
            wrench, position = WrenchStamped(), PoseStamped()
            wrench.wrench.force.z = 1.0 + 0.001 * k
            position.pose.position.z = 1e-6 * k
            for message, stamp in (
                (wrench, now_ns + round(force_ahead_s * 1e9)),
                (position, now_ns),
            ):
                if stamped or message is position:
                    header = message.header.stamp
                    header.sec, header.nanosec = divmod(stamp, 10**9)
            writer.write(force, now_ns + 1_000_000, serialize_message(wrench))
            writer.write(pose, now_ns + 1_500_000, serialize_message(position))
    return path


@pytest.mark.parametrize(("ahead_s", "way"), [(-37.0, "behind"), (3.0, "ahead of"), (0.5, "ahead")])
def test_two_clocks_are_told_with_what_puts_them_together(
    tmp_path: Path, ahead_s: float, way: str
) -> None:
    """Regression: "give no sample: " and nothing, or "readings of a sensor that was alone"."""
    bag = robot_bag(tmp_path / "bag", ahead_s)
    for already_s in (0.0, 1.25):
        with pytest.raises(BagError) as raised:
            read_sensors(bag, Sensor(time_offset_s=already_s))
        said = str(raised.value)
        assert "two clocks; set one by the other (PTP, chrony)" in said
        assert f" s {'ahead' if ahead_s + already_s > 0.0 else 'behind'}" in said
        offset_s = float(said.partition("--input force.time_offset=")[2].partition(",")[0])
        assert offset_s == pytest.approx(-ahead_s, abs=0.002)
    with pytest.raises(BagError, match=f" s {way}"):
        read_recording(bag)
    together = read_sensors(bag, Sensor(time_offset_s=offset_s))
    for readings in (together.force_n, together.displacement_mm):
        assert np.isfinite(readings).sum() > 950
    assert together.findings.problems == ()


def test_a_driver_that_stamps_nothing_is_told(tmp_path: Path) -> None:
    """Regression: "999 readings that came too late", and K of one sample for a result."""
    with pytest.raises(BagError, match=r"all 1000 readings of /ft/wrench have one stamp, 0 s"):
        read_recording(robot_bag(tmp_path / "bag", 0.0, stamped=False))


def test_one_clock_is_none_of_it(tmp_path: Path) -> None:
    assert read_recording(robot_bag(tmp_path / "bag", 0.0)).findings.problems == ()
