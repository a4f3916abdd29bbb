"""Moving means and medians are told by the noise of a channel, and nothing else is called so."""

import numpy as np
import pytest
from scipy.signal import butter, lfilter

from hc_estimator.stream.readings import Check, Readings
from hc_estimator.stream.sanity import check_samples
from hc_estimator.stream.smoothing_checks import comes_in_steps, is_median, mean_length
from hc_evaluation.accuracy.drawn_contact import TROUBLES, drawn_contact

RATE = 500.0


def force(seed=0, seconds=12.0, noise_n=0.01):
    """Stamps and a force of presses with rests in the air [N]."""
    time_s = np.arange(0.0, seconds, 1.0 / RATE)
    smooth = np.maximum(np.sin(2.0 * np.pi * 0.6 * time_s + 0.4 * np.sin(time_s)), 0.0) ** 1.5
    return time_s, 4.0 * smooth + noise_n * np.random.default_rng(seed).standard_normal(len(time_s))


def of(time_s, values):
    return Readings("force", "N", time_s, values)


def averaged(values, count):
    return lfilter(np.full(count, 1.0 / count), 1.0, values)


def medians(values, count):
    return np.median(np.lib.stride_tricks.sliding_window_view(values, count), axis=1)


@pytest.mark.parametrize("count", [40, 75, 150])
@pytest.mark.parametrize("seed", range(3))
def test_a_mean_is_found_with_its_length(count, seed):
    time_s, values = force(seed)
    found = mean_length(of(time_s, averaged(values, count)))
    assert found == pytest.approx(count, abs=1)
    assert not is_median(of(time_s, averaged(values, count)))


@pytest.mark.parametrize("seed", range(3))
def test_a_median_is_found(seed):
    time_s, values = force(seed)
    smoothed = of(time_s[: len(values) - 60], medians(values, 61))
    assert is_median(smoothed)
    assert not mean_length(smoothed)


@pytest.mark.parametrize("digits", [2, 3, 4])
def test_rounded_readings_are_no_median(digits):
    time_s, values = force()
    assert not is_median(of(time_s, np.round(values, digits)))
    slow = lfilter(*butter(2, 8.0, fs=RATE), values)
    assert not is_median(of(time_s, np.round(slow, digits)))
    assert not mean_length(of(time_s, np.round(slow, digits)))


def test_steps_are_known_whatever_was_taken_off():
    values = np.round(force()[1], 3)
    assert comes_in_steps(values - 0.12345)
    assert comes_in_steps(np.full(5, 2.0))
    assert not comes_in_steps(force()[1])


@pytest.mark.parametrize("every", [2, 3, 5, 8, 20])
def test_what_is_repeated_or_interpolated_is_neither(every):
    time_s, values = force()
    slow, at = values[::every], time_s[::every]
    for made in (np.interp(time_s, at, slow), np.repeat(slow, every)[: len(time_s)]):
        assert not mean_length(of(time_s, made))
        assert not is_median(of(time_s, made))


def test_hum_jumps_and_few_readings_are_neither():
    time_s, values = force()
    for amplitude in (0.001, 0.01, 0.2):
        assert not mean_length(of(time_s, values + amplitude * np.sin(2.0 * np.pi * 50.0 * time_s)))
    jumped = values.copy()
    jumped[1000:1125] -= 500.0
    assert not mean_length(of(time_s, jumped))
    assert not mean_length(of(time_s[:300], averaged(values, 40)[:300]))
    assert not is_median(of(time_s[:300], medians(values, 61)[:300]))
    assert not mean_length(of(time_s, np.full(len(time_s), 1.0)))


@pytest.mark.parametrize("seed", range(3))
def test_drawn_contacts_have_neither(seed):
    for troubles in [(), *((name,) for name in TROUBLES)]:
        contact = drawn_contact(troubles, seed)
        for values in (contact.displacement_mm, contact.force_n):
            read = of(contact.time_s, values)
            assert not mean_length(read), troubles
            assert not is_median(read), troubles


def test_the_check_says_which_sensor_and_how_long():
    time_s, values = force()
    depth = 2.0 + 3.0 * np.sin(2.0 * np.pi * 0.6 * time_s + 0.4 * np.sin(time_s))
    depth = averaged(depth + 0.002 * np.random.default_rng(9).standard_normal(len(depth)), 75)
    (doubt,) = (s for s in check_samples(time_s, depth, values) if s.check is Check.SMOOTHED)
    assert doubt.channel == "displacement"
    assert doubt.remedy == pytest.approx(0.15, rel=0.03)
    assert "a moving mean over 0.15 s (75 readings)" in doubt.sentence
    assert "the filter of the position sensor" in doubt.sentence
    smoothed = medians(values, 61)
    doubts = check_samples(time_s[: len(smoothed)], depth[: len(smoothed)], smoothed)
    assert {(s.check, s.channel) for s in doubts} >= {(Check.SMOOTHED, "force")}
    assert not any(s.check is Check.RATE for s in doubts)  # its repeats are no driver's
