"""Positions out of /tf in a bag: of the only frame that may be the tool's, or of a named one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import TransformStamped, WrenchStamped
from rclpy.serialization import serialize_message

from hc_bringup.cli import main
from hc_logger.errors import BagError
from hc_logger.recording import read_recording
from hc_logger.sensors import Sensor, read_sensors
from hc_logger.writer import BagWriter
from tf2_msgs.msg import TFMessage

START_NS = 1_700_000_000_000_000_000
TF = "tf2_msgs/msg/TFMessage"


def transform(parent: str, child: str, stamp_ns: int, y: float, z: float) -> TransformStamped:
    message = TransformStamped()
    message.header.frame_id, message.child_frame_id = parent, child
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp_ns, 10**9)
    message.transform.translation.y, message.transform.translation.z = y, z
    message.transform.rotation.w = 1.0
    return message


def arm_bag(path: Path, *further: str, wrench_frame: str = "") -> Path:
    """Force at 1 kHz, F = 3 t (N); a wrist at 100 Hz that goes down by 2 mm/s, and a tool on it."""
    with BagWriter(path) as writer:
        force = writer.add_topic("/ft/wrench", "geometry_msgs/msg/WrenchStamped")
        moving, fixed = writer.add_topic("/tf", TF), writer.add_topic("/tf_static", TF)

        def write(topic: int, message: Any, stamp: int) -> None:
            writer.write(topic, stamp, serialize_message(message))

        for child in ("tool0", *further):
            tool = TFMessage(transforms=[transform("wrist", child, START_NS, 0.0, 0.1)])
            write(fixed, tool, START_NS)
        for k in range(1001):
            stamp = START_NS + k * 1_000_000
            wrench = WrenchStamped()
            wrench.header.frame_id = wrench_frame
            wrench.header.stamp.sec, wrench.header.stamp.nanosec = divmod(stamp, 10**9)
            wrench.wrench.force.z = 3e-3 * k
            write(force, wrench, stamp)
            if k % 10 == 0:
                wrist = transform("base", "wrist", stamp, 0.0, 0.2 - 2e-6 * k)
                write(moving, TFMessage(transforms=[wrist]), stamp)
    return path


def depth_of(recording: Any) -> Any:
    return recording.displacement_mm[np.isfinite(recording.displacement_mm)]


def test_the_only_tool_of_tf_is_read(tmp_path: Path) -> None:
    """Regression: "has 0 position topics (none); name one", which no name answered."""
    bag = arm_bag(tmp_path / "bag")
    recording = read_recording(bag)
    np.testing.assert_allclose(depth_of(recording), 300.0 - 0.02 * np.arange(101), atol=1e-9)
    said = " ".join(recording.findings.lines())
    assert "displacement of /tf (frame tool0 in base along z)" in said
    turned = read_sensors(bag, None, Sensor(sign=-1, zero=-300.0, time_offset_s=0.005))
    np.testing.assert_allclose(depth_of(turned), 0.02 * np.arange(101), atol=1e-9)
    first = np.flatnonzero(np.isfinite(turned.displacement_mm))[0]
    assert turned.stamps[first] == START_NS + 5_000_000


def test_of_several_frames_one_is_asked_for(tmp_path: Path) -> None:
    bag = arm_bag(tmp_path / "bag", "camera", wrench_frame="tool0")
    with pytest.raises(BagError) as raised:
        read_recording(bag)
    said = str(raised.value)
    assert "2 frames of /tf may be the tool's (tool0, camera); name one" in said
    assert "--input position.child_frame=tool0 --input position.base_frame=base" in said
    named = read_sensors(bag, None, Sensor(child_frame="camera", base_frame="base"))
    np.testing.assert_allclose(depth_of(named), 300.0 - 0.02 * np.arange(101), atol=1e-9)
    with pytest.raises(BagError, match="give no sample"):
        read_sensors(bag, None, Sensor(child_frame="cammera"))


def test_hc_doctor_reads_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bag = arm_bag(tmp_path / "bag", "camera")
    frames = ("position.child_frame=tool0", "position.base_frame=base", "position.sign=-1")
    turned = ("position.zero=-300", "force.sign=-1")  # so that there is something to type
    words = [word for name in (*frames, *turned) for word in ("--input", name)]
    main(["doctor", str(bag), *words])
    out = " ".join(capsys.readouterr().out.split())
    assert "displacement of /tf (frame tool0 in base along z)" in out
    assert "hc estimate" in out
    assert "--input force.sign=1" in out
    assert "--input position.base_frame=base" in out  # what it says to type reads the frame, too
