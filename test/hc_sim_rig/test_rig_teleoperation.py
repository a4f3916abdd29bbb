"""Master and slave of paper C: equations, stability, integration error, energy, signals."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hc_sim_rig import Rig, RigDivergedError, RigSeries, Scenario, ScenarioError, load_scenario
from hc_sim_rig.drives import (
    Channel,
    ForceOperator,
    Link,
    Master,
    MotionOperator,
    ProcessNoise,
    Readings,
    Signals,
    Slave,
)
from hc_sim_rig.motions import Waypoints
from hc_sim_rig.sensors import DisplacementSensor, ForceSensor, Sensors
from hc_sim_rig.tissues import HuntCrossleyTissue, NoTissue


def paper_c(force_n: float, delay_s: float = 0.125, **drive: Any) -> Scenario:
    """Paper C with tables I and II, without process noise, operator's force as a fast ramp."""
    scenario = load_scenario("teleoperation")
    profile = Waypoints(kind="waypoints", points=((0.0, 0.0), (0.2, force_n)), shape="minimum_jerk")
    link = Link(delay_s=delay_s)
    settings = {
        "operator": ForceOperator(kind="force", profile=profile),
        "channel": Channel(forward=link, backward=link),
        "process_noise": ProcessNoise(),
        **drive,
    }
    return dataclasses.replace(scenario, drive=dataclasses.replace(scenario.drive, **settings))


def swing(series: RigSeries, start_s: float, end_s: float) -> float:
    force = series.truth.force_n[(series.time_s >= start_s) & (series.time_s < end_s)]
    return float(np.ptp(force))


def test_two_newtons_are_stable_and_meet_the_tissue_after_two_seconds() -> None:
    series = Rig(paper_c(2.0)).run(30.0)
    first = series.time_s[np.argmax(series.truth.contact)]
    assert 1.8 < first < 2.0  # paper C, section V: "at time about 2 sec"
    assert swing(series, 20.0, 30.0) < 1e-4
    assert series.truth.force_n[-1] == pytest.approx(1.817, abs=0.01)


def test_six_newtons_are_a_limit_cycle() -> None:
    series = Rig(paper_c(6.0)).run(40.0)
    early, late = swing(series, 10.0, 20.0), swing(series, 30.0, 40.0)
    assert early > 20.0
    assert late == pytest.approx(early, rel=0.01)  # neither decays nor grows


def test_four_newtons_look_stable_for_ten_seconds_and_are_not() -> None:
    series = Rig(paper_c(4.0)).run(60.0)
    assert swing(series, 6.0, 10.0) < 0.1
    assert swing(series, 50.0, 60.0) > 15.0
    assert swing(Rig(paper_c(3.5)).run(60.0), 50.0, 60.0) < 1e-3


def test_without_contact_force_in_eq_13_thirteen_newtons_are_stable() -> None:
    readings = Readings(eq13_adds_contact_force=False)
    series = Rig(paper_c(13.0, readings=readings)).run(40.0)
    assert swing(series, 30.0, 40.0) < 0.05
    assert series.truth.force_n[-1] > 40.0
    assert swing(Rig(paper_c(13.0)).run(40.0), 30.0, 40.0) > 100.0


def test_without_feedback_or_delay_four_newtons_are_stable() -> None:
    assert swing(Rig(paper_c(4.0, delay_s=0.0)).run(40.0), 30.0, 40.0) < 1e-3
    assert swing(Rig(paper_c(4.0, feedback_gain=0.0)).run(40.0), 30.0, 40.0) < 1e-3
    none = Signals(feedback_force="none")
    assert swing(Rig(paper_c(4.0, signals=none)).run(40.0), 30.0, 40.0) < 1e-3


def test_the_delayed_loop_chatters_with_nine_newtons_and_no_delay() -> None:
    assert swing(Rig(paper_c(9.0, delay_s=0.0)).run(40.0), 30.0, 40.0) > 50.0


