"""A force sensor whose zero wanders is read anew wherever the tool leaves the tissue.

Regression of 2026-11-26: a zero that had moved by two per cent of the largest force within twenty
seconds made K 6 % wrong in the median of drawn contacts, and a quarter of the samples were told
wrong, although the tool came out of the tissue again and again.
"""

import numpy as np
import pytest

import hc_estimator as hc

FILTER = "self_tuning_ukf"
K, B, N, P = 0.4, 0.05, 1.6, 0.9


def taps(rate=500.0, seconds=20.0, *, seed=0, period=1.5, home=-1.5, deepest=4.0, noise=0.01):
    """Minimum-jerk taps from the air; time, displacement, force and their noise-free force."""
    draw = np.random.default_rng(seed)
    time = np.arange(0.0, seconds, 1.0 / rate)
    phase = time % period / period
    share = np.clip(np.where(phase < 0.5, (phase - 0.1) / 0.3, (0.8 - phase) / 0.3), 0.0, 1.0)
    place = home + (deepest - home) * share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
    speed = np.gradient(place, time)
    law = K + B * np.sign(speed) * np.abs(speed) ** P
    law = np.maximum(place, 0.0) ** N * np.maximum(law, 0.0)
    reading = place + 0.002 * draw.standard_normal(time.size)
    return time, reading, law + noise * draw.standard_normal(time.size), law


def test_a_zero_that_drifts_is_followed():
    time, place, force, _law = taps()
    drift = 0.06 * (1.0 - np.exp(-time / 8.0))
    series = hc.create_estimator(FILTER).run(time, place, force + drift)
    late = time > 8.0
    error = np.abs(series.parameters[late, 0] / K - 1.0)
    assert np.median(error) < 0.01
    assert np.mean(error <= 4.0 * series.parameters_std[late, 0] / K + 0.01) > 0.95
    off = series.force_zero[late] - drift[late]
    assert np.max(np.abs(off)) < 0.01
    deviation = series.force_zero_std[late]
    assert np.median(deviation) < 0.008  # with what it was off by in the visits so far
    assert np.mean(np.abs(off) <= 3.0 * deviation) > 0.95
    still = hc.create_estimator(FILTER, find_zeros=False).run(time, place, force + drift)
    assert np.median(np.abs(still.parameters[late, 0] / K - 1.0)) > 0.02


def test_what_is_foretold_in_the_air_is_the_zero_there():
    time, place, force, _law = taps()
    series = hc.create_estimator(FILTER).run(time, place, force + 0.003 * time)
    outside = (place < -0.5) & (time > 8.0)
    assert np.max(np.abs(series.force_predicted[outside] - 0.003 * time[outside])) < 0.01


@pytest.mark.parametrize("seed", range(6))
def test_a_zero_that_stays_is_left_alone(seed):
    time, place, force, _law = taps(seed=seed)
    series = hc.create_estimator(FILTER).run(time, place, force)
    exact = hc.create_estimator(FILTER, find_zeros=False).run(time, place, force)
    assert np.max(np.abs(series.force_zero)) < 0.003  # a third of a reading's noise
    assert abs(series.parameters[-1, 0] - exact.parameters[-1, 0]) < 0.002 * K


def test_a_step_of_the_zero_in_the_air_leaves_stiffness_found_before():
    """As of a driver that is told to tare in the middle."""
    time, place, force, _law = taps()
    force = force + np.where(time > 10.2, -0.3, 0.0)  # in the air: taps begin at 10.65
    series = hc.create_estimator(FILTER).run(time, place, force)
    assert abs(series.force_zero[-1] + 0.3) < 0.01
    error = np.abs(series.parameters[time > 14.0, 0] - K)
    assert np.max(error) < 0.03 * K
    assert np.all(error < 4.0 * series.parameters_std[time > 14.0, 0])


