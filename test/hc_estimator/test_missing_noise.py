"""How noisy a sensor is, and how the tool moves, is known as well where readings are missing.

Regression of 2026-11-29. The noise was found from nine readings in a row. A force of
which every third to eighth reading is missing never has them: its noise stayed what the settings
said, and a force that was 1.5 ms late was not found to be. And after a step that was longer than
the usual one the density of the motion was that of another motion, so that a fine pose that lost
half of its readings at random had a misfit told once its noise was known.
"""

import math

import numpy as np
import pytest

import hc_estimator as hc
from hc_estimator.adaptation import difference_noise, motion_density

FILTER = "self_tuning_ukf"
PATTERNS = ("even", "every fourth missing", "half missing", "rounded")


def stamps(pattern, rate_hz=500.0, count=20000):
    time_s, draw = np.arange(count) / rate_hz, np.random.default_rng(5)
    if pattern == "jittered":
        return time_s + draw.uniform(-0.4, 0.4, count) / rate_hz
    if pattern == "every fourth missing":
        return time_s[np.arange(count) % 4 != 0]
    if pattern == "half missing":
        return time_s[draw.random(count) < 0.5]
    return np.round(time_s, 3) if pattern == "rounded" else time_s


@pytest.mark.parametrize("pattern", [*PATTERNS, "jittered"])
def test_a_divided_difference_is_what_a_polynomial_leaves(pattern):
    """Nine readings and a polynomial of degree seven leave one degree of freedom."""
    time_s = stamps(pattern, count=200)
    reading = np.random.default_rng(1).standard_normal(time_s.size) + 5.0
    for first in range(0, time_s.size - 9, 7):
        times, readings = time_s[first : first + 9], reading[first : first + 9]
        scaled = 2.0 * (times - times[0]) / (times[-1] - times[0]) - 1.0
        columns = np.polynomial.chebyshev.chebvander(scaled, 7)
        left = readings - columns @ np.linalg.lstsq(columns, readings, rcond=None)[0]
        variance = difference_noise.uneven_variance_of(times, readings)
        assert math.isclose(variance, left @ left, rel_tol=1e-6, abs_tol=1e-12)


def test_at_even_times_both_differences_are_the_same():
    readings = np.random.default_rng(2).standard_normal(9)
    even = difference_noise.variance_of(readings)
    assert math.isclose(even, difference_noise.uneven_variance_of(np.arange(9.0), readings))


@pytest.mark.parametrize("pattern", PATTERNS)
def test_the_noise_is_found_whatever_is_missing(pattern):
    time_s = stamps(pattern)
    draw = np.random.default_rng(3)
    place = 2.0 * np.sin(6.0 * np.pi * time_s) + 0.003 * draw.standard_normal(time_s.size)
    channel = np.zeros(1, difference_noise.NOISE)[0]
    settings = hc.create_estimator(FILTER)._settings[0]
    changed = 0
    for time, reading in zip(time_s, place, strict=True):
        changed += difference_noise.learn(settings, channel, time, reading, False, 1e-6)
    assert abs(math.sqrt(channel["mean"]) / 0.003 - 1.0) < 0.1
    assert changed > 0.6 * time_s.size


def test_what_spans_a_gap_says_nothing():
    """Of a motion of 5 Hz at 50 readings a second, the nine readings about a gap are motion."""
    time_s = np.arange(4000) / 50.0
    time_s = time_s[time_s % 1.0 > 0.35]  # nine readings of each second are missing, and more
    place = 2.0 * np.sin(10.0 * np.pi * time_s)
    place += 0.003 * np.random.default_rng(4).standard_normal(time_s.size)
    channel = np.zeros(1, difference_noise.NOISE)[0]
    settings = hc.create_estimator(FILTER)._settings[0]
    largest = 0.0
    for time, reading in zip(time_s, place, strict=True):
        difference_noise.learn(settings, channel, time, reading, False, 1e-6)
        largest = max(largest, channel["mean"])
    even = np.array([difference_noise.variance_of(place[i : i + 9]) for i in range(20)])
    assert math.sqrt(largest) < 2.0 * math.sqrt(max(np.max(even), 0.003**2))


