"""A frame of /tf as position, a tool that turns, and quality of service from parameters."""

import itertools
import math
import time
from contextlib import closing, contextmanager

import numpy as np
import pytest
import rclpy
from geometry_msgs.msg import PoseStamped, TransformStamped, WrenchStamped
from rclpy.experimental import EventsExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from scipy.spatial.transform import Rotation

from hc_estimator.ros.channel import SubscriptionError, idle_overrides
from hc_estimator.ros.inputs import publisher_conflict
from hc_estimator.ros.node_settings import NODE_SETTINGS
from hc_estimator.ros.sensors import SensorInput
from hc_msgs_py.units import set_stamp
from tf2_msgs.msg import TFMessage

DEFAULTS = {name: setting.default for name, setting in NODE_SETTINGS.items()}
OF_POSE = {
    "input.source": "sensors",
    "input.position.type": "pose",
    "input.position.topic": "pose",
    "input.publish_samples": False,
}
OF_TF = {
    "input.source": "sensors",
    "input.position.type": "tf",
    "input.position.topic": "/tf",
    "input.position.base_frame": "base",
    "input.position.child_frame": "tool",
    "input.position.sign": -1,
    "input.position.zero": -200.0,
    "input.publish_samples": False,
}
STEP_NS = 10_000_000
OVERRIDE = "qos_overrides./ft_sensor/wrench.subscription.reliability"


class Receiver:
    def __init__(self):
        self.samples = []

    def on_sample(self, stamp_ns, sequence, displacement_mm, force_n):
        self.samples.append((stamp_ns, displacement_mm, force_n))

    def on_skip(self, number):
        raise AssertionError(number)

    def on_frame(self, frame_id):
        pass

    def on_failure(self, error):
        raise error


@contextmanager
def running_node(ros_domain, **parameters):
    """A node and its executor, gone in the end, or the next try would hear them."""
    context = rclpy.Context()
    words = [w for item in parameters.items() for w in ("-p", f"{item[0]}:={item[1]}")]
    rclpy.init(context=context, domain_id=ros_domain, args=["--ros-args", *words] if words else [])
    node = rclpy.create_node("input", context=context, enable_rosout=False)
    executor = EventsExecutor(context=context)
    executor.add_node(node)
    try:
        yield node, executor
    finally:
        executor.shutdown()
        node.destroy_node()
        rclpy.shutdown(context=context)


def transform(parent, child, stamp_ns, x=0.0, z=0.0):
    message = TransformStamped(child_frame_id=child)
    message.header.frame_id = parent
    set_stamp(message.header.stamp, stamp_ns)
    message.transform.translation.x, message.transform.translation.z = x, z
    return message


@pytest.mark.process
def test_a_quality_of_service_of_another_topic_is_said_to_do_nothing(ros_domain):
    """Regression: one without the leading / was passed over without a word."""
    values = DEFAULTS | OF_TF
    wrong = ("qos_overrides.ft_sensor/wrench.subscription.depth", OVERRIDE[:-1])
    given = {wrong[0]: 50, wrong[1]: "reliable", OVERRIDE: "reliable"}
    with (
        running_node(ros_domain, **given) as (node, _executor),
        closing(SensorInput(node, Receiver(), values)) as source,
    ):
        lines = idle_overrides(node, source.channels)
    assert sorted(line.partition(" has no effect")[0] for line in lines) == sorted(wrong)
    assert "of /ft_sensor/wrench and /tf" in lines[0]


@pytest.mark.process
def test_the_chain_of_frames_gives_the_depth_at_the_stamp_of_what_moved(ros_domain):
    values = DEFAULTS | OF_TF
    receiver = Receiver()
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    with running_node(ros_domain, **{OVERRIDE: "reliable"}) as (node, executor):
        fixed = node.create_publisher(TFMessage, "/tf_static", latched)
        fixed.publish(TFMessage(transforms=[transform("wrist", "tool", 0, z=0.1)]))
        # The input comes late for what was told once.
        with closing(SensorInput(node, receiver, values)) as source:
            start_ns = publish_until(node, executor, receiver, 20)
            places = [(s, d) for s, d, _f in receiver.samples if d == d]
            assert len(receiver.samples) > 20
            for stamp_ns, depth_mm in places:
                step, rest = divmod(stamp_ns - start_ns, STEP_NS)
                assert rest == 0  # not that of the camera
                assert depth_mm == pytest.approx(0.01 * step, abs=1e-6)
            assert source.position[1] == "base"
            # Two publish /tf, as many do, and all are heard: no conflict.
            assert source.channels[1].publishers == 2
            assert publisher_conflict(source.channels) == ""
            ends = node.get_subscriptions_info_by_topic("/ft_sensor/wrench")
            assert ends
            assert {info.qos_profile.reliability for info in ends} == {ReliabilityPolicy.RELIABLE}


def wait_for_subscribers(executor, *publishers):
    end_s = time.monotonic() + 20.0
    while not all(publisher.get_subscription_count() for publisher in publishers):
        assert time.monotonic() < end_s
        executor.spin_once(timeout_sec=0.01)


