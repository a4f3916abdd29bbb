"""Simulated contacts: the motion's derivatives, the tissue's law, the events."""

from dataclasses import replace

import numpy as np
import pytest

from hc_estimator.contact.arrays import adhesive_force, hunt_crossley_force
from hc_evaluation.accuracy import catalogue, corners, rates, scan, separation, surface
from hc_evaluation.accuracy.scenarios import Motion, SimulatedContact, Tissue, simulate
from hc_evaluation.accuracy.varying_tissue import Inclusion, Surface, Way


@pytest.mark.parametrize("scenario", catalogue.TISSUES, ids=lambda s: s.name)
def test_catalogue_covers_what_was_asked_and_velocity_is_the_derivative(scenario):
    contact = simulate(replace(scenario, duration_s=2.0), 1)
    step = 1e-5
    ahead = scenario.motion.evaluate(contact.time_s + step)
    behind = scenario.motion.evaluate(contact.time_s - step)
    np.testing.assert_allclose((ahead[0] - behind[0]) / (2 * step), contact.velocity, atol=1e-4)
    np.testing.assert_allclose((ahead[1] - behind[1]) / (2 * step), contact.acceleration, atol=1e-2)
    stiffness, damping, n, p = scenario.tissue.as_array()
    assert 0.05 <= stiffness <= 5.0
    assert 1.1 <= n <= 2.3
    assert 0.8 <= p <= 1.2
    assert 0.0099 <= damping / stiffness <= 0.5
    assert 100.0 <= scenario.rate_hz <= 2000.0


def test_same_seed_same_noise_and_its_standard_deviation():
    first, again = simulate(catalogue.REFERENCE, 5), simulate(catalogue.REFERENCE, 5)
    np.testing.assert_array_equal(first.force_n, again.force_n)
    noise = first.force_n - first.force
    assert np.std(noise) == pytest.approx(0.010, rel=0.03)
    assert np.std(first.displacement_mm - first.displacement) == pytest.approx(0.002, rel=0.03)
    assert not np.array_equal(first.force_n, simulate(catalogue.REFERENCE, 6).force_n)


def test_force_is_zero_out_of_contact_and_odd_damping_in_it():
    depth = np.array([-1.0, 0.0, 2.0, 2.0])
    speed = np.array([3.0, 3.0, 3.0, -3.0])
    force = hunt_crossley_force(depth, speed, np.array([0.5, 0.1, 1.5, 1.2]))
    assert force[0] == force[1] == 0.0
    assert force[2] + force[3] == pytest.approx(2 * 0.5 * 2**1.5)
    assert force[2] - force[3] == pytest.approx(2 * 0.1 * 2**1.5 * 3**1.2)


def test_events_begin_at_their_instant():
    scenario = replace(
        catalogue.REFERENCE,
        changes=((5.0, Tissue(1.0, 0.1, 1.5, 1.0)),),
        noise_jumps=((6.0, 1.0, 4.0),),
        force_delay_s=0.02,
        force_zero_n=0.3,
        contact_position_mm=0.7,
    )
    contact = simulate(scenario, 1)
    assert contact.parameters[4999, 0] == 0.2
    assert contact.parameters[5000, 0] == 1.0
    assert contact.force_noise_std[5999] == 0.010
    assert contact.force_noise_std[6000] == 0.040
    assert np.mean(contact.displacement_mm - contact.displacement) == pytest.approx(0.7, abs=1e-3)
    assert np.mean(contact.force_n - contact.force) == pytest.approx(0.3, abs=2e-3)
    plain = simulate(replace(scenario, force_delay_s=0.0), 1)
    np.testing.assert_allclose(contact.force[100:4900], plain.force[80:4880], atol=1e-9)


def test_constant_velocity_is_a_motion():
    d, v, a = Motion(1.0, (), 2.0).evaluate(np.array([0.0, 1.5]))
    np.testing.assert_array_equal(d, [1.0, 4.0])
    np.testing.assert_array_equal(v, [2.0, 2.0])
    np.testing.assert_array_equal(a, [0.0, 0.0])


def drawn(name: str, seed: int) -> SimulatedContact:
    """A contact of a kind that an experiment draws at random."""
    if name in {kind.name for kind in scan.KINDS}:
        return scan.scanned(next(kind for kind in scan.KINDS if kind.name == name), seed)[1]
    makers = {make(1).name: make for make in surface.KINDS}
    if name in makers:
        return simulate(makers[name](seed), seed)
    return simulate(catalogue.random_scenario(seed), seed)


