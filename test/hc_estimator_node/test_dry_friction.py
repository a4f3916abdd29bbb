"""Friction taken off by the node: of samples one by one and in batches, and of sensors."""

import math
import time

import numpy as np
import pytest
from geometry_msgs.msg import WrenchStamped
from hc_msgs.msg import IndenterSample
from sensor_msgs.msg import JointState

from hc_estimator.ros import inputs
from hc_estimator.stream.dry_friction import DRY_FRICTION, PRESLIDING, DryFriction
from hc_msgs_py.conversion import sample_from_message
from hc_msgs_py.qos import SAMPLE_QOS
from hc_msgs_py.units import set_stamp

FRICTION_N, PRESLIDING_MM = 0.4, 0.03
LESS = {DRY_FRICTION.name: FRICTION_N, PRESLIDING.name: PRESLIDING_MM}


class Channel:
    """Stands for a topic."""

    def __init__(self, *_args, **_more):
        self.maximum_backlog = 0


class Receiver:
    """Takes samples one by one, or in batches of so many."""

    def __init__(self, together):
        self.fewest_together = lambda: together
        self.displacements, self.forces = [], []
        self.on_skip = self.on_failure = None

    def on_sample(self, _stamp_ns, _sequence, displacement_mm, force_n):
        self.displacements.append(displacement_mm)
        self.forces.append(force_n)

    def on_samples(self, batch):
        self.displacements += batch.displacements_mm.tolist()
        self.forces += batch.forces_n.tolist()


def samples(count=400):
    random = np.random.default_rng(1)
    depth = 3.0 + np.sin(0.05 * np.arange(count)) + 0.002 * random.standard_normal(count)
    stamps = 1_700_000_000_000_000_000 + 1_000_000 * np.arange(count)
    return stamps, np.arange(count), depth, 5.0 * depth


@pytest.mark.parametrize("together", [2, 10**6])
def test_samples_are_less_it(monkeypatch, together):
    monkeypatch.setattr(inputs, "Channel", Channel)
    settings = {
        "input.force.zero": 0.3,
        "input.position.zero": 2.0,
        "input.position.frame_compliance": 0.004,
        "input.maximum_backlog": 1000,
    }
    receiver = Receiver(together)
    source = inputs.SampleInput(None, receiver, settings | LESS)
    columns = samples()
    for part in np.array_split(np.arange(len(columns[0])), 7):
        source._hand_on(tuple(column[part] for column in columns))
    depth, force = columns[2:]
    np.testing.assert_allclose(
        receiver.displacements, depth - 2.0 - 0.004 * (force - 0.3), atol=1e-12
    )
    friction = DryFriction(FRICTION_N, PRESLIDING_MM)
    taken_off = friction.of_many(columns[0], np.array(receiver.displacements))
    np.testing.assert_array_equal(receiver.forces, force - 0.3 - taken_off)
    assert np.nanmax(taken_off) - np.nanmin(taken_off) == 2.0 * FRICTION_N
    source.configure(settings)
    source._hand_on(tuple(column[:1] for column in columns))
    assert receiver.forces[-1] == force[0] - 0.3


@pytest.mark.process
def test_forces_of_a_sensor_are_less_that_of_the_place_before_them(start_process, probe):
    """A wrench at 200 Hz, a joint at 500 Hz; what is published is what is estimated from."""
    start_process(
        filter="ekf",
        input__source="sensors",
        input__force__topic="wrist",
        input__position__topic="arm",
        input__position__type="joint",
        input__force__dry_friction=FRICTION_N,
        input__force__presliding=PRESLIDING_MM,
    )
    got = []
    probe.node.create_subscription(
        IndenterSample, "indenter/sample", lambda m: got.append(sample_from_message(m)), SAMPLE_QOS
    )
    forces = probe.node.create_publisher(WrenchStamped, "wrist", 1000)
    places = probe.node.create_publisher(JointState, "arm", 1000)
    probe.wait(lambda: forces.get_subscription_count() and places.get_subscription_count(), 90.0)
    probe.wait(lambda: probe.call("ready").success, 90.0)
    begin = time.time_ns()
    depth = {begin + 2_000_000 * k: 3.0 + math.sin(0.05 * k) for k in range(300)}
    force = {begin + 5_000_000 * k + 300_000: 10.0 for k in range(120)}
    for stamp in sorted({**depth, **force}):
        if stamp in force:
            message = WrenchStamped()
            message.wrench.force.z = force[stamp]
        else:
            message = JointState(name=["tool"], position=[depth[stamp] / 1000.0])
        set_stamp(message.header.stamp, stamp)
        (forces if stamp in force else places).publish(message)
        probe.executor.spin_once(timeout_sec=0.001)
    probe.wait(lambda: len(got) > 330)
    friction, compared = DryFriction(FRICTION_N, PRESLIDING_MM), 0
    for sample in got:
        expected = friction.at(sample.stamp_ns, sample.displacement_mm)
        assert not (math.isnan(sample.force_n) and math.isnan(sample.displacement_mm))
        if not math.isnan(sample.force_n):
            assert sample.force_n == pytest.approx(10.0 - expected, abs=1e-6)
            compared += 1
    assert compared > 60
    assert [s.sequence for s in got] == list(range(got[0].sequence, got[0].sequence + len(got)))
    assert {round(sample.force_n, 3) for sample in got if sample.force_n == sample.force_n} >= {
        9.6,
        10.4,
    }


@pytest.mark.process
def test_what_cannot_be_a_friction_is_refused_in_one_line(start_process, probe):
    start_process(filter="ekf")
    probe.wait_ready()
    for name, wrong in (("dry_friction", -1.0), ("dry_friction", math.nan), ("presliding", 0.0)):
        (answer,) = probe.set(**{f"input__force__{name}": wrong})
        assert not answer.successful
        assert name in answer.reason
    assert probe.get(DRY_FRICTION.name) == [0.0]
