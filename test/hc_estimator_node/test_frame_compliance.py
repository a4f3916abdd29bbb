"""A robot that gives way: what is taken off its position, one by one, in batches and after a tare.

The oracle is a plain subtraction of compliance times the force that was read last.
"""

import json
import math
import subprocess
import time
from types import SimpleNamespace

import numpy as np
import pytest

from hc_estimator.ros import inputs
from hc_estimator.ros.zeroing import Zeroing
from hc_estimator.stream.frame_compliance import SETTING, FrameCompliance
from hc_estimator.stream.tare import TareResult
from hc_msgs_py.wire import SampleEncoder
from hc_msgs_py.wire_arrays import SamplesEncoder

START = 1_700_000_000_000_000_000
MM_PER_N = 0.004
ZERO_N, ZERO_MM = 0.3, 2.0
SETTINGS = {
    "input.force.zero": ZERO_N,
    "input.position.zero": ZERO_MM,
    SETTING.name: MM_PER_N,
    "input.maximum_backlog": 1000,
}


def readings(count=400, every=4, seed=1):
    """Stamps [ns], displacements [mm] and forces [N], of which one in `every` is there."""
    random = np.random.default_rng(seed)
    stamps = START + 1_000_000 * np.arange(count)
    depth = 3.0 + np.sin(0.02 * np.arange(count)) + 0.002 * random.standard_normal(count)
    force = 5.0 * depth + 0.05 * random.standard_normal(count)
    force[np.arange(count) % every != 0] = np.nan
    return stamps, depth, force


def oracle(depth, force):
    """Displacements less zero and compliance times the last force, its zero taken off."""
    last, result = math.nan, []
    for d, f in zip(depth.tolist(), force.tolist(), strict=True):
        last = f if f == f else last
        result.append(d - ZERO_MM - MM_PER_N * (last - ZERO_N))
    return result


class Channel:
    """Stands for a topic: what is given to it goes to the input."""

    def __init__(self, *_, **more):
        self.take_many, self.maximum_backlog = more.get("take_many"), 0


class Receiver:
    """Takes samples, in batches of so many."""

    def __init__(self, together):
        self.together, self.displacements, self.forces = together, [], []

    def fewest_together(self):
        return self.together

    def on_sample(self, stamp_ns, sequence, displacement_mm, force_n):
        self.displacements.append(displacement_mm)
        self.forces.append(force_n)

    def on_samples(self, batch):
        self.displacements += batch.displacements_mm.tolist()
        self.forces += batch.forces_n.tolist()

    def on_frame(self, frame_id):
        assert frame_id == "tip"

    on_skip = on_failure = None


def through(monkeypatch, kind, samples, together=2, settings=SETTINGS):
    """Give samples to an input; returns what its receiver got."""
    monkeypatch.setattr(inputs, "Channel", Channel)
    receiver = Receiver(together)
    source = kind(None, receiver, settings)
    stamps, depth, force = samples
    for part in np.array_split(np.arange(len(stamps)), 7):
        if kind is inputs.ArrayInput:
            data = SamplesEncoder("tip").encode(
                stamps[part].tolist(), int(part[0]), depth[part], force[part]
            )
            source._take(data)
            continue
        encoder = SampleEncoder()
        encoder.set_frame("tip")
        rows = zip(stamps[part].tolist(), depth[part].tolist(), force[part].tolist(), strict=True)
        several = [bytes(encoder.encode(at, k, d, f)) for k, (at, d, f) in enumerate(rows)]
        source._channel.take_many(several)
    return receiver


@pytest.mark.parametrize("together", [2, 10**6])
@pytest.mark.parametrize("kind", [inputs.SampleInput, inputs.ArrayInput])
@pytest.mark.parametrize("every", [1, 4])
def test_samples_are_less_what_the_robot_gave_way(monkeypatch, kind, together, every):
    samples = readings(every=every)
    received = through(monkeypatch, kind, samples, together)
    read = through(monkeypatch, kind, samples, together, SETTINGS | {SETTING.name: 0.0})
    as_it_came = np.array(read.displacements) + ZERO_MM  # metres on the way cost the last bits
    np.testing.assert_array_equal(received.forces, read.forces)
    np.testing.assert_allclose(
        received.displacements, oracle(as_it_came, samples[2]), rtol=0.0, atol=1e-12
    )


def test_a_batch_and_one_by_one_are_the_same_to_the_last_bit(monkeypatch):
    for kind in (inputs.SampleInput, inputs.ArrayInput):
        batch, single = (through(monkeypatch, kind, readings(), n) for n in (2, 10**6))
        np.testing.assert_array_equal(batch.displacements, single.displacements)


def test_no_force_is_made_up():
    frame = FrameCompliance(MM_PER_N)
    assert math.isnan(frame.yielded_mm(START, math.nan))  # none has come
    assert frame.yielded_mm(START + 1, 2.0) == MM_PER_N * 2.0
    assert frame.yielded_mm(START + 300_000_000, math.nan, 0.5) == MM_PER_N * 1.5  # the last one
    assert frame.yielded_mm(START + 2, math.inf) == MM_PER_N * 2.0  # and not this one
    assert math.isnan(frame.yielded_mm(START + 600_000_000, math.nan))  # of long ago
    assert math.isnan(frame.yielded_mm(START - 600_000_000, math.nan))  # a clock was set back
    assert frame.yielded_mm(START + 700_000_000, -3.0) == MM_PER_N * -3.0


