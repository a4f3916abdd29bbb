"""Sensors: each fault has the size and the frequency that the scenario asks for."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy import stats

from hc_sim_rig import Rig, RigSeries, Scenario, load_scenario
from hc_sim_rig.sensors import DisplacementSensor, Dropouts, ForceSensor, Noise, Sensors, Spikes

SECONDS = 20.0
COUNT = 20000
QUIET = DisplacementSensor()


def read(force: ForceSensor, displacement: DisplacementSensor = QUIET) -> RigSeries:
    scenario: Scenario = dataclasses.replace(
        load_scenario("multisine"), sensors=Sensors(displacement=displacement, force=force)
    )
    return Rig(scenario, seed=7).run(SECONDS)


def binomial_band(probability: float, count: int = COUNT) -> tuple[float, float]:
    low, high = stats.binom.ppf([1e-5, 1 - 1e-5], count, probability)
    return float(low), float(high)


def test_perfect_sensors_read_the_truth() -> None:
    series = read(ForceSensor())
    np.testing.assert_array_equal(series.force_n, series.truth.force_n)
    np.testing.assert_array_equal(series.displacement_mm, series.truth.displacement_mm)


def test_quantisation_and_saturation() -> None:
    series = read(ForceSensor(resolution=0.05, range_minimum=0.5, range_maximum=5.0))
    steps = series.force_n / 0.05
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)
    inside = np.clip(series.truth.force_n, 0.5, 5.0)
    assert np.abs(series.force_n - inside).max() <= 0.025 + 1e-9
    assert series.force_n.max() == pytest.approx(5.0)
    assert series.force_n.min() == pytest.approx(0.5)


def test_bias_and_drift() -> None:
    series = read(ForceSensor(bias=0.3, drift_per_s=-0.02))
    error = series.force_n - series.truth.force_n
    np.testing.assert_allclose(error, 0.3 - 0.02 * series.time_s, atol=1e-12)


def test_random_walk_grows_with_the_root_of_time() -> None:
    series = read(ForceSensor(random_walk=0.1))
    walk = series.force_n - series.truth.force_n
    steps = np.diff(walk)
    chi2 = np.sum(steps**2) / (0.1**2 / 1000.0)
    low, high = stats.chi2.ppf([1e-4, 1 - 1e-4], len(steps))
    assert low < chi2 < high


@pytest.mark.parametrize("delay_s", [0.005, 0.0124, 0.1])
def test_a_late_sensor_reads_the_past(delay_s: float) -> None:
    series = read(ForceSensor(delay_s=delay_s))
    t = series.time_s
    expected = np.interp(t - delay_s, t, series.truth.force_n)
    np.testing.assert_allclose(series.force_n, expected, atol=1e-9)


def test_spikes_are_as_rare_and_large_as_ordered_and_move_nothing_else() -> None:
    plain = read(ForceSensor(noise_std_n=0.01))
    spiky = read(ForceSensor(noise_std_n=0.01, spikes=Spikes(probability=0.01, size=2.0)))
    difference = spiky.force_n - plain.force_n
    hit = difference != 0.0
    np.testing.assert_allclose(np.abs(difference[hit]), 2.0, atol=1e-9)
    low, high = binomial_band(0.01)
    assert low < hit.sum() < high
    assert 0.3 < (difference[hit] > 0.0).mean() < 0.7
    np.testing.assert_array_equal(spiky.displacement_mm, plain.displacement_mm)


@pytest.mark.parametrize("reads", ["last", "nan"])
def test_dropouts_last_as_long_as_ordered(reads: str) -> None:
    dropouts = Dropouts(probability=0.002, mean_samples=8.0, reads=reads)
    series = read(ForceSensor(dropouts=dropouts))
    truth = series.truth.force_n
    gone = np.isnan(series.force_n) if reads == "nan" else series.force_n != truth
    begins = np.flatnonzero(np.diff(gone.astype(int)) == 1) + 1
    # mean length 8 samples: gone for 8 / (8 + 500) of the time, within wide chance
    assert 0.7 < gone.mean() / (8.0 / 508.0) < 1.3
    assert 25 < len(begins) < 60
    if reads == "last":
        assert np.array_equal(series.force_n[begins], truth[begins - 1])
    np.testing.assert_array_equal(series.force_n[~gone], truth[~gone])


def test_gamma_noise_has_the_mean_and_variance_of_the_paper() -> None:
    # Paper C: mean 0.01, variance 0.002, that is alpha = 0.05 and beta = 5.
    noise = Noise(distribution="gamma", shape=0.05)
    series = read(ForceSensor(noise_std_n=np.sqrt(0.002), noise=noise))
    error = series.force_n - series.truth.force_n
    assert error.min() >= -1e-12
    fit = stats.kstest(error, stats.gamma(0.05, scale=1 / 5).cdf)
    assert error.mean() == pytest.approx(0.01, abs=5 * np.sqrt(0.002 / COUNT))
    assert error.var() == pytest.approx(0.002, rel=0.15)
    # values below 1e-16 are lost in the force's own digits: they are a known share of the law
    assert fit.statistic < stats.gamma(0.05, scale=1 / 5).cdf(1e-15) + 0.02


def test_heavy_tails_have_the_same_deviation_and_more_outliers() -> None:
    noise = Noise(distribution="student_t", degrees_of_freedom=5.0)
    series = read(ForceSensor(noise_std_n=0.01, noise=noise))
    error = (series.force_n - series.truth.force_n) / 0.01
    assert error.std() == pytest.approx(1.0, rel=0.05)
    assert stats.kstest(error / np.sqrt(3.0 / 5.0), stats.t(5.0).cdf).pvalue > 1e-4
    assert (np.abs(error) > 4.0).sum() > 10 * COUNT * 2 * stats.norm.sf(4.0)


def test_both_sensors_have_their_own_faults() -> None:
    late = DisplacementSensor(bias=0.5, resolution=0.01, dropouts=Dropouts(probability=0.01))
    series = read(ForceSensor(), late)
    np.testing.assert_array_equal(series.force_n, series.truth.force_n)
    error = series.displacement_mm - series.truth.displacement_mm - 0.5
    held = np.abs(error) > 0.00501
    assert 50 < held.sum() < 300
