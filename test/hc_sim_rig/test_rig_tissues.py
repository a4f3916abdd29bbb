"""Tissues against plain formulas, and that none of them gives back more than was put in."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hc_sim_rig import Rig, Scenario
from hc_sim_rig.drives import Stage
from hc_sim_rig.motions import Sine, Waypoints
from hc_sim_rig.sensors import Sensors
from hc_sim_rig.tissues import (
    Branch,
    Change,
    HuntCrossleyTissue,
    KelvinVoigtTissue,
    Layer,
    LayeredTissue,
    NoTissue,
    Tissue,
    ViscoelasticTissue,
)

HUNT_CROSSLEY = HuntCrossleyTissue(
    kind="hunt_crossley",
    stiffness=0.3,
    damping=0.05,
    displacement_exponent=1.7,
    velocity_exponent=0.8,
)
KELVIN_VOIGT = KelvinVoigtTissue(kind="kelvin_voigt", stiffness=0.8, damping=0.1)
VISCOELASTIC = ViscoelasticTissue(
    kind="viscoelastic",
    stiffness=0.3,
    displacement_exponent=1.5,
    branches=(
        Branch(stiffness_ratio=2.0, time_constant_s=0.05),
        Branch(stiffness_ratio=0.7, time_constant_s=0.6),
    ),
)
LAYERED = LayeredTissue(
    kind="layered",
    layers=(
        Layer(start_mm=0.0, rupture_mm=2.0, peak_n=1.0),
        Layer(start_mm=1.5, rupture_mm=3.5, peak_n=1.5),
    ),
    shaft_friction_n_per_mm=0.02,
    cutting_force_n=0.2,
)
ALL = (HUNT_CROSSLEY, KELVIN_VOIGT, VISCOELASTIC, LAYERED, NoTissue(kind="none"))


def scenario_of(
    tissue: Tissue, points: tuple, sines: tuple = (), shape: str = "minimum_jerk", **more: object
) -> Scenario:
    motion = Waypoints(kind="waypoints", points=points, shape=shape, sines=sines)
    return Scenario(
        drive=Stage(kind="stage", motion=motion),
        tissue=tissue,
        duration_s=points[-1][0],
        sensors=Sensors(),
        **more,
    )


def test_hunt_crossley_with_any_exponents() -> None:
    scenario = scenario_of(HUNT_CROSSLEY, ((0.0, -1.0), (2.0, 4.0), (2.2, -1.0)))
    truth = Rig(scenario).run().truth
    d = np.maximum(truth.displacement_mm, 0.0)
    v = truth.velocity_mm_s
    expected = 0.3 * d**1.7 + 0.05 * d**1.7 * np.sign(v) * np.abs(v) ** 0.8
    assert expected.min() < -0.1  # a fast retreat, on which only a tissue that sticks would pull
    np.testing.assert_allclose(truth.force_n, np.maximum(expected, 0.0), atol=1e-9)
    sticky = dataclasses.replace(
        scenario, tissue=dataclasses.replace(HUNT_CROSSLEY, kind="adhesive")
    )
    adhesive = Rig(sticky).run().truth
    np.testing.assert_allclose(adhesive.force_n, expected, atol=1e-9)
    np.testing.assert_array_equal(adhesive.parameters, truth.parameters)


def test_units_of_length_are_converted() -> None:
    in_mm = HUNT_CROSSLEY
    in_cm = dataclasses.replace(
        HUNT_CROSSLEY, length_unit="cm", stiffness=0.3 * 10**1.7, damping=0.05 * 10 ** (1.7 + 0.8)
    )
    np.testing.assert_allclose(in_cm.values(), in_mm.values(), rtol=1e-12)


def test_kelvin_voigt_pushes_only() -> None:
    truth = Rig(scenario_of(KELVIN_VOIGT, ((0.0, -1.0), (1.0, 3.0), (1.5, -1.0)))).run().truth
    d, v = truth.displacement_mm, truth.velocity_mm_s
    expected = np.where(d > 0.0, np.maximum(0.8 * d + 0.1 * v, 0.0), 0.0)
    np.testing.assert_allclose(truth.force_n, expected, atol=1e-9)
    assert np.all(truth.parameters[:, 0] == 0.8)
    assert np.all(truth.parameters[:, 2] == 1.0)
    assert np.isnan(truth.parameters[:, [1, 3]]).all()


def test_viscoelastic_tissue_relaxes_as_its_formula_says() -> None:
    # A press of 1 ms, then a hold: each branch starts from the full stretch and lets go.
    points = ((0.0, 0.0), (0.001, 2.0), (3.0, 2.0))
    series = Rig(scenario_of(VISCOELASTIC, points, shape="linear", substeps=20)).run()
    held = series.time_s > 0.0015
    t = series.time_s[held] - 0.001
    expected = 0.3 * 2.0**1.5 * np.ones_like(t)
    for ratio, tau in ((2.0, 0.05), (0.7, 0.6)):
        first = 2.0 * (1.0 - math.exp(-0.001 / tau)) / (0.001 / tau)  # stretch after the ramp
        expected += 0.3 * ratio * (first * np.exp(-t / tau)) ** 1.5
    np.testing.assert_allclose(series.truth.force_n[held], expected, rtol=1e-6)
    assert np.isnan(series.truth.parameters).all()


def test_viscoelastic_surface_recovers_behind_the_tip() -> None:
    points = ((0.0, 0.0), (0.5, 3.0), (2.0, 3.0), (2.02, 0.5), (6.0, 0.5))
    series = Rig(scenario_of(VISCOELASTIC, points, shape="linear")).run()
    force = series.truth.force_n
    assert np.all(force >= 0.0)
    left = (series.time_s > 2.02) & (series.time_s < 2.05)
    assert np.all(force[left] == 0.0)  # the tip is below zero depth's surface, yet alone
    assert not series.truth.contact[left].any()
    assert force[-1] == pytest.approx(0.3 * 0.5**1.5, rel=0.05)  # it came back to the tip
    back = force[series.time_s > 2.05]
    assert np.abs(np.diff(back)).max() < 0.02  # and did so softly


def test_the_needle_feels_its_ruptures_where_the_paper_has_them() -> None:
    series = Rig("needle_insertion").run()
    d, force = series.truth.displacement_mm, series.truth.force_n
    for depth in (20.0, 29.0, 32.0, 36.0):
        near = np.abs(d - depth) < 1.0
        peak = d[near][np.argmax(force[near])]
        assert abs(peak - depth) < 0.1
        assert 1.0 < force[near].max() < 3.0
        behind = (d > depth + 0.4) & (d < depth + 0.5)
        assert force[behind].mean() < force[near].max() - 0.5
    assert np.isnan(series.truth.parameters).all()


def test_ruptured_layers_stay_ruptured_until_a_new_specimen() -> None:
    there_and_back = ((0.0, -1.0), (2.0, 4.5), (4.0, -1.0), (6.0, 4.5), (8.0, -1.0))
    scenario = scenario_of(LAYERED, there_and_back)
    force = Rig(scenario).run().truth.force_n
    assert force[:2000].max() > 1.5
    assert force[4000:6000].max() < 0.6  # friction and cutting only
    looped = dataclasses.replace(
        scenario_of(LAYERED, there_and_back[:3]), at_end="loop", duration_s=4.0
    )
    force = Rig(looped).run(8.0).truth.force_n
    assert force[4000:6000].max() == pytest.approx(force[:2000].max(), rel=1e-6)


def test_the_inclusion_is_a_bell_of_stiffness() -> None:
    series = Rig("palpation_scan").run(20.0)
    bell = np.exp(-0.5 * ((series.lateral_mm - 20.0) / 4.0) ** 2)
    np.testing.assert_allclose(series.truth.parameters[:, 0], 0.2 * (1 + 2 * bell), rtol=1e-12)
    np.testing.assert_allclose(series.truth.parameters[:, 1], 0.008 * (1 + bell), rtol=1e-12)
    assert series.truth.parameters[:, 0].max() == pytest.approx(0.6, rel=1e-6)


def test_changes_step_drift_and_go_back() -> None:
    truth = Rig("tissue_change").run().truth
    K, B, n, p = truth.parameters.T
    assert np.all(K[:10000] == 0.2)
    np.testing.assert_allclose(K[10000:20000], 0.4)
    np.testing.assert_allclose(n[10000:20000], 1.6)
    np.testing.assert_allclose(B[10000:20000], 0.012)
    ramp = 0.4 + (0.24 - 0.4) * np.arange(10000) / 10000.0
    np.testing.assert_allclose(K[20000:30000], ramp, rtol=1e-9)
    np.testing.assert_allclose(n[30000:40000], 1.8)
    np.testing.assert_allclose(np.c_[K, B, n, p][40000:], [[0.2, 0.008, 1.8, 1.05]] * 10000)


def test_changes_apply_to_what_was_set_while_it_runs() -> None:
    tissue = dataclasses.replace(HUNT_CROSSLEY, changes=(Change(time_s=1.0, stiffness_factor=2.0),))
    rig = Rig(scenario_of(tissue, ((0.0, 1.0), (9.0, 1.0))))
    rig.tune(stiffness=0.5)
    assert rig.run(0.9).truth.parameters[-1, 0] == pytest.approx(0.5, rel=1e-3)
    assert rig.run(1.0).truth.parameters[-1, 0] == pytest.approx(1.0, rel=1e-6)


@settings(max_examples=60)
@given(
    tissue=st.sampled_from(ALL),
    depths=st.lists(st.floats(-2.0, 5.0), min_size=2, max_size=6),
    pause=st.floats(0.02, 0.8),
    wave=st.tuples(st.floats(0.0, 1.0), st.floats(0.5, 20.0)),
)
def test_no_tissue_gives_back_more_than_was_put_in(
    tissue: Tissue, depths: list[float], pause: float, wave: tuple[float, float]
) -> None:
    points = [(0.0, -4.0)]
    for depth in depths:
        points.append((points[-1][0] + pause, depth))
    points.append((points[-1][0] + pause, -4.0))
    sines = (Sine(amplitude=wave[0], frequency_hz=wave[1]),)
    scenario = scenario_of(tissue, tuple(points), sines, rate_hz=4000.0)
    truth = Rig(scenario).run().truth
    d, force = truth.displacement_mm, truth.force_n
    work = np.concatenate([[0.0], np.cumsum(0.5 * (force[1:] + force[:-1]) * np.diff(d))])
    # Error of the trapezium at jumps of the force (contact with damping, ruptures): half a jump
    # times a sample's way.
    slack = 1e-9 + np.sum(np.abs(np.diff(force)) * np.abs(np.diff(d))) * 0.5
    assert work[-1] >= -min(slack, 0.02 * work.max() + 1e-9)
    assert np.isfinite(force).all()
