"""A force and a position sensor of one's own, each a publisher with its own rate and jitter."""

import math
import random
import time

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped, TransformStamped, WrenchStamped
from hc_msgs.msg import IndenterSample
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState

from hc_estimator import PARAMETER_NAMES
from hc_logger.recording import read_recording
from hc_logger.verify import verify
from hc_msgs_py.qos import SAMPLE_PUBLISHER_QOS, SAMPLE_QOS
from hc_msgs_py.units import set_stamp

pytestmark = pytest.mark.process

FORCE_BIAS = 1.7  # N
SURFACE = 412.0  # mm, in the frame of the position sensor
KEPT_QOS = QoSProfile(
    depth=SAMPLE_PUBLISHER_QOS.depth,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
RELIABLY = {
    f"qos_overrides./{topic}.subscription.{name}": value
    for topic in ("wrist", "arm")
    for name, value in (
        ("reliability", "reliable"),
        ("durability", "transient_local"),
        ("depth", KEPT_QOS.depth),
    )
}
"""No reading is lost on the way: counts are exact, but for a stall of two seconds (the backlog).

Nor at the start: discovery is one-sided, and on a busy machine the node may see a publisher that
sees it already only after the first readings, which are then kept for it.
"""


def wrench(stamp_ns, force):
    """The sensor sits askew: the force acts along (0, 3, 4) / 5, pressing is negative."""
    message = WrenchStamped()
    message.header.frame_id = "ft_sensor"
    set_stamp(message.header.stamp, stamp_ns)
    reading = FORCE_BIAS - force
    message.wrench.force.y, message.wrench.force.z = 0.6 * reading, 0.8 * reading
    return message


def pose(stamp_ns, displacement):
    """The tool goes down: z falls as the penetration grows."""
    message = PoseStamped()
    message.header.frame_id = "base"
    set_stamp(message.header.stamp, stamp_ns)
    message.pose.position.x = 0.3
    message.pose.position.z = (SURFACE - displacement) / 1000.0
    return message


def transform(stamp_ns, displacement):
    message = TransformStamped()
    message.child_frame_id = "tool"
    set_stamp(message.header.stamp, stamp_ns)
    message.transform.translation.z = (SURFACE - displacement) / 1000.0
    return message


def joint(stamp_ns, displacement):
    """A prismatic joint with a gear: 0.5 units for each metre."""
    message = JointState(name=["base", "tool"], position=[9.0, 0.0])
    set_stamp(message.header.stamp, stamp_ns)
    message.position[1] = (SURFACE - displacement) / 1000.0 * 0.5
    return message


def play(probe, plant, make_position, position_type, duration_s, latency_s=0.004):
    """Publish both streams for a while: forces at 1 kHz, positions at 250 Hz, both late.

    Every message comes up to latency_s after its stamp, so that they overtake each other.
    """
    forces = probe.node.create_publisher(WrenchStamped, "wrist", KEPT_QOS)
    positions = probe.node.create_publisher(position_type, "arm", KEPT_QOS)
    probe.forces = forces
    probe.wait(lambda: forces.get_subscription_count() and positions.get_subscription_count())
    probe.wait(lambda: probe.call("ready").success, what="~/ready")
    generator = random.Random(3)
    begin_ns = time.time_ns() + 50_000_000
    events = []
    for i in range(int(duration_s * 1000)):
        events.append((i * 1e-3 + generator.uniform(0, latency_s), forces, i * 1e-3))
    for i in range(int(duration_s * 250)):
        time_s = i * 4e-3 + 0.0013  # never at the stamp of a force
        events.append((time_s + generator.uniform(0, latency_s), positions, time_s))
    readings = {}
    known = len(probe.estimates)
    for arrival_s, publisher, time_s in sorted(events, key=lambda e: e[0]):
        due_ns = begin_ns + round(arrival_s * 1e9)
        while (left := due_ns - time.time_ns()) > 0:
            probe.executor.spin_once(timeout_sec=left * 1e-9)
        stamp_ns = begin_ns + round(time_s * 1e9)
        displacement, force = plant.readings(time_s)
        if publisher is forces:
            readings[stamp_ns] = force
            if len(readings) % 50 == 0:
                probe.executor.spin_once(timeout_sec=0)
                probe.keep_up(known + len(readings) - 200)
            publisher.publish(wrench(stamp_ns, force))
        else:
            publisher.publish(make_position(stamp_ns, displacement))
    probe.spin(0.3)
    return readings


def listen_to_the_end(probe):
    """Listen until a busy machine has come to the last estimate, and a status after it."""
    known = -1
    while known < len(probe.estimates):
        known = len(probe.estimates)
        probe.spin(1.5)


def counter(probe, name):
    return next(v.value for v in probe.statuses[-1].values if v.key == name)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "make_position", "message", "options"),
    [
        ("pose", pose, PoseStamped, {"input__position__axis": "z"}),
        ("transform", transform, TransformStamped, {"input__position__child_frame": "tool"}),
        ("joint", joint, JointState, {"input__position__joint": "tool"}),
    ],
)
def test_two_sensors_of_other_rates_with_jitter_give_the_tissue(
    start_process, end_process, probe, plant, kind, make_position, message, options
):
    process = start_process(
        input__source="sensors",
        input__force__topic="wrist",
        input__force__axis="direction",
        input__force__direction="[0.0, 3.0, 4.0]",
        input__force__sign=-1,
        input__force__zero=-FORCE_BIAS,
        input__position__topic="arm",
        input__position__type=kind,
        input__position__sign=-1,
        input__position__scale=2.0 if kind == "joint" else 1.0,
        input__position__zero=-SURFACE,
        input__pairing__reorder_window=0.005,
        input__pairing__maximum_wait=10.0,
        **options,
        **RELIABLY,
    )
    samples = []
    probe.node.create_subscription(
        IndenterSample, "indenter/sample", samples.append, SAMPLE_PUBLISHER_QOS
    )
    probe.call("ready")
    probe.wait(lambda: probe.node.count_publishers("indenter/sample") == 2, what="the samples")
    readings = play(probe, plant, make_position, message, 3.0)
    listen_to_the_end(probe)
    values = {v.key: v.value for v in probe.statuses[-1].values}
    assert values["pairing_late"] == "0"
    unpaired = int(values["pairing_unpaired"])  # before the first position
    assert unpaired < 10
    waiting = 7 + 2  # forces and positions later than the last position by its stamp - 5 ms
    assert len(probe.estimates) == 3000 + 750 - unpaired - waiting
    for estimate in probe.estimates[:200]:
        stamp_ns = estimate.header.stamp.sec * 10**9 + estimate.header.stamp.nanosec
        if stamp_ns in readings:
            assert estimate.force_measured == pytest.approx(readings[stamp_ns], abs=1e-9)
        else:  # a position: nothing is interpolated
            assert math.isnan(estimate.force_measured)
            assert math.isnan(estimate.innovation_force)
            assert not math.isnan(estimate.innovation_displacement)
    last = probe.estimates[-1]
    found = [
        last.stiffness,
        last.damping,
        last.displacement_exponent,
        last.velocity_exponent,
    ]
    np.testing.assert_allclose(found, plant.parameters, rtol=0.15)
    stamps = [(m.header.stamp.sec, m.header.stamp.nanosec) for m in probe.estimates]
    assert stamps == sorted(set(stamps))
    assert probe.estimates[0].header.frame_id == "ft_sensor"
    # What was estimated can be recorded: the samples are on the usual topic, zeros taken off.
    by_sequence = {m.sequence: m for m in samples}
    assert by_sequence.keys() == {estimate.sequence for estimate in probe.estimates}
    for estimate in probe.estimates[500:600]:
        sample = by_sequence[estimate.sequence]
        np.testing.assert_equal(sample.force, estimate.force_measured)
        assert math.isnan(sample.force) != math.isnan(sample.displacement)
    if kind == "pose":
        assert end_process(process)[0] == 0
        probe.wait(lambda: probe.contacts, what="the contact's summary")
        (contact,) = probe.contacts
        assert contact.position_frame_id == "base"
        assert (contact.position_x, contact.position_y) == (0.3, 0.0)


