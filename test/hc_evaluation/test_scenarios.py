"""Simulated contacts: the motion's derivatives, the tissue's law, the events."""

from dataclasses import replace

import numpy as np
import pytest

from hc_evaluation.accuracy import catalogue
from hc_evaluation.accuracy.scenarios import Motion, Tissue, simulate
from hc_evaluation.contact_law import hunt_crossley_force


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
