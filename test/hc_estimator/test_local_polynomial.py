"""Local polynomials: equal to numpy's, of a degree that the noise allows, as noisy as they say."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hc_estimator as hc
from hc_estimator.multiple_model import grid, local_polynomial, raw_readings
from hc_estimator.multiple_model.local_polynomial import (
    QUADRATIC,
    QUARTIC,
    QUARTIC_NOISE,
    SEXTIC,
    SEXTIC_NOISE,
    TO_BE_READ,
)

HALF = 0.015
NOISE = np.array([1e-6, 1e-4])  # variances of displacement and force
PLACE, SLOPE, BEND, LEFT, CUBIC = range(5)  # of what is fitted


def fitted(time, displacement, force, noise=NOISE, half=HALF, wider=None):
    """Degree of the polynomials about zero, and what they say of both channels."""
    finder = hc.create_estimator("self_tuning_ukf")._memory.view(np.recarray)[0].delay
    grid.restart(finder)
    for k, stamp in enumerate(time):
        raw_readings.take(finder, 0, stamp, displacement[k])
        raw_readings.take(finder, 1, stamp, force[k])
    degree = local_polynomial.fit(finder, 0.0, half, wider or half, noise)
    return degree, np.array(finder.fitted_to)


def stamps(rng, count=31):
    """Uneven times from a half width before zero to one after."""
    time = np.linspace(-HALF, HALF, count)
    time[1:-1] += rng.uniform(-0.3, 0.3, count - 2) * 2.0 * HALF / (count - 1)
    return time


@given(st.integers(0, 2**32 - 1), st.integers(7, 60))
@settings(max_examples=25, deadline=None)
def test_a_quartic_is_the_least_squares_one_at_uneven_times(seed, count):
    rng = np.random.default_rng(seed)
    time = stamps(rng, count)
    readings = 3.0 + np.polyval(rng.uniform(-1.0, 1.0, 7), time / HALF)
    force = 50.0 + 10.0 * np.polyval(rng.uniform(-1.0, 1.0, 7), time / HALF)
    degree, found = fitted(time, readings, force, noise=np.array([1e-12, 1e-12]))
    assert degree == QUARTIC
    for values, said in ((readings, found[0]), (force, found[1])):
        terms = np.polyfit(time, values, 4)
        left = np.sum((np.polyval(terms, time) - values) ** 2) / (count - 5)
        spread = 2.0 / (9.0 * (count - 5))
        left *= local_polynomial.SMOOTH / (1.0 - spread + 2.0 * np.sqrt(spread)) ** 3
        np.testing.assert_allclose(said[PLACE], terms[4], rtol=1e-9)
        flat = np.polyfit(time, values, 2)
        np.testing.assert_allclose(said[SLOPE], flat[1], rtol=1e-6, atol=1e-6)
        np.testing.assert_allclose(said[SLOPE] + said[CUBIC], terms[3], rtol=1e-6, atol=1e-6)
        np.testing.assert_allclose(said[BEND], 2.0 * terms[2], rtol=1e-5, atol=1e-3)
        assert said[LEFT] == pytest.approx(left, rel=1e-5, abs=1e-12)


@pytest.mark.parametrize("count", [7, 31])
def test_noise_alone_hardly_ever_asks_for_a_quartic(count):
    rng, asked = np.random.default_rng(1), 0
    for _ in range(1500):
        time = stamps(rng, count)
        place = 3.0 + 20.0 * time + np.sqrt(NOISE[0]) * rng.standard_normal(count)
        force = 5.0 + 100.0 * time + np.sqrt(NOISE[1]) * rng.standard_normal(count)
        asked += fitted(time, place, force)[0] == QUARTIC
    assert asked <= 2  # one in 30,000 of either channel is meant to


def test_a_motion_that_a_parabola_flattens_is_not_flattened():
    """7.6 Hz within 35 ms of readings at 200 Hz: 1.5 % of the velocity by a parabola."""
    time = 0.005 * np.arange(-3, 4)
    angle = 2.0 * np.pi * 7.6
    motion = 2.0 + 0.19 * np.sin(angle * time)
    degree, found = fitted(time, motion, 5.0 + time, half=0.0175)
    assert degree == QUARTIC
    assert found[0, SLOPE] < 0.99 * 0.19 * angle
    assert found[0, SLOPE] + found[0, CUBIC] == pytest.approx(0.19 * angle, rel=2e-3)


def test_a_force_that_a_parabola_flattens_is_not_flattened():
    time = 0.005 * np.arange(-3, 4)
    force = 5.0 + 0.9 * np.cos(2.0 * np.pi * 20.0 * time)
    degree, found = fitted(time, 2.0 + time, force, half=0.0175)
    assert degree == QUARTIC
    assert found[1, PLACE] == pytest.approx(5.9, abs=0.02)
    degree, found = fitted(time, 2.0 + time, force, noise=np.array([1.0, 1.0]), half=0.0175)
    assert degree == QUADRATIC
    assert found[1, PLACE] < 5.85


def test_both_channels_have_the_degree_that_one_of_them_asks_for():
    """What is flattened of one channel alone looks like a delay."""
    time = stamps(np.random.default_rng(2))
    bent = 1.0 + 0.2 * (time / HALF) ** 3
    for place, force in ((bent, 5.0 + time), (2.0 + time, 5.0 + bent)):
        degree, found = fitted(time, place, force)
        assert degree == QUARTIC
        assert np.all(found[:, LEFT] < 1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_the_corner_at_a_touch_asks_for_no_quartic(seed):
    """No polynomial has it: as much is left as by a parabola, and there is no point."""
    time = stamps(np.random.default_rng(seed))
    touch = np.random.default_rng(seed).uniform(-0.5, 0.5) * HALF
    force = 60.0 * np.maximum(time - touch, 0.0)
    assert fitted(time, 1.0 + 20.0 * time, force)[0] == QUADRATIC


def test_the_noise_of_a_quartic_is_the_one_that_is_said():
    """Over 3,000 draws, beside a parabola through the same readings."""
    rng, values = np.random.default_rng(3), []
    time = np.linspace(-HALF, HALF, 201)
    for _ in range(3000):
        noise = rng.standard_normal(time.size)
        values.append([np.polyfit(time / HALF, noise, degree)[-1] for degree in (2, 4)])
    parabola, quartic = np.var(values, axis=0)
    assert quartic / parabola == pytest.approx(QUARTIC_NOISE, rel=0.1)


def test_a_slow_sensor_has_two_more_readings_and_degree_six():
    """Quick taps at 66 Hz, whose seven readings take 0.1 s, in which a quartic flattens as well."""
    period = 1.0 / 66.0
    time = period * (np.arange(-5, 5) + 0.5)
    half = 3.5 * period
    wider = local_polynomial.widest(half, period)
    assert wider == pytest.approx(4.5 * period)
    angle = 2.0 * np.pi * 7.6
    motion = 2.0 + 0.19 * np.sin(angle * time)
    degree, found = fitted(time, motion, 5.0 + time, half=half, wider=wider)
    assert degree == SEXTIC
    assert found[0, SLOPE] + found[0, CUBIC] == pytest.approx(0.19 * angle, rel=0.02)
    inside = np.abs(time) < half * 1.001
    quartic = np.polyfit(time[inside], motion[inside], 4)[3]
    assert abs(quartic / (0.19 * angle) - 1.0) > 0.08
    terms = np.polyfit(time, motion, 6)
    np.testing.assert_allclose(found[0, PLACE], terms[6], rtol=1e-9)
    np.testing.assert_allclose(found[0, BEND], 2.0 * terms[4], rtol=1e-5, atol=1e-3)


def test_degree_six_waits_for_its_last_readings():
    period = 1.0 / 66.0
    time = period * (np.arange(-5, 5) + 0.5)
    motion = 2.0 + 0.19 * np.sin(2.0 * np.pi * 7.6 * time)
    wide = {"half": 3.5 * period, "wider": 4.5 * period}
    degree, _found = fitted(time[:-1], motion[:-1], 5.0 + time[:-1], **wide)
    assert degree == TO_BE_READ
    calm = 2.0 + time
    assert fitted(time[:-1], calm[:-1], 5.0 + time[:-1], **wide)[0] == QUADRATIC


@pytest.mark.parametrize(("rate", "more"), [(1000.0, False), (310.0, False), (200.0, True)])
def test_only_where_a_parabola_has_few_readings(rate, more):
    half = max(0.015, 3.5 / rate)
    assert (local_polynomial.widest(half, 1.0 / rate) > half) == more


def test_the_noise_of_degree_six_is_the_one_that_is_said():
    """Weights of the value by least squares, of nine readings and of seven."""
    variances = []
    for degree, count in ((2, 7), (6, 9)):
        powers = np.vander(np.linspace(-1.0, 1.0, count), degree + 1, increasing=True)
        variances.append(np.sum(np.linalg.pinv(powers)[0] ** 2))
    assert variances[1] / variances[0] == pytest.approx(SEXTIC_NOISE, rel=0.01)


def test_few_readings_make_no_polynomial():
    time = np.linspace(-HALF, HALF, 5)
    assert fitted(time, time, time)[0] == 0