@pytest.mark.parametrize("steps", [0.6, 1.0, 1.5, 3.0])
@pytest.mark.parametrize("member", [3, 18, 33])
def test_after_any_step_a_member_updates_as_a_kalman_filter(member, steps):
    covariance = motion_density.BANK[member, 4:13].reshape(3, 3)
    moves = np.array([[1.0, steps, 0.5 * steps**2], [0.0, 1.0, steps], [0.0, 0.0, 1.0]])
    noise = motion_density.INDICES[member] * np.array(
        [
            [steps**5 / 20.0, steps**4 / 8.0, steps**3 / 6.0],
            [steps**4 / 8.0, steps**3 / 3.0, steps**2 / 2.0],
            [steps**3 / 6.0, steps**2 / 2.0, steps],
        ]
    )
    predicted = moves @ covariance @ moves.T + noise
    variance = predicted[0, 0] + 1.0
    expected = np.r_[variance, predicted[:, 0] / variance]
    found = motion_density._gains_after(member, steps)
    assert np.allclose(found, expected, rtol=1e-12, atol=0.0)
    if steps == 1.0:
        assert np.allclose(found, motion_density.BANK[member, :4], rtol=1e-9, atol=0.0)


@pytest.fixture
def incomplete(recording):
    """Records a contact with fine sensors, of which readings are missing; with K."""

    def make(rate_hz, keep, kept_place, kept_force, late_s=0.0, seed=3, seconds=20.0):
        every, late = round(2000.0 / rate_hz), round(2000.0 * late_s)
        time_s, place, force = recording(
            seconds, 2000.0, seed, displacement_noise=0.001, force_noise=0.001
        )
        time_s, place = time_s[late::every], place[late::every]
        force = force[: force.size - late : every]
        draw = np.random.default_rng(seed)
        place = np.where(keep(draw, time_s.size, kept_place), place, np.nan)
        return time_s, place, np.where(keep(draw, time_s.size, kept_force), force, np.nan), 0.2

    return make


def regularly(_draw, count, every):
    return np.arange(count) % every != 0 if every else np.ones(count, np.bool_)


def at_random(draw, count, share):
    return draw.random(count) < share


@pytest.mark.parametrize("every", [0, 2, 3, 4, 6, 8])
def test_a_small_delay_is_found_whichever_forces_are_missing(every, incomplete):
    time_s, place, force, stiffness = incomplete(500.0, regularly, 0, every, late_s=0.0015)
    series = hc.create_estimator(FILTER, missing_readings=True).run(time_s, place, force)
    assert abs(series.channel_delay[-1] - 0.0015) < 0.0003
    noise = np.nanmedian(series.force_noise_std[time_s > 10.0])
    assert abs(noise / 0.001 - 1.0) < 0.15
    assert abs(series.parameters[-1, 0] / stiffness - 1.0) < 0.002


@pytest.mark.parametrize("rate_hz", [500.0, 125.0])
@pytest.mark.parametrize("share", [0.8, 0.5])
def test_no_misfit_is_told_where_readings_are_lost_at_random(share, rate_hz, incomplete):
    for seed in range(3):
        *readings, stiffness = incomplete(rate_hz, at_random, share, share, seed=seed)
        series = hc.create_estimator(FILTER, missing_readings=True).run(*readings)
        late = readings[0] > 6.0
        assert np.mean(series.model_mismatch[late]) < 0.05
        error = np.abs(series.parameters[late, 0] - stiffness)
        assert np.median(error) < 0.002 * stiffness
        assert np.mean(error <= 3.0 * series.parameters_std[late, 0]) > 0.9