def test_a_slow_and_late_pose_gives_the_tissue_and_its_bag_verifies_to_the_last_bit(
    start_process, end_process, probe, plant, tmp_path
):
    """A wrench at 500 Hz beside a pose at 125 Hz that comes 20 ms late."""
    process = start_process(
        input__source="sensors",
        input__force__topic="wrist",
        input__force__axis="direction",
        input__force__direction=[0.0, 3.0, 4.0],
        input__force__sign=-1,
        input__force__zero=-FORCE_BIAS,
        input__position__topic="arm",
        input__position__type="pose",
        input__position__sign=-1,
        input__position__zero=-SURFACE,
    )
    bag = tmp_path / "bag"
    recorder = start_process("hc_logger.recorder_node", output=str(bag))
    forces = probe.node.create_publisher(WrenchStamped, "wrist", SAMPLE_QOS)
    poses = probe.node.create_publisher(PoseStamped, "arm", SAMPLE_QOS)
    probe.wait(lambda: forces.get_subscription_count() and poses.get_subscription_count())
    probe.wait(lambda: probe.call("ready").success, what="~/ready")
    probe.wait(lambda: probe.node.count_subscribers("hc/estimate") == 2, what="the recorder")
    probe.wait(lambda: probe.node.count_subscribers("indenter/sample") >= 1, what="the recorder")
    probe.spin(0.5)
    begin_ns = time.time_ns() + 50_000_000
    events = [(i * 2e-3, forces, i * 2e-3) for i in range(2500)]
    events += [(i * 8e-3 + 0.0203, poses, i * 8e-3 + 0.0003) for i in range(625)]
    for arrival_s, publisher, time_s in sorted(events, key=lambda e: e[0]):
        while (left := begin_ns + round(arrival_s * 1e9) - time.time_ns()) > 0:
            probe.executor.spin_once(timeout_sec=left * 1e-9)
        stamp_ns = begin_ns + round(time_s * 1e9)
        displacement, force = plant.readings(time_s)
        if publisher is forces:
            publisher.publish(wrench(stamp_ns, force))
        else:
            publisher.publish(pose(stamp_ns, displacement))
    listen_to_the_end(probe)
    values = {v.key: v.value for v in probe.statuses[-1].values}
    for node in (process, recorder):
        assert end_process(node)[0] == 0
    assert values["pairing_late"] == "0"
    assert values["pairing_unpaired"] == "1"  # the force before the first pose
    assert int(values["without_force"]) >= 600
    assert int(values["without_displacement"]) >= 2400
    recording = read_recording(bag)
    estimates = recording.estimates
    last = estimates[-1]
    found = [last[name] for name in PARAMETER_NAMES]
    np.testing.assert_allclose(found[0], plant.parameters[0], rtol=0.04)
    np.testing.assert_allclose(found, plant.parameters, rtol=0.15)
    settled = recording.time_s[-len(estimates) :] > 2.0
    assert np.mean(estimates["model_mismatch"][settled]) < 0.02
    report = verify(recording)
    assert report.differences == []
    assert report.compared == len(estimates) > 2900
    assert report.not_comparable == 0


