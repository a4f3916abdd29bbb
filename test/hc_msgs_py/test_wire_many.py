"""Several messages made at once are those that rclpy makes of each."""

from __future__ import annotations

import numpy as np
from geometry_msgs.msg import WrenchStamped
from hc_msgs.msg import IndenterSample
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState

from hc_msgs_py.wire import SampleEncoder
from hc_msgs_py.wire_many import PatternMessages, StampedMessages

STAMPS = np.array([1_700_000_000_999_999_999, 1_700_000_001_000_000_000, 5], np.int64)


def test_samples_have_the_bytes_of_each() -> None:
    many, one = StampedMessages(IndenterSample, "tip"), SampleEncoder("tip")
    for count in (3, 1, 2):
        depth, force = np.array([1.1, -2.0, np.nan])[:count], np.array([0.3, 0.0, 4.0])[:count]
        table = many.table(count)
        table["sec"], table["nanosec"] = np.divmod(STAMPS[:count], 10**9)
        table["sequence"], table["displacement"] = 7 + np.arange(count), depth / 1e3
        table["force"] = force
        assert many.messages(0) == []
        for i, data in enumerate(many.messages(count)):
            assert data == one.encode(int(STAMPS[i]), 7 + i, depth[i], force[i])


def test_a_pattern_has_its_numbers_in_their_places() -> None:
    def fill(numbers):
        message = JointState(name=["a", "bc"])
        message.header.frame_id = "frame"
        message.position, message.effort = list(numbers[:2]), list(numbers[2:])
        return message

    pattern = PatternMessages(4, fill)
    for count in (2, 3, 1):
        columns = [np.arange(count) + 10.0 * k for k in range(4)]
        table = pattern.table(count)
        table["sec"], table["nanosec"] = np.divmod(STAMPS[:count], 10**9)
        for place, column in enumerate(columns):
            table[str(place)] = column
        for i, data in enumerate(pattern.messages(count)):
            message = deserialize_message(data, JointState)
            expected = fill([column[i] for column in columns])
            sec, nanosec = divmod(int(STAMPS[i]), 10**9)
            expected.header.stamp.sec, expected.header.stamp.nanosec = sec, nanosec
            assert message == expected


def test_a_pattern_of_one_number() -> None:
    def fill(numbers):
        message = WrenchStamped()
        message.wrench.force.z = numbers[0]
        return message

    pattern = PatternMessages(1, fill)
    pattern.table(1)["0"] = -0.0
    (data,) = pattern.messages(1)
    message = deserialize_message(data, WrenchStamped)
    assert str(message.wrench.force.z) == "-0.0"
    assert message.wrench.force.x == message.wrench.torque.z == 0.0