@pytest.mark.parametrize(
    "name",
    [
        "random",
        *(kind.name for kind in scan.KINDS),
        *(make(1).name for make in surface.KINDS),
    ],
)
def test_no_tissue_that_is_drawn_has_to_pull_and_no_two_seeds_are_alike(name):
    contacts = [drawn(name, seed) for seed in range(900, 912)]
    for contact in contacts:
        bare = adhesive_force(contact.displacement, contact.velocity, contact.parameters)
        assert np.all(bare >= 0.0)
        assert np.all(contact.force == bare)
        assert np.all(contact.displacement > 0.0)
        assert np.all(contact.parameters > 0.0)
    assert len({float(contact.parameters[0, 0]) for contact in contacts}) == len(contacts)
    again = drawn(name, 900)
    np.testing.assert_array_equal(again.force_n, contacts[0].force_n)


@pytest.mark.parametrize(
    "scenario",
    [
        *catalogue.TISSUES,
        *catalogue.CHANGES,
        *catalogue.NOISE_JUMPS,
        *catalogue.WEAK_MOTIONS,
        *catalogue.CHANNEL_FAULTS,
    ],
    ids=lambda s: s.name,
)
def test_no_scenario_of_the_accuracy_page_has_to_pull(scenario):
    contact = simulate(scenario, 1)
    bare = adhesive_force(contact.displacement, contact.velocity, contact.parameters)
    assert np.all(bare >= 0.0)


@pytest.mark.parametrize("speed", corners.DEPTHS_MM)
def test_no_press_with_corners_has_to_pull(speed):
    for corner in corners.CORNERS:
        time, displacement, _, tissue = corners.cornered_contact(speed, corner, 903)
        fastest = np.max(-np.diff(displacement)) / time[1]
        assert tissue[0] > 0.8 * tissue[1] * min(fastest, 2 * speed) ** tissue[3]


def test_scenarios_of_separation_lose_contact_as_much_as_asked():
    shares = [separation.separated_share(s) for s in separation.SEPARATIONS]
    shares += [separation.separated_share(separation.random_separation(seed)) for seed in range(5)]
    assert all(0.05 <= share <= 0.40 for share in shares)
    tapping = simulate(separation.SEPARATIONS[3], 1)
    assert 0.1 < np.mean(tapping.displacement <= 0.0) < 0.5
    assert np.all(tapping.force >= 0.0)


def test_a_scan_feels_its_inclusions_where_the_tool_is():
    way = Way(40.0, 20.0)
    time = np.array([0.0, 10.0, 20.0, 30.0, 40.0, 50.0])
    np.testing.assert_allclose(way.position(time), [0.0, 20.0, 40.0, 20.0, 0.0, 20.0], atol=1e-12)
    lump = Inclusion(20.0, 4.0, 3.0, 2.0, 0.1)
    layer = Inclusion(30.0, 1.0, 0.5, edge=True)
    scenario = replace(catalogue.REFERENCE, way=way, inclusions=(lump, layer), duration_s=40.0)
    truth = simulate(scenario, 1).parameters
    np.testing.assert_allclose(truth[10_000], [0.6, 0.016, 1.9, 1.05], rtol=1e-6)
    np.testing.assert_allclose(truth[20_000], [0.1, 0.008, 1.8, 1.05], rtol=1e-4)
    np.testing.assert_allclose(truth[10_000], truth[30_000], rtol=1e-12)
    smooth = np.abs(np.diff(np.log(truth[:, 0]), 2)) * 1e6
    assert np.max(smooth) < 60.0  # no edge is a jump


def test_a_surface_that_moves_shifts_the_depth_and_its_rate():
    moving = Surface(1.0, 0.25, 0.7, 0.05)
    scenario = replace(catalogue.REFERENCE, surface=moving, contact_position_mm=0.3)
    contact = simulate(scenario, 2)
    still = simulate(replace(catalogue.REFERENCE, contact_position_mm=0.3), 2)
    position = contact.contact_position
    np.testing.assert_allclose(contact.displacement_mm, still.displacement_mm, rtol=1e-12)
    np.testing.assert_allclose(contact.displacement + position, still.displacement + 0.3)
    rate = np.gradient(contact.displacement, contact.time_s)
    np.testing.assert_allclose(contact.velocity[1:-1], rate[1:-1], atol=5e-3)
    assert position[0] == pytest.approx(0.3)
    bare = hunt_crossley_force(contact.displacement, contact.velocity, contact.parameters)
    np.testing.assert_array_equal(contact.force, bare)


@pytest.mark.parametrize("pair", rates.RATES, ids=lambda pair: pair.name)
def test_every_reading_has_its_own_stamp_and_the_other_channel_none(pair):
    contact = rates.readings(pair, 5)
    pose, wrench = np.isfinite(contact.displacement_mm), np.isfinite(contact.force_n)
    assert np.all(pose ^ wrench)
    assert np.all(np.diff(contact.time_s) > 0.0)
    np.testing.assert_allclose(np.diff(contact.time_s[pose]), 1.0 / pair.pose)
    np.testing.assert_allclose(np.diff(contact.time_s[wrench]), 1.0 / pair.wrench)
    assert np.all(np.isinf(contact.force_noise_std) == pose)
