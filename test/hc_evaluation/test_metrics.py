"""Figures of merit against closed forms."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import chi2

from hc_estimator.contact.arrays import hunt_crossley_force
from hc_evaluation import metrics
from hc_evaluation.hold_forward import (
    Frozen,
    hold_forward_errors,
    hold_forward_rms,
    smooth_motion,
)


def test_nees_is_the_squared_mahalanobis_distance_in_logarithms():
    true = np.array([0.2, 0.05, 1.8, 1.05])
    deviations = np.array([0.01, 0.02, 0.03, 0.04])
    correlation = np.full((4, 4), 0.3) + 0.7 * np.eye(4)
    log_covariance = correlation * np.outer(deviations, deviations)
    error = np.array([0.012, -0.01, 0.02, 0.05])
    estimated = np.concatenate((true[:2] * np.exp(error[:2]), true[2:] + error[2:]))
    slopes = np.array([estimated[0], estimated[1], 1.0, 1.0])
    covariance = log_covariance * np.outer(slopes, slopes)
    expected = error @ np.linalg.inv(log_covariance) @ error
    assert metrics.nees(estimated, covariance, true) == pytest.approx(expected, rel=1e-10)


def test_nees_of_a_parameter_held_fixed_or_of_no_covariance_is_not_known():
    true = np.array([0.2, 0.05, 1.8, 1.05])
    fixed, unknown = np.diag([1e-4, 1e-4, 1e-4, 0.0]), np.full((4, 4), np.nan)
    found = metrics.nees(np.tile(true, (3, 1)), np.stack([fixed, unknown, np.eye(4)]), true)
    np.testing.assert_array_equal(np.isnan(found), [True, True, False])


def test_nees_of_an_honest_estimator_averages_four():
    rng = np.random.default_rng(1)
    true = np.array([1.2, 0.1, 1.9, 0.9])
    factor = np.tril(rng.normal(size=(4, 4))) * 0.01 + 0.02 * np.eye(4)
    errors = rng.normal(size=(2000, 4)) @ factor.T
    estimated = np.column_stack((true[:2] * np.exp(errors[:, :2]), true[2:] + errors[:, 2:]))
    slopes = np.column_stack((estimated[:, :2], np.ones((2000, 2))))
    covariance = (factor @ factor.T) * slopes[:, :, None] * slopes[:, None, :]
    low, high = metrics.chi_square_band(4, 2000)
    assert low < np.mean(metrics.nees(estimated, covariance, np.tile(true, (2000, 1)))) < high


@given(st.integers(1, 6), st.integers(1, 500))
def test_chi_square_band_encloses_its_mean_and_the_stated_probability(degrees, samples):
    low, high = metrics.chi_square_band(degrees, samples, 0.99)
    assert low < degrees < high or samples * degrees < 3
    inside = chi2.cdf(high * samples, degrees * samples) - chi2.cdf(
        low * samples, degrees * samples
    )
    assert inside == pytest.approx(0.99, abs=1e-6)


def test_settling_time_counts_to_the_last_excursion():
    time = np.arange(10.0)
    error = np.array([9, 9, 0, 0, 9, 0, 0, 0, 0, 0])[:, None] * np.ones(4)
    assert metrics.settling_time(time, error, 1.0) == 5.0
    assert metrics.settling_time(time, error, 1.0, start_s=3.0) == 2.0
    assert metrics.settling_time(time, error, 10.0) == 0.0
    assert metrics.settling_time(time, np.full((10, 4), np.nan), 1.0) == float("inf")


def test_hold_forward_error_of_the_truth_is_the_noise_and_of_a_wrong_tissue_its_misfit():
    time = np.arange(4000) / 1000.0
    d = 3.0 + np.sin(5.0 * time)
    v = 5.0 * np.cos(5.0 * time)
    true = np.array([0.3, 0.04, 1.6, 1.1])
    force = d**1.6 * (0.3 + 0.04 * np.sign(v) * np.abs(v) ** 1.1)
    rng = np.random.default_rng(2)
    noisy = force + 0.01 * rng.normal(size=force.size)
    _, errors = hold_forward_errors(time, d, v, noisy, true)
    assert np.mean(errors) == pytest.approx(0.01, rel=0.02)
    twice = np.tile(true * [2, 2, 1, 1], (time.size, 1))
    origins, errors = hold_forward_errors(time, d, v, force, twice)
    expected = [
        np.sqrt(np.mean(force[(time > t + 5e-4) & (time < t + 0.5005)] ** 2)) for t in origins
    ]
    np.testing.assert_allclose(errors, expected, rtol=1e-9)


def test_smoothed_motion_is_exact_on_a_cubic():
    time = np.arange(500) / 500.0
    d = 1.0 + 2.0 * time - 3.0 * time**2 + 4.0 * time**3
    smooth, velocity = smooth_motion(d, 500.0)
    np.testing.assert_allclose(smooth, d, atol=1e-10)
    np.testing.assert_allclose(velocity, 2.0 - 6.0 * time + 12.0 * time**2, atol=1e-8)


def test_a_frozen_delay_contact_position_and_zero_enter_the_prediction():
    """F(t + h) = law(d(t + h - delay) - contact, v(t + h - delay)) + zero."""
    time = np.arange(3000) / 1000.0
    true = np.array([0.3, 0.02, 1.6, 1.0])

    def motion(t):
        return 3.0 + np.sin(5.0 * t), 5.0 * np.cos(5.0 * t)

    for lag in (0.0237, -0.031):
        depth, speed = motion(time - lag)
        force = hunt_crossley_force(depth, speed, true) + 0.15
        d, v = motion(time)
        said = Frozen(true, lag, 0.4, 0.15)
        _, errors = hold_forward_errors(time, d + 0.4, v, force, said, start_s=0.5)
        assert np.max(errors) < 1e-4
        for wrong in (
            Frozen(true, lag + 0.01, 0.4, 0.15),
            Frozen(true, lag, 0.3, 0.15),
            Frozen(true, lag, 0.4, 0.05),
            Frozen(true),
        ):
            assert hold_forward_rms(time, d + 0.4, v, force, wrong, start_s=0.5) > 0.03
    # What is frozen is what was said at that time, not later.
    said = Frozen(true, np.where(time < 1.0, 0.0, lag), np.full(3000, 0.4), np.full(3000, 0.15))
    origins, errors = hold_forward_errors(time, d + 0.4, v, force, said, start_s=0.5)
    assert np.all(errors[origins < 1.0] > 0.05)
    assert np.all(errors[origins >= 1.0] < 1e-4)