def publish_until(node, executor, receiver, enough):
    """Publish frames, by two publishers as /tf has many, and forces; returns the first stamp."""
    frames = node.create_publisher(TFMessage, "/tf", 10)
    others = node.create_publisher(TFMessage, "/tf", 10)
    forces = node.create_publisher(WrenchStamped, "ft_sensor/wrench", 10)
    wait_for_subscribers(executor, frames, others, forces)
    start_ns = time.time_ns()
    end_s = time.monotonic() + 20.0  # what was told once comes when it comes
    for i in itertools.count():
        assert time.monotonic() < end_s
        stamp_ns = start_ns + STEP_NS * i
        frames.publish(TFMessage(transforms=[transform("base", "arm", stamp_ns, x=0.3)]))
        moved = transform("/arm", "/wrist", stamp_ns, x=-0.3, z=0.1 - 1e-5 * i)
        others.publish(TFMessage(transforms=[moved, transform("tool", "camera", stamp_ns + 9)]))
        force = WrenchStamped()
        set_stamp(force.header.stamp, stamp_ns)
        force.wrench.force.z = float(i)
        forces.publish(force)
        executor.spin_once(timeout_sec=0.01)
        if len(receiver.samples) > enough:
            break
    return start_ns


def turned(time_s):
    """The attitude of a tool that turns at 0.5 rad/s."""
    return Rotation.from_rotvec(0.5 * time_s * np.array([0.6, 0.8, 0.0]))


@pytest.mark.process
def test_a_wrench_is_turned_by_the_attitude_at_its_stamp_with_the_offsets_of_both(ros_domain):
    """The pose comes 20 ms late and is stamped 3 ms late, the wrench 7 ms."""
    values = (
        DEFAULTS
        | OF_POSE
        | {
            "input.force.topic": "wrench",
            "input.force.time_offset": -0.007,
            "input.position.time_offset": -0.003,
            "input.contact.frame": "surface",
            "input.payload.mass": 0.7,
        }
    )
    receiver = Receiver()
    with (
        running_node(ros_domain) as (node, executor),
        closing(SensorInput(node, receiver, values)) as source,
    ):
        forces = node.create_publisher(WrenchStamped, "wrench", 10)
        poses = node.create_publisher(PoseStamped, "pose", 10)
        wait_for_subscribers(executor, forces, poses)
        begin_ns = time.time_ns()
        events = [(1e-3 * t, forces, 1e-3 * t) for t in range(0, 1000, 2)]
        events += [(1e-3 * t + 0.0203, poses, 1e-3 * t + 0.0003) for t in range(0, 1000, 8)]
        for arrival_s, publisher, time_s in sorted(events, key=lambda event: event[0]):
            while (left := begin_ns + arrival_s * 1e9 - time.time_ns()) > 0:
                executor.spin_once(timeout_sec=left * 1e-9)
            if publisher is forces:
                message = WrenchStamped()
                set_stamp(message.header.stamp, begin_ns + round((time_s + 0.007) * 1e9))
                told = turned(time_s).inv().apply([0.0, 0.0, 2.0 - 0.7 * 9.81])
                force = message.wrench.force
                force.x, force.y, force.z = map(float, told)
            else:
                message = PoseStamped()
                set_stamp(message.header.stamp, begin_ns + round((time_s + 0.003) * 1e9))
                q = message.pose.orientation
                q.x, q.y, q.z, q.w = map(float, turned(time_s).as_quat())
            publisher.publish(message)
        read = [force for _, _, force in receiver.samples if force == force]
        assert len(read) > 400
        np.testing.assert_allclose(read, 2.0, atol=1e-6)
        assert source.counters["attitude_late"] == 0


@pytest.mark.process
def test_a_quality_of_service_that_does_not_exist_is_one_line(ros_domain):
    values = DEFAULTS | OF_TF
    expected = r"cannot subscribe to ft_sensor/wrench: .*always"
    with (
        running_node(ros_domain, **{OVERRIDE: "always"}) as (node, _executor),
        pytest.raises(SubscriptionError, match=expected),
    ):
        SensorInput(node, Receiver(), values)