def test_a_loop_that_runs_away_is_reported_in_one_line() -> None:
    scenario = paper_c(6.0)
    tissue = dataclasses.replace(scenario.tissue, kind="adhesive")
    with pytest.raises(RigDivergedError, match=r"teleoperation has run away before \d") as caught:
        Rig(dataclasses.replace(scenario, tissue=tissue)).run(40.0)
    assert "\n" not in str(caught.value)


def test_the_equations_are_those_of_the_paper() -> None:
    """The closed loop in cm, written anew from the paper, by another integrator."""
    T, force_h = 0.001, 3.0
    jm, bm, km, jd, bd, kd = 0.05, 0.03, 0.1, 0.2, 4.0, 2.0
    ms, bs, ks, md, bds, kds = 0.07, 0.05, 0.08, 1.0, 15.0, 50.0
    delay = 40

    def contact(x: float, v: float) -> float:
        return max(0.0, (2 + 3 * v) * (x - 1.5) ** 1.7) if x > 1.5 else 0.0

    profile = Waypoints(kind="waypoints", points=((0.0, force_h),))
    link = Link(delay_s=delay * T)
    scenario = paper_c(0.0)
    drive = dataclasses.replace(
        scenario.drive,
        operator=ForceOperator(kind="force", profile=profile),
        channel=Channel(forward=link, backward=link),
    )
    count = 1800
    series = Rig(dataclasses.replace(scenario, drive=drive)).run(count * T)
    y = np.zeros(4)  # theta, omega, x, v
    sent, felt, path = [], [], []
    for k in range(count):
        path.append(y.copy())
        sent.append(math.pi * y[0])
        felt.append(contact(y[2], y[3]))
        xm = sent[k - delay] if k >= delay else 0.0
        fe = felt[k - delay] if k >= delay else 0.0
        us = felt[k] + 300 * ms / md * (xm - y[2])
        us += (ks - ms / md * kds) * y[2] + (bs - ms / md * bds) * y[3]
        um = -force_h + jm / jd * (force_h - 0.1 * fe)
        um += (km - jm / jd * kd) * y[0] + (bm - jm / jd * bd) * y[1]

        def rates(_t: float, y: np.ndarray, um: float = um, us: float = us) -> list[float]:
            return [
                y[1],
                (um + force_h - bm * y[1] - km * y[0]) / jm,
                y[3],
                (us - contact(y[2], y[3]) - bs * y[3] - ks * y[2]) / ms,
            ]

        y = solve_ivp(rates, (0.0, T), y, method="RK45", rtol=1e-8, atol=1e-10).y[:, -1]
    path_array = np.array(path)
    assert series.truth.contact.sum() > 300
    np.testing.assert_allclose(series.slave.position_mm / 10.0, path_array[:, 2], atol=1e-6)
    np.testing.assert_allclose(series.slave.velocity_mm_s / 10.0, path_array[:, 3], atol=1e-5)
    np.testing.assert_allclose(
        series.master.position_mm / 10.0 / math.pi, path_array[:, 0], atol=1e-7
    )


def test_droop_and_prefilter() -> None:
    free = dataclasses.replace(paper_c(2.0), tissue=NoTissue(kind="none"))
    series = Rig(free).run(20.0)
    assert series.master.position_mm[-1] == pytest.approx(10 * math.pi, rel=1e-3)
    assert series.slave.position_mm[-1] / series.master.position_mm[-1] == pytest.approx(
        300 / 350, rel=1e-3
    )
    drive = dataclasses.replace(free.drive, readings=Readings(tracking_prefilter=True))
    series = Rig(dataclasses.replace(free, drive=drive)).run(20.0)
    assert series.slave.position_mm[-1] == pytest.approx(series.master.position_mm[-1], rel=1e-3)


