"""The state space's functions for all particles at once, against those for one state."""

import numpy as np
import pytest

import hc_estimator as hc
from hc_estimator.contact.registry import CONTACT_MODELS
from hc_estimator.filters import particle_models
from hc_estimator.state_space import registry as state_space
from hc_estimator.state_space.registry import STATE_SPACES


def particles(rng, space, count=400):
    """States in contact and out of it, at rest, with exponents beyond their range."""
    planes = np.empty((7, count))
    planes[0] = rng.choice([0.0, -1.0, 1e-12, 1.0], count) * rng.uniform(0, 4, count)
    planes[1] = rng.choice([0.0, 1.0, 1e-9], count) * rng.normal(0, 20, count)
    planes[2] = rng.normal(0, 100, count)
    planes[3:5] = rng.normal(-2, 3, (2, count))
    planes[5] = rng.uniform(0.2, 4.5, count)
    planes[6] = rng.uniform(0.0, 3.5, count)
    if space == "paper":
        planes[3:5] = np.exp(planes[3:5]) * rng.choice([1.0, -1.0], (2, count), p=[0.9, 0.1])
    planes[3, :2], planes[0, 2], planes[1, 3] = (60.0, -70.0), 1e200, 1e250
    return planes


@pytest.fixture
def estimator(request):
    """A `sir_pf` whose settings and memory the functions read."""
    space, model = request.param
    estimator = hc.create_estimator("sir_pf", state_space=space, contact_model=model)
    estimator._memory["elapsed"] = 0.002
    return estimator


EVERY = pytest.mark.parametrize(
    "estimator", [(s, m) for s in STATE_SPACES for m in CONTACT_MODELS], indirect=True
)


@EVERY
def test_forces_are_those_of_the_measurement_function(estimator):
    settings, memory = estimator._settings[0], estimator._memory[0]
    planes = particles(np.random.default_rng(1), estimator.state_space)
    forces = np.empty(planes.shape[1])
    particle_models.measure(settings, memory, planes, forces)
    expected, reading = np.empty_like(forces), np.empty(2)
    for k, state in enumerate(planes.T.copy()):
        state_space.measure(settings, state, reading)
        expected[k] = reading[1]
    np.testing.assert_allclose(forces, expected, rtol=1e-12, atol=1e-12)
    assert (expected != 0.0).sum() > 100


@EVERY
def test_moved_particles_are_those_of_the_process_function(estimator):
    settings, memory = estimator._settings[0], estimator._memory[0]
    planes = particles(np.random.default_rng(2), estimator.state_space)
    moved, state = np.empty_like(planes), np.empty(7)
    particle_models.process(settings, memory, planes, moved)
    for k, before in enumerate(planes.T.copy()):
        state_space.process(settings, memory["elapsed"], before, state)
        np.testing.assert_allclose(moved[:, k], state, rtol=1e-12, atol=1e-12)


@EVERY
def test_limits_are_those_of_one_state(estimator):
    settings = estimator._settings[0]
    planes = particles(np.random.default_rng(3), estimator.state_space)
    expected = planes.T.copy()
    for state in expected:
        state_space.constrain(settings, state)
    particle_models.constrain(settings, planes)
    np.testing.assert_array_equal(planes, expected.T)


def test_a_particle_that_is_no_number_does_not_hide():
    estimator = hc.create_estimator("sir_pf")
    planes = particles(np.random.default_rng(4), "kinematic")
    planes[3, 0], planes[0, 0] = np.nan, 1.0
    forces = np.empty(planes.shape[1])
    particle_models.measure(estimator._settings[0], estimator._memory[0], planes, forces)
    assert np.isnan(forces[0])
    assert np.isfinite(forces[1:]).all()
