"""Samples that are made ahead: the messages are those made of each sample at its time."""

from __future__ import annotations

import numpy as np
import pytest
from geometry_msgs.msg import PointStamped, WrenchStamped
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState

from hc_msgs_py.topics import JOINT_STATES, SAMPLE, TRUTH, WRENCH
from hc_msgs_py.units import METRE_IN_MM
from hc_msgs_py.wire import SampleEncoder, TruthEncoder
from hc_sim_rig import Rig
from hc_sim_rig.ros.ahead import MOST_AHEAD, TIP_EVERY, RowsEncoder, messages_ahead


@pytest.mark.parametrize("scenario", ["multisine", "teleoperation", "palpation_scan"])
def test_messages_of_several_samples_are_those_of_each(scenario: str) -> None:
    encoder = RowsEncoder()
    ahead, one = Rig(scenario, 3), Rig(scenario, 3)
    topics = (SAMPLE, TRUTH, WRENCH, JOINT_STATES)
    for count in (5, 5, 2, 8, 1, 4):
        stamps = 1_700_000_000_999_000_001 + 1_000_000 * np.arange(count)
        first, rows = ahead.sequence, ahead.rows(count)
        made = encoder.encode(stamps, 40 + first, rows, topics)
        assert list(made) == list(topics)
        tips = dict(encoder.tips(stamps, first, rows))
        assert list(tips) == [i for i in range(count) if (first + i) % TIP_EVERY == 0]
        each = zip(*made.values(), strict=True)
        for i, (sample, truth, wrench, joints) in enumerate(each):
            stamp = int(stamps[i])
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
            if i in tips:
                message = deserialize_message(tips[i], PointStamped)
                assert message.header.frame_id == "stage"
                assert message.point.x == expected.lateral_mm / METRE_IN_MM
                assert message.point.z == -expected.slave.position_mm / METRE_IN_MM
                assert message.header.stamp.sec * 10**9 + message.header.stamp.nanosec == stamp


@pytest.mark.parametrize("topics", [(), (TRUTH,), (SAMPLE, JOINT_STATES), (WRENCH,)])
def test_what_is_not_wanted_is_not_made(topics: tuple[str, ...]) -> None:
    encoder, rig = RowsEncoder(), Rig("multisine", 3)
    stamps, rows = np.arange(3) * 10**6, rig.rows(3)
    every = encoder.encode(stamps, 0, rows, (SAMPLE, TRUTH, WRENCH, JOINT_STATES))
    made = encoder.encode(stamps, 0, rows, topics)
    assert made == {topic: every[topic] for topic in topics}


def test_slow_rigs_do_not_look_ahead_and_fast_ones_not_far() -> None:
    assert messages_ahead(1.0) == messages_ahead(100.0) == 1
    assert messages_ahead(1000.0) == 5
    assert messages_ahead(7000.0) == MOST_AHEAD