@pytest.mark.parametrize(
    "reading", ["eq12_subtracts_surface", "eq13_adds_contact_force", "eq18_force_opposes_slave"]
)
def test_every_misprint_can_be_switched_and_matters(reading: str) -> None:
    kwargs = {reading: not getattr(Readings(), reading)}
    usual = Rig(paper_c(2.0)).run(4.0)
    try:
        other = Rig(paper_c(2.0, readings=Readings(**kwargs))).run(4.0)
    except RigDivergedError:
        assert reading == "eq18_force_opposes_slave"  # a force that pulls in must run away
        return
    assert np.abs(other.slave.position_mm - usual.slave.position_mm).max() > 0.2
    if reading == "eq12_subtracts_surface":
        moved = other.slave.position_mm > 1e-9
        assert other.truth.contact[moved].all()  # penetration is the slave's whole position


@pytest.mark.parametrize("name", ["teleoperation", "silicone_indentation", "relaxation"])
def test_the_integration_error_is_far_below_the_sensors_noise(name: str) -> None:
    scenario = load_scenario(name)
    truth = Rig(scenario).run(10.0).truth
    halved = Rig(dataclasses.replace(scenario, substeps=2 * scenario.substeps)).run(10.0).truth
    position_error = np.abs(truth.displacement_mm - halved.displacement_mm).max()
    force_error = np.abs(truth.force_n - halved.force_n).max()
    assert position_error < 0.01 * max(scenario.sensors.displacement.noise_std_mm, 1e-4)
    assert force_error < 0.01 * max(scenario.sensors.force.noise_std_n, 1e-3)


def test_halving_the_step_shows_fourth_order() -> None:
    scenario = dataclasses.replace(
        paper_c(2.0, control="none", slave=Slave(start=1.0)), rate_hz=20.0, duration_s=4.0
    )
    scenario = dataclasses.replace(scenario, tissue=NoTissue(kind="none"))
    exact = Rig(dataclasses.replace(scenario, substeps=256)).run(4.0).slave.position_mm
    errors = [
        np.abs(
            Rig(dataclasses.replace(scenario, substeps=n)).run(4.0).slave.position_mm - exact
        ).max()
        for n in (1, 2, 4)
    ]
    assert 12.0 < errors[0] / errors[1] < 20.0
    assert 12.0 < errors[1] / errors[2] < 20.0


@pytest.mark.parametrize("damping", [0.0, 0.0005, 0.05])
def test_the_passive_parts_never_create_energy(damping: float) -> None:
    """No controller, no operator: slave thrown at the tissue, master swinging."""
    tissue = HuntCrossleyTissue(
        kind="hunt_crossley",
        stiffness=0.05,
        damping=damping,
        displacement_exponent=1.7,
        surface_mm=0.0,
    )
    scenario = paper_c(
        0.0,
        control="none",
        slave=Slave(start=-3.0, damping=0.0, spring=0.5),
        master=Master(start_rad=1.0, damping=0.0),
    )
    scenario = dataclasses.replace(scenario, tissue=tissue, substeps=4)
    series = Rig(scenario).run(20.0)
    x, v = series.slave.position_mm, series.slave.velocity_mm_s
    elastic = 0.05 * np.maximum(x, 0.0) ** 2.7 / 2.7
    energy = 0.5 * 0.007 * v**2 + 0.5 * 0.05 * x**2 + elastic
    assert np.diff(energy).max() < 1e-9 * energy[0]
    if damping == 0.0:
        np.testing.assert_allclose(energy, energy[0], rtol=1e-6)
    else:
        assert energy[-1] < 0.9 * energy[0]
    theta = series.master.position_mm / (10 * math.pi)
    omega = series.master.velocity_mm_s / (10 * math.pi)
    swinging = 0.5 * 0.05 * omega**2 + 0.5 * 0.1 * theta**2
    np.testing.assert_allclose(swinging, swinging[0], rtol=1e-9)
    assert series.truth.contact.any()


