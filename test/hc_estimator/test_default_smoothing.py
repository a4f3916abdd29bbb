"""Wider parabolas and cubics: exact on parabolas and cubics, as calm as they say."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hc_estimator as hc
from hc_estimator.multiple_model import grid, raw_readings, smoothing
from hc_estimator.multiple_model.delay_records import NEIGHBOURS

NOISY = np.array([1e6, 1e6])  # variances beside which a parabola leaves nothing


def window(displacement, force, rate):
    """Finder with one full window of points of the given readings, smoothed."""
    finder = hc.create_estimator("self_tuning_ukf")._memory.view(np.recarray)[0].delay
    grid.restart(finder)
    for k in range(displacement.size):
        raw_readings.take(finder, 0, k / rate, displacement[k])
        raw_readings.take(finder, 1, k / rate, force[k])
        if grid.advance(finder, NOISY):
            smoothing.smooth(finder)
            return finder
    raise AssertionError("no window became full")


def points(finder):
    """Times [s] and smoothed points (records) of the window and its margin, shape (N,) each."""
    index = np.arange(-finder.reach - 1, finder.points + finder.reach + 1) + finder.first
    newest = finder.grid_next - finder.grid_step
    time = newest + (index - (finder.grid_count - 1)) * finder.grid_step
    return time, finder.smooth[index % finder.smooth.shape[0]]


@given(
    st.lists(st.floats(-50.0, 50.0), min_size=3, max_size=3),
    st.lists(st.floats(-50.0, 50.0), min_size=3, max_size=3),
    st.sampled_from([80.0, 125.0, 200.0, 500.0, 1000.0, 2000.0]),
)
@settings(max_examples=20, deadline=None)
def test_a_parabola_is_left_as_it_is(motion, load, rate):
    """At every rate, with as many neighbours as belong to it."""
    time = np.arange(round(1.4 * rate)) / rate
    finder = window(np.polyval(motion, time), np.polyval(load, time), rate)
    at, found = points(finder)
    np.testing.assert_allclose(found["displacement"], np.polyval(motion, at), atol=1e-5)
    np.testing.assert_allclose(found["velocity"], np.polyval(np.polyder(motion), at), atol=1e-3)
    by_cubic = found["velocity_by_cubic"]
    np.testing.assert_allclose(by_cubic, np.polyval(np.polyder(motion), at), atol=1e-2)
    np.testing.assert_allclose(found["force"], np.polyval(load, at), atol=1e-5)


def test_neighbours_fill_eighty_milliseconds_or_are_not_worth_it():
    for step, expected in ((0.001, NEIGHBOURS), (0.01, 4), (0.0101, 4), (0.015, 3), (0.02, 0)):
        assert smoothing.neighbours(step) == expected


@pytest.mark.parametrize("rate", [66.0, 80.0, 100.0, 125.0])
def test_a_smoothed_velocity_is_never_noisier_than_that_of_one_parabola(rate):
    """Regression of 2026-11-27: 1.2 times at 100 Hz, for wide parabolas had fewer neighbours."""
    noise = 0.01 * np.random.default_rng(7).standard_normal(round(1.6 * rate))
    finder = window(noise, noise, rate)
    said = smoothing.velocity_variance(finder, 0.01**2, grid.readings_of(finder))
    assert said < 0.75 * grid.velocity_variance(finder, 0.01**2)


def test_both_channels_are_smoothed_alike():
    rng = np.random.default_rng(5)
    readings = 3.0 + 0.1 * rng.standard_normal(1400)
    _, found = points(window(readings, readings, 1000.0))
    np.testing.assert_allclose(found["displacement"], found["force"], atol=1e-12)


@pytest.mark.parametrize("rate", [200.0, 1000.0])
def test_the_variance_of_a_velocity_is_the_one_that_is_said(rate):
    """Over 40 windows of noise: mean square of the velocities against the formula."""
    rng, squares, said = np.random.default_rng(6), [], 0.0
    for _ in range(40):
        noise = 0.01 * rng.standard_normal(round(1.4 * rate))
        finder = window(noise, noise, rate)
        squares.append(np.mean(points(finder)[1]["velocity"] ** 2))
        readings = grid.readings_of(finder)
        said = smoothing.velocity_variance(finder, 0.01**2, readings)
        narrow = grid.velocity_variance(finder, 0.01**2)
        assert said < 0.2 * narrow
    # The parabolas' values are those of densely read channels in the formula.
    assert np.mean(squares) == pytest.approx(said, rel=0.2)


def gridded(displacement, rate):
    """Finder with a grid of the readings' points, and the number of one with all its neighbours."""
    finder = hc.create_estimator("self_tuning_ukf")._memory.view(np.recarray)[0].delay
    grid.restart(finder)
    for k in range(displacement.size):
        raw_readings.take(finder, 0, k / rate, displacement[k])
        raw_readings.take(finder, 1, k / rate, 0.0)
        grid.advance(finder, NOISY)
    return finder, finder.grid_count - 1 - finder.neighbours


