"""Samples made of sensors begin when those who are expected listen: a bag has them all."""

import time

import pytest
import rclpy
from geometry_msgs.msg import WrenchStamped
from hc_msgs.msg import HuntCrossleyEstimate, IndenterSample
from rclpy.experimental import EventsExecutor
from sensor_msgs.msg import JointState

from hc_estimator.ros import sample_output
from hc_estimator.ros.effort import EffortInput
from hc_estimator.ros.node_settings import NODE_SETTINGS
from hc_estimator.ros.sensors import SensorInput
from hc_msgs_py.qos import ESTIMATE_QOS, SAMPLE_PUBLISHER_QOS, SAMPLE_QOS
from hc_msgs_py.topics import ESTIMATE, SAMPLE
from hc_msgs_py.units import set_stamp

SETTINGS = {name: setting.default for name, setting in NODE_SETTINGS.items()} | {
    "input.position.type": "joint",
    "input.position.topic": "arm",
}


class Receiver:
    def __init__(self):
        self.sequence = []

    def on_sample(self, stamp_ns, sequence, displacement_mm, force_n):
        self.sequence.append(sequence)

    def on_skip(self, number):
        pass  # a busy machine leaves readings out

    def on_frame(self, frame_id):
        pass

    def on_failure(self, error):
        raise error


class Robot:
    """Publishes both sensors, and hears what the input makes of them."""

    def __init__(self, domain_id):
        self.context = rclpy.Context()
        rclpy.init(context=self.context, domain_id=domain_id)
        self.node = rclpy.create_node("robot", context=self.context, enable_rosout=False)
        self.executor = EventsExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.forces = self.node.create_publisher(WrenchStamped, "ft_sensor/wrench", SAMPLE_QOS)
        self.arm = self.node.create_publisher(JointState, "arm", SAMPLE_QOS)
        self.recorded = []

    def record(self):
        def keep(message):
            self.recorded.append(message.sequence)

        self.node.create_subscription(HuntCrossleyEstimate, ESTIMATE, print, ESTIMATE_QOS)
        self.node.create_subscription(IndenterSample, SAMPLE, keep, SAMPLE_PUBLISHER_QOS)

    def press(self, enough):
        """Publish readings until it is enough, at most for 5 s."""
        end = time.monotonic() + 5.0
        while not enough() and time.monotonic() < end:
            stamp_ns = time.time_ns()
            force, joints = WrenchStamped(), JointState(name=["a"], position=[0.1], effort=[1.0])
            set_stamp(force.header.stamp, stamp_ns)
            set_stamp(joints.header.stamp, stamp_ns)
            self.forces.publish(force)
            self.arm.publish(joints)
            for _ in range(8):
                self.executor.spin_once(timeout_sec=0.002)
        return enough()

    def close(self):
        self.executor.shutdown()
        self.node.destroy_node()
        rclpy.shutdown(context=self.context)


@pytest.fixture
def robot(ros_domain):
    robot = Robot(ros_domain)
    yield robot
    robot.close()


@pytest.mark.process
@pytest.mark.parametrize("kind", [SensorInput, EffortInput])
def test_a_recorder_that_comes_late_gets_the_first_sample(robot, kind):
    receiver = Receiver()
    source = kind(robot.node, receiver, SETTINGS | {"expected_estimate_subscribers": 1})
    begun = time.monotonic()
    assert robot.press(lambda: time.monotonic() > begun + 0.5)
    assert receiver.sequence == []
    robot.record()
    assert robot.press(lambda: len(receiver.sequence) > 20 and len(robot.recorded) > 10)
    assert robot.recorded[0] == receiver.sequence[0]
    source.close()


@pytest.mark.process
@pytest.mark.parametrize("kind", [SensorInput, EffortInput])
def test_the_node_is_ready_when_its_samples_are_listened_to(robot, kind):
    source = kind(robot.node, Receiver(), SETTINGS | {"expected_sample_subscribers": 1})
    assert source.missing_listeners() == ["indenter/sample has 0 of 1 subscribers"]
    robot.record()
    assert robot.press(lambda: not source.missing_listeners())
    source.close()


@pytest.mark.process
def test_nobody_is_waited_for_who_is_not_expected_or_does_not_come(robot, monkeypatch):
    receiver = Receiver()
    source = SensorInput(robot.node, receiver, SETTINGS)
    assert robot.press(lambda: len(receiver.sequence) > 3)
    source.close()
    robot.node.create_subscription(HuntCrossleyEstimate, ESTIMATE, print, ESTIMATE_QOS)
    receiver = Receiver()
    watched = {"expected_estimate_subscribers": 1, "expected_sample_subscribers": 0}
    source = SensorInput(robot.node, receiver, SETTINGS | watched)
    assert robot.press(lambda: len(receiver.sequence) > 3)  # one who watches records nothing
    assert source.missing_listeners() == []
    source.close()
    monkeypatch.setattr(sample_output, "LONGEST_WAIT_S", 0.2)
    receiver = Receiver()
    begun = time.monotonic()
    source = SensorInput(robot.node, receiver, SETTINGS | {"expected_estimate_subscribers": 1})
    assert robot.press(lambda: receiver.sequence)
    assert time.monotonic() - begun > 0.2
    source.close()
