"""Friction taken off by the node: of samples one by one and in batches, and of sensors."""

import math

import numpy as np
import pytest

from hc_estimator.ros import inputs
from hc_estimator.stream.dry_friction import DRY_FRICTION, PRESLIDING, DryFriction

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
def test_forces_of_a_sensor_are_less_that_of_the_place_before_them(arm_and_wrist):
    """A wrench at 200 Hz, a joint at 500 Hz; what is published is what is estimated from."""
    _begin, got = arm_and_wrist(
        {2_000_000 * k: 3.0 + math.sin(0.05 * k) for k in range(300)},
        {5_000_000 * k + 300_000: 10.0 for k in range(120)},
        330,
        input__force__dry_friction=FRICTION_N,
        input__force__presliding=PRESLIDING_MM,
    )
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
