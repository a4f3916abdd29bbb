"""The rig as a whole: the same numbers however it is run, noise as ordered, smooth settings."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from hc_sim_rig import Rig, RigSeries, ScenarioError, available_scenarios, load_scenario
from hc_sim_rig.bilateral import Bilateral
from hc_sim_rig.bilateral.model_source import SlaveModel
from hc_sim_rig.bilateral.sides import SlaveSide
from hc_sim_rig.bilateral.simulated_hand import SimulatedHand
from hc_sim_rig.bilateral.task import palpation_task
from hc_sim_rig.bilateral.udp_link import Added, UdpLink
from hc_sim_rig.drives import Slave, Stage
from hc_sim_rig.motions import Sine, Waypoints
from hc_sim_rig.profile import leg_duration, profile_at, profile_from_legs
from hc_sim_rig.tissues import NoTissue


def flat(series: RigSeries) -> np.ndarray:
    columns = [
        series.time_s,
        series.sequence,
        series.displacement_mm,
        series.force_n,
        *series.truth[:3],
        series.truth.parameters.T,
        series.truth.contact,
        *series.master,
        *series.slave,
        series.lateral_mm,
        *series.coupling,
    ]
    return np.vstack(columns).astype(float)


@pytest.mark.parametrize("name", available_scenarios())
def test_step_and_run_give_the_same_bits(name: str) -> None:
    stepped, run = Rig(name, seed=3), Rig(name, seed=3)
    samples = [stepped.step() for _ in range(1500)]
    # Odd parts, so that the blocks of random draws end in the middle of one.
    parts = [run.run(0.7), run.run(0.001), run.run(0.799)]
    whole = np.hstack([flat(part) for part in parts])
    again = flat(Rig(name, seed=3).run(1.5))
    assert again.tobytes() == whole.tobytes()
    single = np.array(
        [
            [
                s.time_s,
                s.sequence,
                s.displacement_mm,
                s.force_n,
                *s.truth[:3],
                *s.truth.parameters,
                s.truth.contact,
                *s.master,
                *s.slave,
                s.lateral_mm,
                *s.coupling,
            ]
            for s in samples
        ]
    ).T
    assert np.array_equal(single, whole, equal_nan=True)


def test_reset_begins_anew_and_another_seed_is_another_noise() -> None:
    rig = Rig("teleoperation", seed=5)
    first = flat(rig.run(3.0)).tobytes()
    rig.reset()
    assert flat(rig.run(3.0)).tobytes() == first
    assert flat(Rig("teleoperation", seed=6).run(3.0)).tobytes() != first


def test_the_multisine_is_the_excitation_of_the_paper_notes() -> None:
    series = Rig("multisine", seed=1).run(60.0)
    t = series.time_s
    d = 3 + 1.6 * np.sin(2 * np.pi * 0.7 * t) + 0.8 * np.sin(2 * np.pi * 2.3 * t + 0.5)
    v = 1.6 * 2 * np.pi * 0.7 * np.cos(2 * np.pi * 0.7 * t) + 0.8 * 2 * np.pi * 2.3 * np.cos(
        2 * np.pi * 2.3 * t + 0.5
    )
    force = 0.2 * d**1.8 + 0.008 * d**1.8 * np.sign(v) * np.abs(v) ** 1.05
    assert np.array_equal(t, np.arange(60000) / 1000.0)
    np.testing.assert_allclose(series.truth.displacement_mm, d, atol=1e-8)
    np.testing.assert_allclose(series.truth.velocity_mm_s, v, atol=1e-7)
    np.testing.assert_allclose(series.truth.force_n, force, atol=1e-7)
    assert np.all(series.truth.parameters == [0.2, 0.008, 1.8, 1.05])
    for error, std in (
        (series.displacement_mm - series.truth.displacement_mm, 0.002),
        (series.force_n - series.truth.force_n, 0.010),
    ):
        chi2 = np.sum((error / std) ** 2)
        low, high = stats.chi2.ppf([1e-4, 1 - 1e-4], len(error))
        assert low < chi2 < high
        # white: no correlation from sample to sample beyond chance
        assert abs(np.corrcoef(error[1:], error[:-1])[0, 1]) < 4.0 / math.sqrt(len(error))


def test_displacement_and_force_noise_are_independent() -> None:
    series = Rig("multisine", seed=2).run(30.0)
    errors = [
        series.displacement_mm - series.truth.displacement_mm,
        series.force_n - series.truth.force_n,
    ]
    assert abs(np.corrcoef(errors)[0, 1]) < 4.0 / math.sqrt(30000)


def test_indentation_goes_in_holds_and_comes_back() -> None:
    rig = Rig("indentation")
    series = rig.run()
    d, v = series.truth.displacement_mm, series.truth.velocity_mm_s
    assert rig.finished
    assert len(series) == 24200
    # 0.1 s to reach 0.1 mm/s, and 0.1 s to stop again: 11.1 s for 1.1 mm.
    going_in = (series.time_s > 0.1005) & (series.time_s < 10.9995)
    np.testing.assert_allclose(v[going_in], 0.1, rtol=1e-9)
    holds = (series.time_s > 11.1005) & (series.time_s < 13.0995)
    assert np.all(v[holds] == 0.0)
    np.testing.assert_allclose(d[holds], 1.0, rtol=1e-12)
    np.testing.assert_allclose(series.truth.force_n[holds], 10.0, rtol=1e-9)
    np.testing.assert_allclose(
        v[(series.time_s > 13.2005) & (series.time_s < 24.0995)], -0.1, rtol=1e-9
    )
    assert np.array_equal(series.truth.contact, d > 0.0)
    assert np.all(series.truth.force_n[d <= 0.0] == 0.0)


@given(
    start=st.floats(-5.0, 5.0),
    ways=st.lists(st.floats(-8.0, 8.0), min_size=1, max_size=4),
    velocity=st.floats(0.05, 50.0),
    acceleration=st.floats(1.0, 5000.0),
)
def test_ways_from_rest_to_rest_keep_their_limits(
    start: float, ways: list[float], velocity: float, acceleration: float
) -> None:
    begin, value, legs = 0.1, start, []
    for way in ways:
        value += way
        legs.append((begin, value))
        begin += leg_duration(way, velocity, acceleration) + 0.05
    profile = profile_from_legs(start, legs, velocity, acceleration)
    times = np.linspace(0.0, begin, 1501)
    found = [profile_at(t, profile.segments, profile.sines, 0) for t in times]
    x = profile.offset + np.array([entry[0] for entry in found])
    v = np.array([entry[1] for entry in found])
    step = times[1]
    assert np.abs(v).max() <= velocity * (1 + 1e-9)
    assert np.abs(np.diff(v)).max() <= acceleration * step * (1 + 1e-6) + 1e-9
    np.testing.assert_allclose(
        np.diff(x), 0.5 * (v[1:] + v[:-1]) * step, atol=acceleration * step**2
    )
    assert (v[0], v[-1]) == (0.0, 0.0)
    assert x[0] == pytest.approx(start, abs=1e-9)
    assert x[-1] == pytest.approx(value, abs=1e-9)


def test_settings_glide_and_the_motion_stays_smooth() -> None:
    rig = Rig(load_scenario("multisine"))
    before = rig.run(1.0)
    rig.tune(amplitude=0.4, speed=2.0, stiffness=0.5, force_noise_std_n=0.1)
    during = rig.run(1.0)
    after = rig.run(1.0)
    d = np.concatenate([s.truth.displacement_mm for s in (before, during, after)])
    v = np.concatenate([s.truth.velocity_mm_s for s in (before, during, after)])
    # the velocity is the slope of the displacement, also while everything changes
    slope = (d[2:] - d[:-2]) / 0.002
    error = np.abs(slope - v[1:-1])
    assert error.max() < 0.1  # where the glide begins the acceleration jumps, the velocity does not
    assert np.delete(error, [998, 999, 1000]).max() < 0.01
    assert np.abs(np.diff(v)).max() < 1.0  # no jump: at most 1 mm/s per millisecond
    K = during.truth.parameters[:, 0]
    assert K[0] == 0.2
    assert np.all(np.diff(K) >= 0.0)
    assert np.abs(np.diff(K)).max() < 0.005
    assert 0.49 < K[300] < 0.5  # 98 % of the way after transition_time_s
    assert after.truth.parameters[-1, 0] == 0.5
    assert (after.force_n - after.truth.force_n).std() == pytest.approx(0.1, rel=0.1)
    assert np.ptp(after.truth.displacement_mm) == pytest.approx(0.4 * 4.78, rel=0.1)


def test_a_pause_brings_the_motion_to_rest_and_on_again() -> None:
    rig = Rig("free_space_contact")
    rig.run(1.0)
    rig.tune(speed=0.0)
    rig.run(1.0)
    rest = rig.run(1.0)
    assert np.ptp(rest.truth.displacement_mm) < 1e-6
    assert np.abs(rest.truth.velocity_mm_s).max() < 1e-5
    assert len(rest) == 1000  # the sensors go on
    rig.tune(speed=1.0)
    rig.run(1.0)
    assert np.ptp(rig.run(2.0).truth.displacement_mm) > 1.0


def test_an_exponent_stays_one_through_the_changes_of_the_tissue() -> None:
    """Regression: with n at its limit a change made it 0, and contact began with a force."""
    rig = Rig("tissue_change")
    with pytest.raises(
        ScenarioError, match=r"0.2 would be 0 after the scenario's changes, must st"
    ):
        rig.start_with(displacement_exponent=0.2)
    rig.start_with(displacement_exponent=0.3)
    assert rig.run(12.0).truth.parameters[:, 2].min() == pytest.approx(0.1)
    Rig("multisine").start_with(displacement_exponent=0.2)


def test_a_hand_and_a_slave_with_one_seed_draw_apart() -> None:
    """Regression: tremor, readings of the hand and readings of the slave came of one stream."""
    settings = Bilateral()
    hand = SimulatedHand(settings, palpation_task(1000.0), 7)
    start = palpation_task(1000.0).path[0]
    link = UdpLink(1, "127.0.0.1", 0, "127.0.0.1", 9, Added(), 7)
    slave = SlaveSide(settings, link, start, 7)
    stream = np.random.default_rng(7)
    errors = [
        (hand.reading_mm() - start) / settings.device.position_noise_std_mm,
        (slave.step(0, SlaveModel()).position_mm - start) / settings.slave.position_noise_std_mm,
        stream.standard_normal(),
    ]
    link.close()
    assert len({round(error, 6) for error in errors}) == 3


def test_settings_that_cannot_be_are_refused_and_change_nothing() -> None:
    rig = Rig("multisine")
    before = rig.settings()
    with pytest.raises(ScenarioError, match=r"stiffness = -1.0 is not .*from 0 to 1e\+06"):
        rig.tune(amplitude=0.5, stiffness=-1.0)
    with pytest.raises(ScenarioError, match="feedback_gain"):
        rig.tune(feedback_gain=0.2)
    with pytest.raises(ScenarioError, match="speed = nan is not"):
        rig.tune(speed=float("nan"))
    assert rig.settings() == before


def test_a_loop_repeats_itself_and_never_finishes() -> None:
    scenario = dataclasses.replace(load_scenario("multisine"), at_end="loop", duration_s=10.0)
    rig = Rig(scenario)
    series = rig.run(25.0)
    assert not rig.finished
    d = series.truth.displacement_mm
    np.testing.assert_allclose(d[10000:20000], d[:10000], atol=1e-8)
    np.testing.assert_allclose(d[20000:], d[:5000], atol=1e-8)


def test_the_duration_of_a_run_is_checked() -> None:
    rig = Rig("multisine")
    assert len(rig.run(0.0)) == 0
    for wrong in (-1.0, float("nan"), float("inf")):
        with pytest.raises(ScenarioError, match="duration_s"):
            rig.run(wrong)
    with pytest.raises(ScenarioError, match="seed is -1"):
        Rig("multisine", seed=-1)


def test_warm_up_changes_nothing() -> None:
    rig, other = Rig("multisine"), Rig("multisine")
    rig.warm_up()
    assert rig.sequence == 0
    assert flat(rig.run(0.1)).tobytes() == flat(other.run(0.1)).tobytes()


def test_the_servo_keeps_its_limits_and_follows() -> None:
    scenario = load_scenario("step_hold")
    stage = dataclasses.replace(
        scenario.drive,
        dynamics="servo",
        bandwidth_hz=20.0,
        velocity_limit_mm_s=5.0,
        acceleration_limit_mm_s2=200.0,
    )
    series = Rig(dataclasses.replace(scenario, drive=stage)).run()
    v = series.slave.velocity_mm_s
    assert 4.9 < v.max() <= 5.0 + 1e-6  # the motion asks for 16.7
    assert np.abs(np.diff(v)).max() <= 200.0 * 0.001 + 1e-9
    np.testing.assert_allclose(series.slave.position_mm[895], 0.5, atol=1e-6)
    np.testing.assert_allclose(series.slave.position_mm[1795], 1.5, atol=1e-4)
    assert series.slave.position_mm.max() < 3.51  # no overshoot to speak of
    slope = np.gradient(series.slave.position_mm, 0.001)
    np.testing.assert_allclose(slope[1:-1], v[1:-1], atol=0.2)


def test_the_servo_follows_a_sine_as_its_transfer_function_says() -> None:
    scenario = load_scenario("step_hold")
    sines = (Sine(amplitude=1.0, frequency_hz=8.0),)
    motion = Waypoints(kind="waypoints", points=((0.0, 2.0),), sines=sines)
    stage = Stage(kind="stage", motion=motion, dynamics="servo", bandwidth_hz=10.0)
    series = Rig(dataclasses.replace(scenario, drive=stage)).run(3.0)
    w, s = 2.0 * math.pi * 10.0, 2j * math.pi * 8.0
    response = (2.0 * w * s + w * w) / (s + w) ** 2  # both poles at w, velocity fed forward
    expected = 2.0 + np.imag(response * np.exp(s * series.time_s))
    settled = series.time_s > 1.0
    np.testing.assert_allclose(series.slave.position_mm[settled], expected[settled], atol=1e-5)


def test_process_noise_kicks_the_velocity_as_ordered() -> None:
    scenario = load_scenario("teleoperation")
    drive = dataclasses.replace(
        scenario.drive, control="none", slave=Slave(damping=0.0, spring=0.0)
    )
    free = dataclasses.replace(scenario, drive=drive, tissue=NoTissue(kind="none"))
    kicks = np.diff(Rig(free, seed=4).run(20.0).slave.velocity_mm_s)
    # paper C: gamma with mean 0.01 and variance 0.002 in cm/s, alpha 0.05
    assert kicks.min() >= -1e-9
    assert kicks.mean() == pytest.approx(0.1, abs=5 * math.sqrt(0.2 / len(kicks)))
    assert kicks.var() == pytest.approx(0.2, rel=0.15)