@pytest.mark.process
@pytest.mark.parametrize("held", [True, False])
def test_the_node_counts_each_reading_of_both_sensors_once(ros_domain, held):
    values = (
        DEFAULTS
        | OF_POSE
        | {
            "input.force.topic": "wrench",
            "input.force.held": held,
            "input.position.held": held,
        }
    )
    receiver = Receiver()
    with (
        running_node(ros_domain) as (node, executor),
        closing(SensorInput(node, receiver, values)),
    ):
        forces = node.create_publisher(WrenchStamped, "wrench", 10)
        poses = node.create_publisher(PoseStamped, "pose", 10)
        wait_for_subscribers(executor, forces, poses)
        begin_ns, end_s = time.time_ns(), time.monotonic() + 20.0
        for i in itertools.count():
            assert time.monotonic() < end_s
            wrench, pose = WrenchStamped(), PoseStamped()
            for message in (wrench, pose):
                set_stamp(message.header.stamp, begin_ns + 2_000_000 * i)
            wrench.wrench.force.z = float(i // 2)
            pose.pose.position.z = float(i // 4)
            forces.publish(wrench)
            poses.publish(pose)
            executor.spin_once(timeout_sec=0.01)
            if len(receiver.samples) > 60:
                break
    samples = np.array(receiver.samples)
    places, pushes = (column[~np.isnan(column)] for column in samples[:, 1:].T)
    assert len(places) > 20
    again = [np.mean(np.diff(column) == 0.0) for column in (places, pushes)]
    assert again == [0.0, 0.0] if held else min(again) > 0.4


@pytest.mark.process
def test_the_node_puts_readings_that_are_stamped_on_arrival_at_even_times(ros_domain):
    """Forces of 500 Hz come in packets of eight; the rate is known after half a second."""
    values = (
        DEFAULTS
        | OF_POSE
        | {
            "input.force.topic": "wrench",
            "input.force.stamps": "arrival",
        }
    )
    receiver, period_ns = Receiver(), 2_000_000
    with (
        running_node(ros_domain) as (node, executor),
        closing(SensorInput(node, receiver, values)) as sensors,
    ):
        forces = node.create_publisher(WrenchStamped, "wrench", 100)
        poses = node.create_publisher(PoseStamped, "pose", 100)
        wait_for_subscribers(executor, forces, poses)
        begin_ns, end_s = time.time_ns(), time.monotonic() + 40.0

        def publish(first, last):
            for i in range(first, last):
                wrench, pose = WrenchStamped(), PoseStamped()
                came = begin_ns + (i // 8 * 8 + 7) * period_ns + i % 8 * 20_000
                set_stamp(wrench.header.stamp, came)
                set_stamp(pose.header.stamp, begin_ns + i * period_ns)
                wrench.wrench.force.z = float(i)
                pose.pose.position.z = 1e-3 * i
                forces.publish(wrench)
                poses.publish(pose)
                executor.spin_once(timeout_sec=0.01)
                executor.spin_once(timeout_sec=0.001)

        publish(0, 800)
        samples = np.array(receiver.samples)
        of_force = samples[~np.isnan(samples[:, 2])][-300:]
        late_ns = of_force[:, 0] - begin_ns - of_force[:, 2] * period_ns
        assert np.ptp(late_ns) < 5_000
        assert 0.0 <= late_ns[0] < 200_000  # what the last one of a packet took
        sensors.configure(values | {"input.force.stamps": "measured"})
        number = len(receiver.samples)
        publish(800, 960)
        assert time.monotonic() < end_s
        samples = np.array(receiver.samples[number:])
        of_force = samples[~np.isnan(samples[:, 2])][-80:]
        assert np.ptp(of_force[:, 0] - begin_ns - of_force[:, 2] * period_ns) > 10_000_000


@pytest.mark.process
def test_a_position_that_changes_its_frame_is_a_problem(ros_domain):
    """Regression: poses of one topic in two frames were read as one motion, and nothing said."""
    values = DEFAULTS | OF_POSE
    with (
        running_node(ros_domain) as (node, executor),
        closing(SensorInput(node, Receiver(), values)) as source,
    ):
        poses = node.create_publisher(PoseStamped, "pose", 10)
        wait_for_subscribers(executor, poses)

        def problems_after(*frames):
            before, end_s = source.channels[1].received, time.monotonic() + 20.0
            for frame in frames:
                message = PoseStamped()
                message.header.frame_id = frame
                set_stamp(message.header.stamp, time.time_ns())
                poses.publish(message)
            while source.channels[1].received < before + len(frames):
                assert time.monotonic() < end_s
                executor.spin_once(timeout_sec=0.01)
            return source.problems

        assert list(problems_after("base", "base")) == []
        (said,) = problems_after("base", "camera")
        assert "pose came in the frame 'base', and then in 'camera'" in said


@pytest.mark.process
def test_readings_that_are_no_numbers_are_counted_as_such(ros_domain):
    """Regression: NaN of a driver were "lost or late", and in no counter."""
    values = DEFAULTS | OF_POSE | {"input.force.topic": "wrench"}
    with (
        running_node(ros_domain) as (node, executor),
        closing(SensorInput(node, Receiver(), values)) as source,
    ):
        forces = node.create_publisher(WrenchStamped, "wrench", 100)
        poses = node.create_publisher(PoseStamped, "pose", 100)
        wait_for_subscribers(executor, forces, poses)
        for i in range(30):
            wrench, pose = WrenchStamped(), PoseStamped()
            set_stamp(wrench.header.stamp, time.time_ns())
            set_stamp(pose.header.stamp, time.time_ns())
            wrench.wrench.force.z = math.nan if i % 3 == 0 else 1.0
            pose.pose.position.z = math.inf if i == 7 else 0.0
            forces.publish(wrench)
            poses.publish(pose)
        end_s = time.monotonic() + 20.0
        while min(channel.received for channel in source.channels) < 30:
            assert time.monotonic() < end_s
            executor.spin_once(timeout_sec=0.01)
        counted = [source.counters[f"{name}_not_finite"] for name in ("force", "position")]
        assert counted == [10, 1]
