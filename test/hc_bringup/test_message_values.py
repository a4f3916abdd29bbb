"""Values from the command line into messages, and what does not fit."""

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped, PoseWithCovariance
from hc_msgs.msg import EstimatorEvent
from rcl_interfaces.srv import SetParameters
from sensor_msgs.msg import Image, JointState

from hc_bringup.errors import UserError
from hc_bringup.message_text import plain
from hc_bringup.message_values import fill


def test_nested_fields_lists_and_messages_in_lists() -> None:
    pose = PoseStamped()
    fill(
        pose, {"header": {"frame_id": "base", "stamp": {"sec": 3}}, "pose": {"position": {"z": 1}}}
    )
    assert (pose.header.frame_id, pose.header.stamp.sec, pose.pose.position.z) == ("base", 3, 1.0)
    assert pose.pose.orientation.w == 1.0  # as the message has it
    joints = JointState()
    fill(joints, {"name": ["a", "b"], "position": [1, 2.5]})
    assert (joints.name, list(joints.position)) == (["a", "b"], [1.0, 2.5])
    covariance = PoseWithCovariance()
    fill(covariance, {"covariance": list(range(36))})
    np.testing.assert_array_equal(covariance.covariance, np.arange(36.0))
    request = SetParameters.Request()
    fill(request, {"parameters": [{"name": "x", "value": {"type": 2, "integer_value": -4}}]})
    assert plain(request)["parameters"][0]["value"]["integer_value"] == -4


@pytest.mark.parametrize(
    ("message", "values", "line"),
    [
        (PoseStamped, {"pose": {"place": {}}}, "no field pose.place; fields there: position, orie"),
        (PoseStamped, {"pose:3": None}, r"no field pose:3 \(a space is missing: pose: 3\); fields"),
        (PoseStamped, {"poses:3": None}, "no field poses:3; fields"),
        (PoseStamped, {"pose": 3}, "pose: 3 is no geometry_msgs/Pose"),
        (PoseStamped, {"header": {"stamp": {"sec": "now"}}}, "header.stamp.sec: 'now' is no int32"),
        (PoseStamped, {"header": {"stamp": {"nanosec": -1}}}, "nanosec: -1 is no uint32"),
        (PoseStamped, {"header": {"frame_id": 3}}, "header.frame_id: 3 is no string"),
        (JointState, {"position": 1.0}, "position: 1.0 is no sequence<double>"),
        (JointState, {"position": [True]}, r"position: \[True\] is no sequence<double>"),
        (EstimatorEvent, {"kind": 256}, "kind: 256 is no uint8"),
        (EstimatorEvent, {"kind": True}, "kind: True is no uint8"),
        (EstimatorEvent, {"reason": "x" * 300}, "is no string<=255|is no string<255>"),
        (PoseWithCovariance, {"covariance": [1.0]}, r"is no double\[36\]"),
        (Image, {"is_bigendian": "yes"}, "is_bigendian: 'yes' is no uint8"),
    ],
)
def test_what_does_not_fit_is_named_with_its_type(message, values, line) -> None:
    with pytest.raises(UserError, match=line):
        fill(message(), values)
