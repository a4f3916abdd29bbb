"""Zeros taken anew in the middle of a recording are found, with time and size; contacts are not."""

import math

import numpy as np
import pytest

from hc_bringup.diagnosis import diagnose
from hc_estimator.contact.hunt_crossley import hunt_crossley_force
from hc_estimator.stream.readings import Check
from hc_estimator.stream.sanity import check_samples
from hc_sim_rig import Rig, load_scenario
from hc_sim_rig.scenario import available_scenarios

NOISE_N, NOISE_MM = 0.02, 0.005


def robot(rate_hz=500.0, poses=4, seed=1):
    """Two seconds of rest 3 mm above the tissue, then presses; a pose with every so many forces."""
    generator = np.random.default_rng(seed)
    time_s = np.arange(0.0, 20.0, 1.0 / rate_hz)
    pressing = np.maximum(time_s - 2.0, 0.0)
    depth = -3.0 + 3.5 * (1.0 - np.cos(2.2 * pressing)) + 0.2 * np.sin(11.0 * pressing)
    speed = np.gradient(depth, time_s)
    force = [
        hunt_crossley_force(d, v, 0.5, 0.05, 1.5, 1.0) if d > 0.0 else 0.0
        for d, v in zip(depth, speed, strict=True)
    ]
    displacement = depth + NOISE_MM * generator.standard_normal(time_s.size)
    displacement[np.arange(time_s.size) % poses != 0] = np.nan
    return time_s, displacement, force + NOISE_N * generator.standard_normal(time_s.size)


def steps(*samples):
    return [s for s in check_samples(*samples) if s.check is Check.ZERO_STEP]


BETWEEN_PRESSES_S = 2.0 + 2.0 * 2.0 * math.pi / 2.2
"""The tool is at its highest and moves on."""


@pytest.mark.parametrize("at_s", [1.3, BETWEEN_PRESSES_S])
@pytest.mark.parametrize("size_n", [0.15, -0.4, 3.0])
def test_a_force_that_was_zeroed_free_of_contact_is_found(at_s, size_n):
    time_s, displacement, force = robot()
    (found,) = steps(time_s, displacement, force + np.where(time_s >= at_s, size_n, 0.0))
    assert found.channel == "force"
    assert f"at {at_s:.2f} s, and no motion makes it" in found.sentence
    assert found.remedy == pytest.approx(size_n, abs=NOISE_N)
    assert (found.since_s, found.until_s) == (pytest.approx(at_s, abs=0.003), math.inf)


def test_a_tare_steps_both_and_the_readings_before_it_are_the_wrong_ones():
    time_s, displacement, force = robot()
    before = time_s < 1.3
    readings = time_s, displacement - 200.0 * before, force + 1.2 * before
    found = {s.channel: s for s in check_samples(*readings)}
    assert {s.check for s in found.values()} == {Check.ZERO_STEP}, found
    assert found["force"].remedy == pytest.approx(1.2, abs=NOISE_N)
    assert found["displacement"].remedy == pytest.approx(-200.0, abs=0.01)
    for doubt in found.values():
        assert (doubt.since_s, doubt.until_s) == (-math.inf, pytest.approx(1.3, abs=0.009))


def test_the_doctor_says_that_it_cost_little_for_the_filter_reads_it_anew():
    time_s, displacement, force = robot()
    diagnosis = diagnose(
        time_s, displacement, force + np.where(time_s >= BETWEEN_PRESSES_S, 0.4, 0.0)
    )
    (finding,) = diagnosis.findings
    assert "steps from " in finding.what
    assert "at 7.71 s" in finding.what
    assert finding.settings == {}
    assert finding.cost.startswith("little")
    assert diagnosis.estimated is not None
    assert diagnosis.estimated.parameters[0] == pytest.approx(0.5, rel=0.02)


def test_three_zeros_in_one_recording_are_three():
    time_s, displacement, force = robot()
    at = [1.0, BETWEEN_PRESSES_S, BETWEEN_PRESSES_S + 2.0 * math.pi / 2.2]
    shift = sum(np.where(time_s >= t, 0.5, 0.0) for t in at)
    found = steps(time_s, displacement, force + shift)
    assert [s.sentence.partition(" at ")[2].split()[0] for s in found] == [f"{t:.2f}" for t in at]


@pytest.mark.parametrize("seed", range(4))
def test_presses_are_none(seed):
    for rate_hz, poses in ((500.0, 4), (1000.0, 1), (40.0, 1)):
        assert not steps(*robot(rate_hz, poses, seed))


@pytest.mark.parametrize("name", available_scenarios())
def test_no_scenario_of_the_rig_has_one(name):
    """A needle that leaves its channel drops its friction between two readings, while it moves."""
    recording = Rig(load_scenario(name)).run()
    if hasattr(recording, "force_n"):
        assert not steps(recording.time_s, recording.displacement_mm, recording.force_n)


def test_a_force_that_lets_go_in_every_press_is_no_zero():
    """Regression: "its zero was taken anew" was told of each of four withdrawals of a needle."""
    time_s = np.arange(0.0, 40.0, 0.002)
    noise = np.random.default_rng(11)
    depth = -3.0 + 7.5 * (1.0 - np.cos(0.2 * np.pi * time_s))
    out = np.sin(0.2 * np.pi * time_s) < 0.0
    through = np.where(depth < 4.0, 0.4 * np.maximum(depth, 0.0) ** 1.5, 0.6)
    force = np.where(out, -0.2 * (depth > 0.0), through)
    readings = depth + noise.normal(0.0, 0.005, depth.size), force
    assert steps(time_s, readings[0], force + noise.normal(0.0, 0.01, depth.size)) == []


def test_zeros_that_are_taken_to_and_fro_are_found_all():
    time_s, displacement, force = robot()
    rests = [2.0 + k * 2.0 * math.pi / 2.2 for k in (1, 3, 5)]
    for sizes in ((0.4, -0.4, 0.4), (0.4, -0.8, 0.4)):
        zero = sum(s * (time_s >= at_s) for s, at_s in zip(sizes, rests, strict=True))
        assert len(steps(time_s, displacement, force + zero)) == len(rests)
