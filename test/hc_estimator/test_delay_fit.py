"""The weighted fit at one candidate delay: its equations against finite differences, its result."""

import numpy as np
import pytest

import hc_estimator as hc
from hc_estimator.multiple_model import delay_fit, delay_points
from hc_estimator.multiple_model.delay_records import CANDIDATES

CENTRE = CANDIDATES // 2
TISSUE = np.array([0.7, 0.05, 1.6, 0.9])  # K, B / K, n, p


def filled(windows=12, varying=False, noise=0.0):
    """Settings, and a finder whose points obey the law, ten of each half second.

    Args:
        windows: half seconds.
        varying: True if each has a K and a surface of its own.
        noise: of the force [N].
    """
    estimator = hc.create_estimator("self_tuning_ukf")
    settings = estimator._settings.view(np.recarray)[0]
    finder = estimator._memory.view(np.recarray)[0].delay
    finder.reach, finder.grid_step, finder.kept = CENTRE, 0.01, 10 * windows
    rng = np.random.default_rng(3)
    stiffness, b, n, p = TISSUE
    for k in range(finder.kept):
        window, time = k // 10, 0.05 * k
        for j in range(CANDIDATES):
            at = time - (j - CENTRE) * 0.01
            d, v = 3.0 + np.sin(4.0 * at), 4.0 * np.cos(4.0 * at)
            finder.point[k, j] = (np.log(d), np.log(abs(v)), v, 1.0 / d)
        d, v = 3.0 + np.sin(4.0 * time), 4.0 * np.cos(4.0 * time)
        own = stiffness
        if varying:
            own *= 1.0 + 0.4 * np.sin(window)
            d += 0.05 * np.cos(2.0 * window)
        force = own * d**n * (1.0 + b * np.sign(v) * abs(v) ** p)
        finder.point_forces[k] = force + noise * rng.standard_normal()
        finder.point_window[k] = window
    finder.point_force[:, 3] = 1e-4
    finder.depth_noise[0] = 1e-8
    delay_points.shift(finder, 0.0)
    finder.law[CENTRE] = TISSUE
    delay_fit.weigh(finder, CENTRE)
    return settings, finder


def test_the_slope_is_the_derivative_of_the_squares():
    """Oracle: central differences of half the squares, with noise of the velocity."""
    settings, finder = filled(noise=0.02)
    law = TISSUE * (1.0, 1.4, 1.05, 0.95)
    delay_fit.add_up(settings, finder, CENTRE, law)
    slope = np.array(finder.slope)[:3]
    for i in range(3):
        step = np.zeros(4)
        step[1 + i] = 1e-5
        above, below = (
            delay_fit.add_up(settings, finder, CENTRE, law + side * step) for side in (1, -1)
        )
        assert slope[i] == pytest.approx(-0.5 * (above - below) / 2e-5, rel=1e-4)


def test_the_score_is_the_derivative_by_the_delay():
    """Oracle: the squares at two delays near the candidate, K, b, n and p held."""
    settings, finder = filled(noise=0.01)
    squares = []
    for share in (0.01, -0.01):
        delay_points.shift(finder, 0.0)
        time = 0.05 * np.arange(finder.kept) + share * finder.grid_step
        d, v = 3.0 + np.sin(4.0 * time), 4.0 * np.cos(4.0 * time)
        moved = finder.point[:, CENTRE].copy()
        here = finder.point[: finder.kept, CENTRE]
        here[:] = np.column_stack([np.log(d), np.log(np.abs(v)), v, 1.0 / d])
        squares.append(delay_fit.add_up(settings, finder, CENTRE, TISSUE.copy()))
        finder.point[:, CENTRE] = moved
    delay_fit.add_up(settings, finder, CENTRE, TISSUE.copy())
    # A larger delay is an earlier motion.
    expected = 0.5 * (squares[0] - squares[1]) / (0.02 * finder.grid_step)
    assert finder.slope[3] == pytest.approx(expected, rel=0.02)


def test_the_law_is_found():
    settings, finder = filled(noise=0.001)
    finder.law[CENTRE] = (1.0, 0.02, 1.3, 1.0)
    for _ in range(6):
        delay_fit.weigh(finder, CENTRE)
        delay_fit.improve(settings, finder, CENTRE, CENTRE, CENTRE, 6)
    assert np.array(finder.law[CENTRE]) == pytest.approx(TISSUE, rel=0.02)


def test_half_seconds_with_their_own_are_no_misfit():
    """One K leaves much; a K and a surface of each half second hardly anything."""
    settings, finder = filled(varying=True, noise=0.001)
    left = []
    for finder.varies in (0, 1):
        finder.law[CENTRE] = TISSUE
        delay_fit.weigh(finder, CENTRE)
        delay_fit.improve(settings, finder, CENTRE, CENTRE, CENTRE, 6)
        left.append(float(finder.left[CENTRE]))
    assert left[1] < 1e-2 * left[0]
    assert np.array(finder.law[CENTRE, 1:]) == pytest.approx(TISSUE[1:], rel=0.05)


def test_a_half_second_that_the_law_misses_weighs_less():
    settings, finder = filled(noise=0.001)
    finder.point_force[50:60, 0] += 0.5 * np.sin(np.arange(10))
    finder.varies = 1
    before = finder.point_force[: finder.kept, 1].copy()
    delay_fit.temper(settings, finder, CENTRE)
    share = finder.point_force[: finder.kept, 1] / before
    assert np.all(share[50:60] < 0.01)
    assert np.all(np.delete(share, np.s_[50:60]) > 0.3)


@pytest.mark.parametrize("share", [0.0, 0.3, 0.95])
def test_a_force_between_two_points_is_a_cubic(share):
    _, finder = filled()
    at = np.array([-1.0, 0.0, 1.0, 2.0])
    finder.point_forces[0] = np.polyval([0.3, -1.0, 2.0, 4.0], at)
    delay_points.shift(finder, share)
    assert finder.point_force[0, 0] == pytest.approx(np.polyval([0.3, -1.0, 2.0, 4.0], share))


def test_points_that_came_since_the_fit_weigh_as_they_would_in_it():
    """Regression of 2026-11-27: their forces were not set yet, so that they hardly had any noise.

    Of eighty drawn contacts with slow motions (0.05 to 0.15 Hz, 0.3 to 50 mm deep, positions with
    0.1 to 2 % of noise) eleven had a delay that was none, of 10 to 52 ms; four now.
    """
    settings, finder = filled(noise=0.02)
    finder.law[CANDIDATES] = TISSUE
    finder.place = CENTRE
    finder.point_force[:, 2] = 0.25
    delay_points.shift(finder, 0.0)
    expected = delay_fit.ratio_by_its_own(settings, finder, CENTRE)
    finder.point_force[100 : finder.kept, 0] = 0.0
    assert delay_fit.ratio_by_its_own(settings, finder, CENTRE) == expected