@pytest.mark.slow
def test_a_position_sensor_that_dies_is_bounded_waiting_and_a_diagnosis(
    start_process, probe, plant
):
    process = start_process(
        input__source="sensors",
        input__force__topic="wrist",
        input__position__topic="arm",
        input__position__type="pose",
        input__pairing__reorder_window=0.005,
        input__silence_timeout=0.2,
        **RELIABLY,
    )
    probe.call("ready")
    play(probe, plant, pose, PoseStamped, 0.5)
    listen_to_the_end(probe)
    made = len(probe.estimates)
    assert 500 < made <= 500 + 125
    for _ in range(1500):
        probe.forces.publish(wrench(time.time_ns(), 1.0))
        probe.executor.spin_once(timeout_sec=0.001)
    probe.wait(lambda: 8 in probe.kinds(), what="the event of silence")
    probe.wait(
        lambda: probe.statuses and probe.statuses[-1].level == b"\x03", what="a stale status"
    )
    probe.wait(lambda: int(counter(probe, "pairing_unpaired")) > 500, what="the count")
    assert len(probe.estimates) < made + 100
    assert process.poll() is None


def test_a_tare_with_sensors_applies_to_whole_samples_and_is_refused_in_mid_press(
    start_process, end_process, probe
):
    """Poses that waited with the old zero were interpolated with the new one: 122 mm, 145 kN."""
    process = start_process(
        filter="ukf",
        input__source="sensors",
        input__force__topic="wrist",
        input__force__axis="direction",
        input__force__direction=[0.0, 3.0, 4.0],
        input__force__sign=-1,
        input__position__topic="arm",
        input__position__type="pose",
        input__position__sign=-1,
        tare__samples=100,
    )
    samples = []
    probe.node.create_subscription(IndenterSample, "indenter/sample", samples.append, SAMPLE_QOS)
    forces = probe.node.create_publisher(WrenchStamped, "wrist", SAMPLE_QOS)
    poses = probe.node.create_publisher(PoseStamped, "arm", SAMPLE_QOS)
    probe.wait(lambda: forces.get_subscription_count() and poses.get_subscription_count())
    probe.wait(lambda: probe.call("ready").success, what="~/ready")
    generator = np.random.default_rng(1)

    def move(depth_of, duration_s):
        """Publish poses at 125 Hz, 20 ms late, and forces at 500 Hz."""
        begin_ns = time.time_ns()
        late = []
        for i in range(int(duration_s * 500)):
            while (left := begin_ns + i * 2_000_000 - time.time_ns()) > 0:
                probe.executor.spin_once(timeout_sec=left * 1e-9)
            depth = depth_of(i / 500.0)
            stamp_ns = begin_ns + i * 2_000_000
            force = 0.5 * max(depth, 0.0) ** 1.5 + generator.normal(0.0, 0.01)
            forces.publish(wrench(stamp_ns, force))
            if i % 4 == 0:
                late.append(pose(stamp_ns, depth + generator.normal(0.0, 0.002)))
            if len(late) > 2:
                poses.publish(late.pop(0))
        probe.spin(0.2)

    def reasons(kind):
        return [event.reason for event in probe.events if event.kind == kind]

    probe.call("tare")
    move(lambda t: -0.1, 1.0)
    probe.wait(lambda: 15 in probe.kinds(), what="the tare's event")
    assert probe.get("input.position.zero")[0] == pytest.approx(-SURFACE - 0.1, abs=0.01)
    # Every sample before the tare is wholly of the old zero, every one after it of the new one.
    depths = [m.displacement * 1000.0 for m in samples if not math.isnan(m.displacement)]
    assert all(abs(d) < 1.0 or abs(d + SURFACE) < 1.0 for d in depths)
    pressed = [s.force for s in samples if not math.isnan(s.force)]
    assert all(abs(f) < 0.2 or abs(f + FORCE_BIAS) < 0.2 for f in pressed)
    probe.wait(
        lambda: (
            probe.estimates[-1].configuration_revision == probe.configurations[-1].revision == 2
        ),
        what="an estimate with the new zeros",
    )

    move(lambda t: 6.0 * t - 1.0, 0.5)  # from free motion into the tissue, and it stays there
    answer = probe.call("tare")
    assert not answer.success
    assert "the tool presses with " in answer.message
    assert "tare.force: true" in answer.message
    answer = probe.call("find_surface")  # waits until it is lifted
    assert answer.success
    assert "lift it free of contact, and press again" in answer.message
    probe.set(tare__force=True)
    assert probe.call("tare").success
    probe.wait(lambda: reasons(18) == ["find_surface given up: tare was asked for"])
    move(lambda t: 2.0, 0.5)
    probe.wait(lambda: probe.kinds().count(15) == 2, what="the forced tare")
    assert probe.get("input.position.zero")[0] == pytest.approx(-SURFACE + 2.0, abs=0.05)

    probe.set(tare__force=False)
    assert probe.call("tare").success
    move(lambda t: 2.0 + 8.0 * t, 0.5)
    probe.wait(lambda: len(reasons(18)) == 2, what="the refusal")
    assert "the tool moved by " in reasons(18)[-1]
    move(lambda t: 1.0, 0.1)
    assert probe.call("tare").success
    assert probe.call("reset").success
    probe.wait(
        lambda: "tare given up: a reset came between" in reasons(18), what="the end of the tare"
    )

    probe.set(filter="self_tuning_ukf")  # which considers how well the surface is known
    assert probe.get("contact_position_std")[0] == 0.0
    move(lambda t: 1.0 - 12.0 * t, 0.25)
    assert probe.call("find_surface").success
    move(lambda t: 10.0 * t - 2.0, 0.5)
    probe.wait(lambda: probe.kinds().count(15) == 3, what="the surface")
    zero, deviation = probe.get("input.position.zero", "contact_position_std")
    assert zero == pytest.approx(-SURFACE, abs=0.1)
    assert abs(zero + SURFACE) < 5.0 * deviation < 0.5
    assert f"(deviation {deviation:.2g} mm)" in reasons(15)[-1]
    assert end_process(process)[0] == 0
