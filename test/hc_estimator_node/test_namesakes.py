"""Two nodes of one name publish estimates on one topic: that is said, once it is no ghost."""

import rclpy
from rclpy.node import Node

from hc_estimator.ros.namesakes import LEASE_S, Namesakes
from hc_msgs_py.diagnostics import Level, Status


def test_a_name_that_stays_there_twice_is_said(ros_domain, monkeypatch):
    """Regression: 1702 estimates of 1040 samples, and both nodes were "estimating"."""
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    rclpy.init(args=[], domain_id=ros_domain)
    try:
        node = Node("estimator")
        namesakes = Namesakes(node)
        fine = Status(Level.OK, "estimating", {})
        assert namesakes.added_to(fine) == fine
        assert namesakes.judge(2, 100.0) == ""  # a process that died is listed for a while
        assert namesakes.judge(1, 101.0) == ""
        assert namesakes.judge(2, 102.0) == ""
        assert namesakes.judge(2, 102.0 + LEASE_S - 0.1) == ""
        assert namesakes.judge(2, 102.0 + LEASE_S).startswith("2 nodes are called /estimator, and")
        other, elsewhere = Node("estimator"), Node("estimator", namespace="left")
        monkeypatch.setattr("hc_estimator.ros.namesakes.LEASE_S", 0.0)
        for _ in range(100):
            status = namesakes.added_to(fine)
            if status != fine:
                break
            rclpy.spin_once(node, timeout_sec=0.05)
        assert status.level == Level.WARN
        assert status.message.startswith("2 nodes are called /estimator")
        assert status.message.endswith("; estimating")
        for one in (other, elsewhere, node):
            one.destroy_node()
    finally:
        rclpy.try_shutdown()
