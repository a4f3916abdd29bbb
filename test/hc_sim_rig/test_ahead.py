"""Samples that are made ahead: the messages are those made of each sample at its time."""

from __future__ import annotations

import numpy as np
import pytest
from geometry_msgs.msg import WrenchStamped
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState

from hc_msgs_py.units import METRE_IN_MM
from hc_msgs_py.wire import SampleEncoder, TruthEncoder
from hc_sim_rig import Rig
from hc_sim_rig.ros.ahead import MOST_AHEAD, SeriesEncoder, messages_ahead


@pytest.mark.parametrize("scenario", ["multisine", "teleoperation"])
def test_messages_of_several_samples_are_those_of_each(scenario: str) -> None:
    encoder = SeriesEncoder(("master", "slave"))
    ahead, one = Rig(scenario, 3), Rig(scenario, 3)
    for count in (5, 5, 2, 8, 1):
        stamps = 1_700_000_000_999_000_001 + 1_000_000 * np.arange(count)
        series = ahead.run(count / ahead.rate_hz)
        made = zip(
            encoder.samples(stamps, 40, series),
            encoder.truths(stamps, 40, series),
            encoder.wrenches(stamps, series),
            encoder.joints(stamps, series),
            strict=True,
        )
        for stamp, (sample, truth, wrench, joints) in zip(stamps.tolist(), made, strict=True):
            expected = one.step()
            number = 40 + expected.sequence
            reading = (expected.displacement_mm, expected.force_n)
            assert sample == SampleEncoder().encode(stamp, number, *reading)
            assert truth == TruthEncoder().encode(stamp, number, *expected.truth)
            message = deserialize_message(wrench, WrenchStamped)
            assert message.wrench.force.z == expected.force_n
            assert message.header.frame_id == "indenter_tip"
            message = deserialize_message(joints, JointState)
            assert message.name == ["master", "slave"]
            both = (expected.master, expected.slave)
            assert message.position.tolist() == [j.position_mm / METRE_IN_MM for j in both]
            assert message.velocity.tolist() == [j.velocity_mm_s / METRE_IN_MM for j in both]
            assert message.effort.tolist() == [j.effort_n for j in both]
            assert message.header.stamp.sec * 10**9 + message.header.stamp.nanosec == stamp


def test_slow_rigs_do_not_look_ahead_and_fast_ones_not_far() -> None:
    assert messages_ahead(1.0) == messages_ahead(100.0) == 1
    assert messages_ahead(1000.0) == 5
    assert messages_ahead(7000.0) == MOST_AHEAD
