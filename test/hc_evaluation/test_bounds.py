"""The posterior Cramer-Rao bound against independent computations."""

import numpy as np
import pytest

from hc_estimator.contact.arrays import separated
from hc_evaluation.bounds import posterior_cramer_rao_bound

PARAMETERS = np.array([0.4, 0.05, 1.7, 1.1])


def force(state, adhesive=False):
    d, v, _, log_k, log_b, n, p = state
    law = d**n * (np.exp(log_k) + np.exp(log_b) * np.sign(v) * abs(v) ** p)
    return law if adhesive else max(law, 0.0)


def motion(count=120, dt=0.004):
    time = np.arange(count) * dt
    return time, 2.5 + 1.2 * np.sin(7.0 * time), 8.4 * np.cos(7.0 * time)


@pytest.mark.parametrize("adhesive", [False, True])
def test_equals_the_plain_information_recursion_with_numerical_derivatives(adhesive):
    """Tichavsky et al., Eq. 21, in information form, Jacobians by central differences."""
    time, d, v = motion()
    dt = time[1]
    q, walk = 3e4, np.array([1e-3, 2e-3, 5e-4, 3e-4])
    prior = np.diag([0.5, 80.0, 900.0, 0.6, 0.7, 0.2, 0.02])
    found = posterior_cramer_rao_bound(
        time,
        d,
        v,
        np.tile(PARAMETERS, (time.size, 1)),
        displacement_noise_std=0.01,
        force_noise_std=0.05,
        jerk_density=q,
        parameter_density=walk,
        initial_covariance=prior,
        adhesive=adhesive,
    )
    transition = np.eye(7)
    transition[0, 1] = transition[1, 2] = dt
    transition[0, 2] = dt**2 / 2
    noise = np.zeros((7, 7))
    noise[:3, :3] = q * np.array(
        [
            [dt**5 / 20, dt**4 / 8, dt**3 / 6],
            [dt**4 / 8, dt**3 / 3, dt**2 / 2],
            [dt**3 / 6, dt**2 / 2, dt],
        ]
    )
    noise[3:, 3:] = np.diag(walk * dt)
    covariance = prior
    logs = np.concatenate((np.log(PARAMETERS[:2]), PARAMETERS[2:]))
    for k in range(time.size):
        if k:
            covariance = transition @ covariance @ transition.T + noise
        state = np.concatenate(([d[k], v[k], 0.0], logs))
        rows = np.zeros((2, 7))
        rows[0, 0] = 1.0
        for i in range(7):
            step = np.zeros(7)
            step[i] = 1e-6
            rows[1, i] = (force(state + step, adhesive) - force(state - step, adhesive)) / 2e-6
        information = np.linalg.inv(covariance) + rows.T @ np.diag([1e4, 400.0]) @ rows
        covariance = np.linalg.inv(information)
        np.testing.assert_allclose(found[k], covariance[3:, 3:], rtol=2e-4, atol=1e-9)


def test_with_known_motion_it_is_the_inverse_fisher_information_of_the_parameters():
    time, d, v = motion()
    logs = np.concatenate((np.log(PARAMETERS[:2]), PARAMETERS[2:]))
    fisher = np.zeros((4, 4))
    for k in range(time.size):
        gradient = np.zeros(4)
        for i in range(4):
            step = np.zeros(7)
            step[3 + i] = 1e-6
            state = np.concatenate(([d[k], v[k], 0.0], logs))
            gradient[i] = (force(state + step) - force(state - step)) / 2e-6
        fisher += np.outer(gradient, gradient) / 0.05**2
    found = posterior_cramer_rao_bound(
        time,
        d,
        v,
        np.tile(PARAMETERS, (time.size, 1)),
        displacement_noise_std=1e-9,
        force_noise_std=0.05,
        jerk_density=1e-9,
        parameter_density=np.zeros(4),
        initial_covariance=np.diag([1e-18, 1e-18, 1e-18, 1e2, 1e2, 1e2, 1e2]),
    )
    np.testing.assert_allclose(found[-1], np.linalg.inv(fisher), rtol=1e-3)


def test_what_is_read_in_separation_tells_nothing_of_the_tissue():
    """The retreats are faster than the tissue follows: only the way in says something."""
    time, d, v = motion(400)
    common = {
        "displacement_noise_std": 1e-9,
        "jerk_density": 1e-9,
        "parameter_density": np.zeros(4),
        "initial_covariance": np.diag([1e-18, 1e-18, 1e-18, 1.0, 1.0, 0.1, 0.1]),
    }
    tissue = np.tile([0.4, 0.3, 1.7, 1.1], (time.size, 1))
    apart = separated(d, v, tissue)
    assert 0.2 < np.mean(apart) < 0.6
    known = posterior_cramer_rao_bound(time, d, v, tissue, force_noise_std=0.05, **common)
    blind = np.where(apart, 1e9, 0.05)
    same = posterior_cramer_rao_bound(time, d, v, tissue, force_noise_std=blind, **common)
    np.testing.assert_allclose(known[-1], same[-1], rtol=1e-9)
    held = posterior_cramer_rao_bound(
        time, d, v, tissue, force_noise_std=0.05, adhesive=True, **common
    )
    assert np.all(np.diag(held[-1]) < np.diag(known[-1]))


def test_without_contact_nothing_is_learnt():
    time, d, v = motion()
    prior = np.diag([1.0, 50.0, 900.0, 1.0, 2.0, 0.3, 0.01])
    found = posterior_cramer_rao_bound(
        time,
        d - 10.0,
        v,
        np.tile(PARAMETERS, (time.size, 1)),
        displacement_noise_std=0.01,
        force_noise_std=0.05,
        jerk_density=1e4,
        parameter_density=np.zeros(4),
        initial_covariance=prior,
    )
    np.testing.assert_allclose(found[-1], prior[3:, 3:], rtol=1e-12)


def test_less_noise_never_hurts():
    time, d, v = motion()
    bounds = [
        posterior_cramer_rao_bound(
            time,
            d,
            v,
            np.tile(PARAMETERS, (time.size, 1)),
            displacement_noise_std=0.01,
            force_noise_std=std,
            jerk_density=1e4,
            parameter_density=np.zeros(4),
            initial_covariance=np.diag([1.0, 50.0, 900.0, 1.0, 2.0, 0.3, 0.01]),
        )[-1]
        for std in (0.01, 0.02)
    ]
    assert np.linalg.eigvalsh(bounds[1] - bounds[0])[0] > 0.0
