"""The delay between the channels in the least squares with splines of `test_spline_fit.py`."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from hc_estimator.multiple_model import (
    moving_delay,
    spline,
    spline_descent,
    spline_fit,
    spline_prior,
)
from hc_estimator.multiple_model.spline_records import MOVES, STAYS

COUNT, SPACING = 400, 0.02  # of the points of `filled` (conftest.py)
NOISE = (1e-8, 1e-6, 1.0)  # of the points; see `history.noise_of_points`


def test_a_delay_that_averages_positions_is_expected_to_leave_less(filled):
    """Regression: half of their noise was taken for a delay of half the way between two points."""
    settings, history, fit, _ = filled(MOVES, with_zeros=False)
    fit.held[spline.DELAY] = 0
    fit.spacing = SPACING
    noise = (1e-4, 1e-6, 1.0)
    spline_fit.weigh(settings, history, fit, noise)
    whole = fit.expected
    assert fit.averaged == 0.0
    fit.values[spline.DELAY] = 0.5 * SPACING
    spline_fit.weigh(settings, history, fit, noise)
    assert fit.expected < 0.6 * whole
    assert fit.expected + fit.averaged == pytest.approx(whole, rel=0.05)


def test_what_is_late_in_step_costs_what_its_posterior_says(filled):
    """Savage and Dickey's ratio: the same evidence with the delay held at none."""
    settings, history, fit, _ = filled(STAYS, with_zeros=False)
    fit.held[spline.DELAY] = 0
    noise = (1e-7, 1e-5, 1.0)
    points = history.points[:COUNT]
    points["force"] += 1e-3 * np.random.default_rng(3).standard_normal(COUNT)
    evidence = []
    for held in (0, 1):
        fit.held[spline.DELAY] = held
        fit.values[spline.DELAY] = 0.0
        squares = spline_descent.solve_least_squares(settings, history, fit, noise)
        cost = moving_delay.cost_of_none(fit)
        evidence.append(spline_prior.log_evidence(fit, squares) - cost)
    assert evidence[0] == pytest.approx(evidence[1], abs=0.05)


@pytest.mark.parametrize("late", [0.0093, -0.0093, 0.005, -0.0185])
def test_a_delay_between_two_points_is_found(late, filled):
    """Regression: by a Taylor series over half of 20 ms a delay of 9.3 ms was 8.3."""
    settings, history, fit, _ = filled(MOVES, with_zeros=False)
    points = history.points[:COUNT]
    force = CubicSpline(points["time"], points["force"])
    history.points[:COUNT]["force"] = force(points["time"] - late)
    fit.held[spline.DELAY] = 0
    assert spline.lay_out(history, fit, 1, COUNT - 1, MOVES)  # no spline goes beyond its ends
    fit.spacing = SPACING
    fit.delay_deviation = 0.03
    squares = spline_descent.solve_least_squares(settings, history, fit, NOISE)
    assert squares < fit.expected
    assert fit.values[spline.DELAY] == pytest.approx(late, abs=1e-4)