@given(
    st.lists(st.floats(-50.0, 50.0), min_size=4, max_size=4),
    st.sampled_from([200.0, 500.0, 1000.0]),
)
@settings(max_examples=20, deadline=None)
def test_a_cubic_is_found_as_it_is(motion, rate):
    time = np.arange(round(0.4 * rate)) / rate
    finder, here = gridded(np.polyval(motion, time), rate)
    assert finder.neighbours >= smoothing.FEWEST_NEIGHBOURS
    assert smoothing.take_wide(finder, here, 1e-6)
    at = finder.grid_next - finder.grid_step * (finder.grid_count - here)
    velocity = np.polyval(np.polyder(motion), at)
    acceleration = np.polyval(np.polyder(motion, 2), at)
    np.testing.assert_allclose(finder.wide, [velocity, acceleration], rtol=1e-6, atol=1e-2)


def test_a_corner_is_no_cubic():
    rate, time = 1000.0, np.arange(400) / 1000.0
    finder, here = gridded(np.zeros(400), rate)
    corner = finder.grid_next - finder.grid_step * (finder.grid_count - here)
    finder, here = gridded(20.0 * np.abs(time - corner), rate)
    assert not smoothing.take_wide(finder, here, 1e-6)


def test_the_variance_of_a_wide_cubic_is_the_one_that_is_said():
    rng, rate, squares = np.random.default_rng(8), 1000.0, []
    for _ in range(120):
        finder, here = gridded(0.01 * rng.standard_normal(250), rate)
        assert smoothing.take_wide(finder, here, 1.0)
        squares.append(finder.wide[0] ** 2)
    value = 0.01**2 * smoothing.VALUE_VARIANCE / grid.readings_of(finder)
    said = smoothing.slope_variance(finder, value, smoothing.BY_CUBIC)
    assert said < grid.velocity_variance(finder, 0.01**2) / 2.0
    assert np.mean(squares) == pytest.approx(said, rel=0.3)  # 13 % by chance


@pytest.mark.parametrize(("frequency", "off"), [(4.0, 0.002), (8.0, 0.005), (12.0, 0.03)])
@pytest.mark.parametrize("rate", [200.0, 500.0, 1000.0])
def test_a_quintic_leaves_a_tremor_as_it_is(frequency, off, rate):
    """A parabola of 30 ms makes its velocity 1.4, 5.7 and 12.5 % too small."""
    time = np.arange(round(0.4 * rate)) / rate
    omega = 2.0 * np.pi * frequency
    for phase in (0.0, 0.7, 2.0):
        finder, here = gridded(np.sin(omega * time + phase), rate)
        assert smoothing.take_quintic(finder, here, 1e-6 + 1e-4 * (omega / 50.0) ** 12)
        at = finder.grid_next - finder.grid_step * (finder.grid_count - here)
        velocity = omega * np.cos(omega * at + phase)
        assert finder.quintic == pytest.approx(velocity, abs=off * omega)


def test_a_corner_is_no_quintic():
    rate, time = 1000.0, np.arange(400) / 1000.0
    finder, here = gridded(np.zeros(400), rate)
    corner = finder.grid_next - finder.grid_step * (finder.grid_count - here)
    finder, here = gridded(20.0 * np.abs(time - corner), rate)
    assert not smoothing.take_quintic(finder, here, 1e-6)


@pytest.mark.parametrize("rate", [200.0, 1000.0])
def test_the_variance_of_a_quintic_is_the_one_that_is_said(rate):
    """About that of the parabola, which flattens a tremor by fifteen times as much."""
    rng, squares = np.random.default_rng(9), []
    for _ in range(200):
        finder, here = gridded(0.01 * rng.standard_normal(round(0.25 * rate)), rate)
        assert smoothing.take_quintic(finder, here, 1.0)
        squares.append(finder.quintic**2)
    value = 0.01**2 * smoothing.VALUE_VARIANCE / grid.readings_of(finder)
    said = smoothing.slope_variance(finder, value, smoothing.BY_QUINTIC)
    assert said == pytest.approx(grid.velocity_variance(finder, 0.01**2), rel=0.3)
    assert np.mean(squares) == pytest.approx(said, rel=0.3)  # 10 % by chance
