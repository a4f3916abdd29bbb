"""Contact laws: values, physical guards, derivatives; and the state spaces' Jacobians."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hc_estimator as hc
from hc_estimator.contact import (
    adhesive_force,
    elastic_power_law_force,
    hunt_crossley_force,
    kelvin_boltzmann_force,
    kelvin_voigt_force,
)
from hc_estimator.contact import registry as contact_registry
from hc_estimator.estimator import MEMORY
from hc_estimator.state_space import registry as state_space_registry

ANY = st.floats(-1e12, 1e12)


def plain_force(model, d, v, K, B, n, p):
    """The laws for d > 0 and v > 0, in arithmetic that complex numbers understand."""
    if model == contact_registry.KELVIN_VOIGT:
        return K * d + B * v
    if model == contact_registry.KELVIN_BOLTZMANN:
        return K * d + B * p  # p is the lagged velocity here
    if model == contact_registry.ELASTIC_POWER_LAW:
        return K * d**n
    return K * d**n + B * d**n * v**p


def complex_step(function, x):
    """Derivative of a real-analytic function by the complex step: exact to rounding."""
    x = np.asarray(x, complex)
    columns = []
    for i in range(x.size):
        moved = x.copy()
        moved[i] += 1e-30j
        columns.append(np.imag(function(moved)) / 1e-30)
    return np.array(columns)


def test_hunt_crossley_values():
    assert hunt_crossley_force(2.0, 3.0, 0.2, 0.05, 1.8, 1.05) == pytest.approx(
        2**1.8 * (0.2 + 0.05 * 3**1.05), rel=1e-14
    )
    assert hunt_crossley_force(2.0, -3.0, 0.2, 0.05, 1.8, 1.05) == pytest.approx(
        2**1.8 * (0.2 - 0.05 * 3**1.05), rel=1e-14
    )
    assert adhesive_force(2.0, -9.0, 0.2, 0.05, 1.8, 1.05) == pytest.approx(
        2**1.8 * (0.2 - 0.05 * 9**1.05), rel=1e-14
    )
    assert hunt_crossley_force(2.0, 0.0, 0.2, 0.05, 1.8, 0.5) == pytest.approx(0.2 * 2**1.8)


def test_tissue_does_not_pull_unless_it_sticks():
    """Between leaving contact at d <= 0 and this, a tool can be in the tissue without force."""
    fast = (2.0, -9.0, 0.2, 0.05, 1.8, 1.05)  # K - B 9^p < 0
    assert hunt_crossley_force(*fast) == 0.0
    gradient = np.ones(6)
    for model, name in enumerate(hc.available_contact_models()):
        force = contact_registry.contact_force(model, *fast)
        assert (force < 0.0) == (name == "adhesive")
        if name == "hunt_crossley":
            contact_registry.contact_gradient(model, *fast, gradient)
            assert not gradient.any()


def test_other_laws():
    assert kelvin_voigt_force(2.0, -3.0, 0.5, 0.1) == pytest.approx(0.7)
    assert kelvin_boltzmann_force(2.0, 4.0, 0.5, 0.1) == pytest.approx(1.4)
    assert elastic_power_law_force(4.0, 0.5, 1.5) == pytest.approx(4.0)


@pytest.mark.parametrize("model", range(len(hc.available_contact_models())))
def test_no_force_without_penetration(model):
    for d in (0.0, -1e-300, -5.0, -1e300):
        assert contact_registry.contact_force(model, d, 50.0, 1.0, 1.0, 1.5, 1.0) == 0.0
        gradient = np.ones(6)
        contact_registry.contact_gradient(model, d, 50.0, 1.0, 1.0, 1.5, 1.0, gradient)
        assert not gradient.any()


@given(ANY, ANY, ANY, ANY, ANY, ANY)
@settings(max_examples=300)
def test_finite_readings_give_finite_forces(d, v, K, B, n, p):
    for model in range(len(hc.available_contact_models())):
        assert math.isfinite(contact_registry.contact_force(model, d, v, K, B, n, p))
    assert math.isfinite(hunt_crossley_force(d, v, K, B, n, p))


@pytest.mark.parametrize("model", range(len(hc.available_contact_models())))
def test_gradient_equals_the_complex_step(model):
    rng = np.random.default_rng(2)
    for _ in range(200):
        x = rng.uniform([0.01, 0.01, 0.01, 0.001, 0.6, 0.3], [20, 200, 10, 2, 3.5, 2.5])
        gradient = np.empty(6)
        contact_registry.contact_gradient(model, *x, gradient)
        expected = complex_step(lambda y: plain_force(model, *y), x)
        np.testing.assert_allclose(gradient, expected, rtol=1e-11, atol=1e-13)


def test_gradient_in_retraction_at_rest_and_beyond_the_limits():
    forth, back = np.empty(6), np.empty(6)
    contact_registry.contact_gradient(0, 2.0, 3.0, 0.2, 0.05, 1.8, 1.05, forth)
    contact_registry.contact_gradient(0, 2.0, -3.0, 0.2, 0.05, 1.8, 1.05, back)
    np.testing.assert_allclose(back[[1, 2]], forth[[1, 2]])  # even in v
    np.testing.assert_allclose(back[[3, 5]], -forth[[3, 5]])  # odd in v
    contact_registry.contact_gradient(0, 2.0, 0.0, 0.2, 0.05, 1.8, 0.5, back)
    assert np.isfinite(back).all()
    contact_registry.contact_gradient(0, 2.0, 3.0, 0.2, 0.05, 9.0, 9.0, back)
    assert back[4] == 0.0
    assert back[5] == 0.0


def records(state_space, contact_model):
    estimator = hc.create_estimator("ekf", state_space=state_space, contact_model=contact_model)
    return estimator._settings[0], np.zeros(1, MEMORY)[0]


@pytest.mark.parametrize("contact_model", hc.available_contact_models())
def test_jacobians_of_the_state_spaces_equal_the_complex_step(contact_model):
    model = hc.available_contact_models().index(contact_model)
    lagged = contact_model == "kelvin_boltzmann"
    dt = 0.002
    share = 1 - math.exp(-dt / 1.0) if lagged else 0.0

    def kinematic_measurement(x):
        return plain_force(model, x[0], x[1], np.exp(x[3]), np.exp(x[4]), x[5], x[6])

    def paper_process(x):
        force = plain_force(model, x[0], x[1], *x[3:])
        last = x[6] + share * (x[1] - x[6])
        return np.array([x[0] + dt * x[1], x[1], force, x[3], x[4], x[5], last])

    x = np.array([2.3, 14.0, 55.0, -1.2, -3.4, 1.7, 1.1])
    record, _ = records("kinematic", contact_model)
    jacobian = np.empty((2, 7))
    state_space_registry.measurement_jacobian(record, x, np.empty(6), jacobian)
    np.testing.assert_allclose(jacobian[0], [1, 0, 0, 0, 0, 0, 0])
    np.testing.assert_allclose(jacobian[1], complex_step(kinematic_measurement, x), rtol=1e-12)

    x = np.array([2.3, 14.0, 0.7, 0.3, 0.04, 1.7, 1.1])
    record, _ = records("paper", contact_model)
    jacobian = np.empty((7, 7))
    state_space_registry.process_jacobian(record, dt, x, np.empty(6), jacobian)
    np.testing.assert_allclose(jacobian, complex_step(paper_process, x).T, rtol=1e-11, atol=1e-15)


@pytest.mark.parametrize("state_space", ["kinematic", "paper"])
@pytest.mark.parametrize(
    ("contact_model", "expected"),
    [
        ("kelvin_voigt", (0.6, 0.04, 1, 1)),
        ("kelvin_boltzmann", (0.6, 0.04, 1, 1)),
        ("elastic_power_law", (0.6, 0, 1.6, 1)),
    ],
)
def test_other_models_find_their_parameters(contact_model, expected, state_space):
    """Each law's own simulated recording, with a lag of 0.3 s where the law relaxes."""
    rng = np.random.default_rng(3)
    dt, tau = 1e-3, 0.3
    time = np.arange(4000) * dt
    d = 3 + 1.2 * np.sin(5 * time) + 0.4 * np.sin(14 * time)
    v = 6 * np.cos(5 * time) + 5.6 * np.cos(14 * time)
    K, B, n, _ = expected
    if contact_model == "kelvin_boltzmann":
        lagged = np.zeros_like(v)
        for k in range(1, v.size):
            lagged[k] = lagged[k - 1] + (1 - math.exp(-dt / tau)) * (v[k - 1] - lagged[k - 1])
        force, options = K * d + B * lagged, {"relaxation_time": tau}
    else:
        force = K * d + B * v if contact_model == "kelvin_voigt" else K * d**n
        options = {}
    estimator = hc.create_estimator(
        "ukf",
        state_space=state_space,
        contact_model=contact_model,
        noise_adaptation="fixed",
        change_detection="none",
        displacement_noise_std=0.002,
        force_noise_std=0.01,
        **options,
    )
    series = estimator.run(
        time,
        d + 0.002 * rng.standard_normal(time.size),
        force + 0.01 * rng.standard_normal(time.size),
    )
    found = series.parameters[-1]
    np.testing.assert_allclose(found, expected, rtol=0.06)
    held = [i for i in range(4) if expected[i] in (0, 1)]
    assert not series.covariance[:, held].any()
    assert not series.identifiability[:, held].any()
    assert series.force_reconstructed[-1] == pytest.approx(force[-1], abs=0.03)
