"""The slow factor of the jerk density: down by the size of the innovations, up by their order."""

import numpy as np
import pytest

from hc_estimator.adaptation import density_correction, motion_density

RATE = 500.0


@pytest.fixture
def motion(parts):
    return parts[1].motion


def after(motion, force, displacement=None, rate=RATE):
    """The factor's logarithm after innovations of both channels, in their deviations."""
    if displacement is None:
        displacement = np.random.default_rng(9).standard_normal(force.size)
    motion_density.reset(motion)
    way = np.empty(force.size)
    for k in range(force.size):
        nis = displacement[k] ** 2 + force[k] ** 2
        density_correction.correct(motion, nis, force[k], 1.0 / rate)
        way[k] = motion.log_correction
    return way


def white(count, seed=0):
    return np.random.default_rng(seed).standard_normal(count)


def lagging(count, size, hz, rate=RATE, seed=0):
    """Innovations of a filter that lags behind a tremor that comes and goes."""
    time = np.arange(count) / rate
    beats = np.sin(2.0 * np.pi * 0.31 * time)
    return white(count, seed) + size * beats * np.sin(2.0 * np.pi * hz * time)


@pytest.mark.parametrize("rate", [66.0, 500.0, 2000.0])
def test_white_innovations_do_not_bring_it_up(motion, rate):
    for seed in range(8):
        way = after(motion, white(20000, seed), white(20000, seed + 100), rate)
        assert np.median(way) < 0.1
        assert np.mean(way > density_correction.MORE) < 0.02


def test_too_small_ones_bring_it_down_within_some_hundred_samples(motion):
    assert after(motion, 0.7 * white(400), 0.7 * white(400, 1))[-1] < -2.0
    way = after(motion, 0.3 * white(5000), 0.3 * white(5000, 1))
    assert way[-1] == motion_density.SMALLEST_CORRECTION


@pytest.mark.parametrize("rate", [125.0, 500.0, 1000.0])
@pytest.mark.parametrize("hz", [6.0, 9.0])
def test_a_motion_that_noise_hides_brings_it_up_within_seconds(motion, hz, rate):
    way = after(motion, lagging(round(10.0 * rate), 1.5, hz, rate), rate=rate)
    assert way[-1] > density_correction.MORE


@pytest.mark.parametrize("hz", [0.15, 0.5])
@pytest.mark.parametrize("size", [1.0, 5.0])
def test_a_force_that_is_off_for_as_long_as_a_press_lasts_is_no_motion(motion, size, hz):
    """A zero that is off made a tool that moves more of it, by the size of the innovations."""
    time = np.arange(10000) / RATE
    way = after(motion, white(10000) + size * np.sin(2.0 * np.pi * hz * time) ** 2)
    assert np.median(way) < density_correction.MORE / 2.0


def test_a_noise_that_is_larger_than_it_is_called_is_no_motion(motion):
    assert np.median(after(motion, 2.0 * white(20000), 2.0 * white(20000, 1))) < 0.2


def test_another_tissue_does_not_pass_for_a_tool_that_moves_more(motion):
    """A change is found within some hundred samples, however far off the forces are."""
    way = after(motion, 1e3 + white(150))
    assert 0.0 <= way[-1] < density_correction.MORE


def test_it_comes_down_again_once_they_are_white(motion):
    force = np.concatenate([lagging(5000, 1.5, 8.0), white(10000)])
    way = after(motion, force)
    assert way[4999] > density_correction.MORE
    assert way[-1] < density_correction.NO_MORE


def test_a_turn_forgets_a_tool_that_was_calm_and_not_one_that_trembles(motion):
    for before, expected in ((-3.0, 0.0), (1.5, 1.5)):
        motion.log_correction = before
        density_correction.forget_calm(motion)
        assert motion.log_correction == expected


def test_it_moves_more_until_it_clearly_does_no_longer(motion):
    said = False
    for level, expected in ((0.5, False), (0.9, True), (0.5, True), (0.3, False), (0.5, False)):
        motion.log_correction = level
        said = density_correction.moves_more(motion, said)
        assert said is expected


@pytest.mark.parametrize("rate", [10.0, 50.0])
def test_readings_that_are_far_apart_say_nothing_of_a_tremor(motion, rate):
    """At 10 Hz a law that does not fit passed for one (a compression to 1.1 kN)."""
    force = white(2000) + 2.0 * np.sign(np.sin(0.1 * np.arange(2000)))
    assert after(motion, force, rate=1000.0).max() > 1.0
    assert after(motion, force, rate=rate).max() <= 0.0