def test_an_operator_with_a_motion_in_mind_is_followed() -> None:
    profile = Waypoints(kind="waypoints", points=((0.0, 0.0), (3.0, 20.0)), shape="minimum_jerk")
    operator = MotionOperator(
        kind="motion", profile=profile, hand_stiffness_n_per_mm=2.0, hand_damping_n_s_per_mm=0.1
    )
    series = Rig(paper_c(0.0, operator=operator)).run(10.0)
    # the hand's spring against the master's own (k_dm through k_x) and the reflected force
    assert 18.0 < series.master.position_mm[-1] < 20.0
    force = series.coupling.operator_force_n
    expected = 2.0 * (20.0 - series.master.position_mm[-1])
    assert force[-1] == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("choice", ["sensor", "filtered"])
def test_controllers_can_use_what_the_sensors_say(choice: str) -> None:
    signals = Signals(feedback_force=choice, compensation_force=choice, slave_motion=choice)
    scenario = dataclasses.replace(
        paper_c(2.0, signals=signals),
        sensors=Sensors(
            displacement=DisplacementSensor(noise_std_mm=0.002),
            force=ForceSensor(noise_std_n=0.02),
        ),
    )
    series = Rig(scenario).run(10.0)
    assert series.truth.force_n[-1] == pytest.approx(1.82, abs=0.1)
    late = series.coupling.feedback_force_n[125:]
    if choice == "sensor":
        np.testing.assert_array_equal(late, series.force_n[:-125])
    else:
        share = 1.0 - math.exp(-2.0 * math.pi * 30.0 * 0.001)
        smooth, value = [], series.force_n[0]
        for reading in series.force_n:
            value += share * (reading - value)
            smooth.append(value)
        np.testing.assert_allclose(late, smooth[:-125], atol=1e-12)


def test_the_estimator_can_be_in_the_loop() -> None:
    signals = Signals(feedback_force="estimated", estimator={"filter": "ukf"})
    scenario = dataclasses.replace(
        paper_c(2.0, signals=signals),
        sensors=Sensors(
            displacement=DisplacementSensor(noise_std_mm=0.002),
            force=ForceSensor(noise_std_n=0.02),
        ),
    )
    rig = Rig(scenario)
    series = rig.run(6.0)
    # contact begins at 1.9 s, and the motion in it is slow: the filter needs two seconds of it
    fed, true = series.coupling.feedback_force_n[4500:], series.truth.force_n[4500 - 126 : -126]
    assert not np.array_equal(fed, true)
    assert np.abs(fed - true).max() < 0.1
    rig.reset()
    assert np.array_equal(rig.run(6.0).force_n, series.force_n)


def test_an_estimator_that_does_not_exist_is_named() -> None:
    signals = Signals(feedback_force="estimated", estimator={"filter": "oracle"})
    with pytest.raises(ScenarioError, match=r"drive\.signals\.estimator.*oracle"):
        Rig(paper_c(2.0, signals=signals))


def test_two_halves_are_the_whole() -> None:
    """Master and slave as rigs of their own, joined by a plain delay, repeat the simulated loop."""
    delay, count = 40, 3000
    scenario = paper_c(2.0, delay_s=delay / 1000.0)
    whole = Rig(scenario).run(count / 1000.0)
    master, slave = Rig(scenario, side="master"), Rig(scenario, side="slave")
    positions, forces = [], []
    for k in range(count):
        if k >= delay:
            slave.receive(positions[k - delay])
            master.receive(forces[k - delay])
        positions.append(master.step().master.position_mm)
        sample = slave.step()
        forces.append(sample.coupling.sent_force_n)
        assert sample.displacement_mm == whole.displacement_mm[k]
        assert sample.force_n == whole.force_n[k]
    assert positions == whole.master.position_mm.tolist()
    assert whole.truth.contact.any()


def test_only_a_teleoperation_has_sides() -> None:
    with pytest.raises(ScenarioError, match="no master and slave"):
        Rig("multisine", side="slave")
    with pytest.raises(ScenarioError, match=r"side is 'left'.*master"):
        Rig("teleoperation", side="left")
