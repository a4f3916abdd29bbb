"""What moving the tool takes, taken off the forces of a sensor by the node; of samples refused."""

import math

import pytest

from hc_estimator.stream.tool_motion import DAMPING, MOVING_MASS

MASS_KG, DAMPING_N = 0.4, 0.03


@pytest.mark.process
def test_forces_are_less_it_and_none_is_numbered_twice(arm_and_wrist):
    """A wrench at 200 Hz, a joint at 500 Hz; what is published is what is estimated from."""
    joints = {2_000_000 * k: 3.0 + math.sin(0.05 * k) for k in range(400)}
    wrenches = {5_000_000 * k + 300_000: 10.0 for k in range(160)}
    begin, got = arm_and_wrist(
        joints,
        wrenches,
        480,
        input__force__moving_mass=MASS_KG,
        input__force__damping=DAMPING_N,
    )
    assert [s.sequence for s in got] == list(range(got[0].sequence, got[0].sequence + len(got)))
    compared = 0
    for sample in got:
        assert not (math.isnan(sample.force_n) and math.isnan(sample.displacement_mm))
        if math.isnan(sample.force_n):
            continue
        turn = 0.05 * (sample.stamp_ns - begin) / 2e6
        velocity, acceleration = 25.0 * math.cos(turn), -625.0 * math.sin(turn)
        taken_n = DAMPING_N * velocity + 1e-3 * MASS_KG * acceleration
        assert sample.force_n == pytest.approx(10.0 - taken_n, abs=0.01)
        compared += 1
    assert compared > 120


@pytest.mark.process
def test_what_is_of_sensors_is_refused_of_samples_in_one_line(start_process, probe):
    start_process(filter="ekf")
    probe.wait_ready()
    for name in ("moving_mass", "damping"):
        for value, says in ((-1.0, name), (math.nan, name), (0.1, "input.source = 'sensors'")):
            (answer,) = probe.set(**{f"input__force__{name}": value})
            assert not answer.successful
            assert says in answer.reason
            assert "\n" not in answer.reason
    assert probe.get(MOVING_MASS.name, DAMPING.name) == [0.0, 0.0]