@pytest.mark.parametrize("off", [-0.1, 0.1, -0.3])
@pytest.mark.parametrize("seed", range(3))
def test_a_step_on_the_way_in_is_found_before_the_touch(seed, off):
    """Regression: of less than twenty readings no zero was believed, and K was 45 % off."""
    time, place, force, _law = taps(125.0, seed=seed)
    force = force + np.where(time > 10.65, off, 0.0)  # as the tool sets off: 15 readings outside
    series = hc.create_estimator(FILTER).run(time, place, force)
    touched = time > 10.85
    assert np.max(np.abs(series.force_zero[touched] - off)) < 0.02
    assert np.max(np.abs(series.parameters[touched, 0] / K - 1.0)) < 0.03
    assert not np.any(series.change_detected)


def test_tissue_that_comes_up_to_a_tool_that_waits_is_no_zero():
    """A surface that breathes touches a tool that travels outside; its force changes with time."""
    time, place, force, _law = taps()
    surface = 2.0 * np.sin(0.9 * time) ** 2 * (time > 8.0)  # up to 2 mm towards the tool
    depth = place + surface
    touched = np.where(depth > 0.0, K * np.maximum(depth, 0.0) ** N, 0.0)
    noise = force - _law
    series = hc.create_estimator(FILTER).run(time, place, touched + noise)
    assert np.max(np.abs(series.force_zero[time > 8.0])) < 0.05


def test_readings_of_short_visits_count_together():
    """At 66 Hz a tap is outside for some ten readings."""
    time, place, force, _law = taps(66.0, 40.0, period=0.75)
    drift = 0.002 * time
    series = hc.create_estimator(FILTER).run(time, place, force + drift)
    assert abs(series.force_zero[-1] - drift[-1]) < 0.015


def test_it_goes_on_with_the_same_bits_after_a_restore():
    time, place, force, _law = taps()
    force = force + 0.003 * time
    whole = hc.create_estimator(FILTER).run(time, place, force)
    half = time.size * 5 // 8  # outside
    first, second = hc.create_estimator(FILTER), hc.create_estimator(FILTER)
    first.run(time[:half], place[:half], force[:half])
    second.restore(first.state())
    rest = second.run(time[half:], place[half:], force[half:])
    np.testing.assert_array_equal(rest.parameters, whole.parameters[half:])
    np.testing.assert_array_equal(rest.force_zero, whole.force_zero[half:])


def short_visits(zero, seed=0, rate=200.0):
    """Taps that are outside for 80 ms, no further than 0.4 mm; time, displacement, force."""
    draw = np.random.default_rng(seed)
    time = np.arange(0.0, 12.0, 1.0 / rate)
    angle = 2.0 * np.pi * 2.3 * time
    place = 1.6 - 2.0 * np.cos(angle)
    speed = 2.0 * np.pi * 2.3 * 2.0 * np.sin(angle)
    law = np.maximum(K + 0.005 * np.sign(speed) * np.abs(speed) ** P, 0.0)
    force = np.maximum(place, 0.0) ** N * law + zero + 0.03 * draw.standard_normal(time.size)
    return time, place + 0.02 * draw.standard_normal(time.size), force


@pytest.mark.parametrize("zero", [-0.1, -0.04, 0.1])
def test_short_visits_count_together(zero):
    """Each was too short to be outside for certain, and the zero was never found."""
    time, place, force = short_visits(zero)
    series = hc.create_estimator(FILTER).run(time, place, force)
    assert series.force_zero[-1] == pytest.approx(zero, abs=0.012)
    assert not np.any(series.model_mismatch[time > 8.0])
    error = np.abs(np.log(series.parameters[time > 10.0, 0] / K))
    assert np.quantile(error, 0.9) < 0.03


def test_a_zero_is_known_better_with_every_visit():
    time, place, force = short_visits(-0.1)
    series = hc.create_estimator(FILTER).run(time, place, force)
    said = series.force_zero_std[np.isfinite(series.force_zero_std) & (series.force_zero != 0.0)]
    assert said[-1] < 0.6 * said[0]
    assert abs(series.force_zero[-1] + 0.1) < 4.0 * said[-1]