def test_without_a_compliance_nothing_is_taken_off_and_nothing_needs_a_force():
    frame = FrameCompliance()
    stamps, _depth, force = readings()
    force[:] = np.nan
    np.testing.assert_array_equal(frame.of_many(stamps, force), 0.0)
    frame.yielded_mm(START, 5.0)
    frame.mm_per_n = MM_PER_N
    assert math.isnan(frame.yielded_mm(START + 1, math.nan))


def test_a_tare_leaves_no_displacement_where_the_tool_rests():
    """Regression: compliance times the force zero that was off stayed in the position's zero."""
    values = {"input.force.zero": 0.2, "input.position.zero": 5.0, SETTING.name: 0.01}
    rest_mm, rest_n = 7.0, 3.2

    def read(settings):
        force = rest_n - settings["input.force.zero"]
        return rest_mm - settings["input.position.zero"] - 0.01 * force, force

    depth, force = read(values)
    found = TareResult(
        force_n=force, displacement_mm=depth, force_std_n=0.0, displacement_std_mm=0.0, samples=9
    )
    zeros = {p.name: p.value for p in Zeroing.parameters(found, values)}
    np.testing.assert_allclose(read(zeros), 0.0, atol=1e-12)
    assert zeros["input.position.zero"] == pytest.approx(rest_mm)


@pytest.mark.process
def test_sensors_with_rates_of_their_own_are_less_what_the_robot_gave_way(arm_and_wrist):
    """A wrench at 200 Hz, a joint at 500 Hz: each place with the last force before it."""
    depth = {2_000_000 * k + 300_000: 3.0 + math.sin(0.02 * k) for k in range(300)}
    force = {5_000_000 * k: 10.0 + math.sin(0.05 * k) for k in range(120)}
    begin, got = arm_and_wrist(
        depth,
        force,
        300,
        input__position__frame_compliance=MM_PER_N,
        input__force__zero=ZERO_N,
    )
    told = [sample for sample in got if not math.isnan(sample.displacement_mm)]
    assert len(told) > 200
    for sample in told:
        at = sample.stamp_ns - begin
        last = max(one for one in force if one <= at)
        expected = depth[at] - MM_PER_N * (force[last] - ZERO_N)
        assert sample.displacement_mm == pytest.approx(expected, abs=1e-9)


@pytest.mark.process
def test_what_cannot_be_a_compliance_is_refused_in_one_line(start_process, probe):
    process = start_process(input__position__frame_compliance=-0.001)
    assert process.wait(60) == 2
    start_process(filter="ekf")
    probe.wait_ready()
    for wrong in (-1.0, math.nan, 1e9):
        (answer,) = probe.set(input__position__frame_compliance=wrong)
        assert not answer.successful
        assert "frame_compliance" in answer.reason
    assert probe.get("input.position.frame_compliance") == [0.0]


def test_a_place_without_a_force_is_no_sample_of_sensors():
    """What is left of it would be neither a displacement nor a force."""
    from hc_estimator.ros.sensors import SensorInput

    counters = SimpleNamespace(unpaired=0)
    source = SimpleNamespace(
        _contact=None,
        _frame=FrameCompliance(MM_PER_N),
        _force_zero=0.0,
        _merger=SimpleNamespace(counters=counters),
    )
    alone = SimpleNamespace(stamp_ns=START, displacement=1.0, force=None)
    assert SensorInput._read(source, alone) is None
    assert counters.unpaired == 1
    with_force = SimpleNamespace(stamp_ns=START + 1, displacement=1.0, force=5.0)
    assert SensorInput._read(source, with_force) == (1.0 - MM_PER_N * 5.0, 5.0)
    place, force = SensorInput._read(source, alone)
    assert place == 1.0 - MM_PER_N * 5.0
    assert math.isnan(force)


@pytest.mark.process
@pytest.mark.parametrize("known", [0.0, 0.003])
def test_presses_on_steel_are_judged_while_they_happen(start_process, processes, probe, known):
    """What the estimator takes off already counts as not taken off: the whole is to be set."""
    start_process(filter="ekf", input__position__frame_compliance=known, input__force__zero=ZERO_N)
    probe.wait_ready()
    command = processes.start(
        "-m", "hc_bringup", "compliance", "--seconds", "5", "--json", stdout=subprocess.PIPE
    )
    random = np.random.default_rng(3)
    begin, number = time.time_ns(), 0
    while command.poll() is None and number < 6000:
        time_s = 0.01 * number
        way = -math.cos(math.pi * time_s)
        force = 20.0 * max(way, 0.0) + 0.02 * random.standard_normal()
        depth = 3.0 * min(way, 0.0) + MM_PER_N * force + 0.001 * random.standard_normal()
        probe.publish(begin + 10_000_000 * number, number, depth, force + ZERO_N)
        number += 1
        while (left := begin * 1e-9 + 0.01 * number - time.time()) > 0.0:
            probe.executor.spin_once(timeout_sec=left)
    said, error = command.communicate(timeout=20)
    assert command.returncode == 0, error
    assert "press on the steel for 5 s now" in str(error)
    found = json.loads(said)
    assert abs(found["mm_per_n"] - MM_PER_N) < 4.0 * found["mm_per_n_std"] < 0.05 * MM_PER_N