def test_what_sticks_on_the_way_out_is_no_zero():
    """A tenth of a newton that lets go over half a millimetre: K was up to 10 % wrong by it."""
    time, place, force = short_visits(0.0)
    speed = np.gradient(1.6 - 2.0 * np.cos(2.0 * np.pi * 2.3 * time), time)
    gap = np.maximum(-(1.6 - 2.0 * np.cos(2.0 * np.pi * 2.3 * time)), 0.0)
    force = force - np.where((gap > 0.0) & (speed < 0.0), 0.1 * np.exp(-gap / 0.5), 0.0)
    series = hc.create_estimator(FILTER).run(time, place, force)
    assert np.max(np.abs(series.force_zero)) < 0.008
    error = np.abs(np.log(series.parameters[time > 8.0, 0] / K))
    assert np.quantile(error, 0.9) < 0.02


@pytest.mark.parametrize("moved", [-0.25, 0.25])
@pytest.mark.parametrize("begins_inside", [False, True])
def test_a_driver_that_tares_in_the_air_leaves_no_misfit(moved, begins_inside):
    """What did not fit in the air was the zero: it was an error of the law for ten seconds more.

    Regression of 2026-11-29. Also where the tool began inside: an air in which the zero was what
    it was said to be has been seen all the same.
    """
    time, place, force, _law = taps(seconds=30.0, deepest=3.0)
    first = 6 if not begins_inside else 210  # in the first tap, 1.5 mm deep
    tared = 10.6 if moved < 0.0 else 12.05  # at rest, and in the middle of a visit to the air
    time, place, force = time[first:], place[first:], force[first:]
    force = force + np.where(time > tared, moved, 0.0)
    series = hc.create_estimator(FILTER).run(time, place, force)
    late = time > tared + 3.5
    assert abs(series.force_zero[-1] - moved) < 0.01
    assert np.mean(series.model_mismatch[late]) < 0.05
    error = np.abs(series.parameters[late, 0] / K - 1.0)
    assert np.median(error) < 0.01
    assert np.mean(error < 4.0 * series.parameters_std[late, 0] / K + 0.005) > 0.95


@pytest.mark.parametrize("seed", range(3))
def test_a_sensor_that_warms_up_says_what_that_leaves_open(seed):
    """30 mN within minutes; K was within three deviations in 88 % of such contacts' samples."""
    time, place, force, _law = taps(seconds=120.0, seed=seed, period=8.0)
    drift = 0.03 * (1.0 - np.exp(-time / 60.0))
    series = hc.create_estimator(FILTER).run(time, place, force + drift)
    late = time > 30.0
    error = np.abs(series.parameters[late, 0] - K)
    assert np.mean(error <= 3.0 * series.parameters_std[late, 0]) > 0.95
    assert np.median(series.parameters_std[late, 0]) < 0.02 * K
    assert np.mean(series.model_mismatch[late]) < 0.02


@pytest.mark.parametrize("seed", range(3))
def test_a_driver_that_tares_at_every_visit_is_no_drift(seed):
    """Zeros that are others at every visit: the steps are in the air, and K is as it was."""
    time, place, force, _law = taps(seconds=60.0, seed=seed, period=3.0)
    draw = np.random.default_rng(seed)
    zero = np.repeat(draw.uniform(-0.3, 0.3, 20), 1500)  # 0.3 s before each tap
    series = hc.create_estimator(FILTER).run(time, place, force + zero)
    late = time > 20.0
    error = np.abs(series.parameters[late, 0] / K - 1.0)
    assert np.median(error) < 0.01
    assert np.mean(error <= 4.0 * series.parameters_std[late, 0] / K + 0.005) > 0.9


@pytest.mark.parametrize("level", [0.06, 0.08, 0.1])
def test_one_reading_that_noise_lowers_is_no_air(level):
    """Seven to nine deviations, untared: of 300 readings in the air one or two are below five.

    That reading was where the tool was free, and the next was a touch: the contact began where the
    tool had rested, K was 87 % too small, and stayed so for two taps.
    """
    wrong = 0
    for seed in range(8):
        time, place, force, _law = taps(seconds=3.0, seed=seed, period=3.0)
        series = hc.create_estimator(FILTER).run(time, place, force + level)
        wrong += abs(series.parameters[-1, 0] / K - 1.0) > 0.02
    assert wrong <= 1
