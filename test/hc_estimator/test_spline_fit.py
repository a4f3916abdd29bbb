"""Least squares with a spline of ln K, against scipy's spline and solver, and differences."""

import numpy as np
import pytest
from scipy.interpolate import BSpline
from scipy.optimize import least_squares

import hc_estimator as hc
from hc_estimator.multiple_model import spline_fit
from hc_estimator.multiple_model.history import WIDE
from hc_estimator.multiple_model.zero_records import SPLINE_FIRST

KINDS = [spline_fit.STAYS, spline_fit.SINKS, spline_fit.VARIES]
COUNT, SPACING = 400, 0.02
NOISE = (1e-8, 1e-6)  # variances of a point's displacement [mm^2] and force [N^2]
ZERO, POSITION, SPEED = 0.05, 0.3, 0.04


def law(depth, velocity, log_stiffness, log_ratio, n, p):
    """Force of the law, written once more."""
    drag = np.exp(log_ratio) * np.sign(velocity) * np.abs(velocity) ** p
    return np.maximum(np.exp(log_stiffness) * np.maximum(depth, 0.0) ** n * (1.0 + drag), 0.0)


@pytest.fixture
def filled(records_of):
    """Settings, history and fit of a contact of a kind, and its ln K."""

    def fill(kind):
        settings, bank = records_of(hc.create_estimator("self_tuning_ukf", channel_delay=0.0))
        history, zeros = bank.history, bank.zeros
        time = SPACING * np.arange(COUNT) + 0.0137  # never quite at rest, where p < 1 has no slope
        slow, quick = 2.0 * np.pi * 1.3, 2.0 * np.pi * 2.9
        depth = 3.0 + np.sin(slow * time) + 0.3 * np.sin(quick * time)
        velocity = slow * np.cos(slow * time) + 0.3 * quick * np.cos(quick * time)
        acceleration = -(slow**2) * np.sin(slow * time) - 0.3 * quick**2 * np.sin(quick * time)
        level = np.full(COUNT, np.log(0.4))
        if kind == spline_fit.VARIES:
            level += 0.4 * np.sin(2.0 * np.pi * time / 6.0)
        speed = SPEED if kind == spline_fit.SINKS else 0.0
        history.points[:] = 0.0
        history.points[:COUNT, 0] = depth + POSITION + speed * (time - time[-1])
        history.points[:COUNT, 2] = law(depth, velocity, level, np.log(0.02), 1.5, 1.0) + ZERO
        history.points[:COUNT, 5] = velocity + speed
        history.points[:COUNT, 6] = acceleration
        history.points[:COUNT, 7] = WIDE
        history.points[:COUNT, 8] = time
        history.count, history.first = COUNT, 0
        zeros.held[spline_fit.DELAY] = 1
        assert spline_fit.lay_out(history, zeros, 0, kind)
        bank.rows[0].state[2:6] = np.log(0.6), np.log(0.06), 1.7, 0.9
        spline_fit.begin(zeros, bank.rows[0], 2)
        return settings, history, zeros, level

    return fill


def knots_of(zeros):
    return zeros.begin + zeros.knot * (np.arange(zeros.intervals + 7) - 3.0)


def test_its_splines_are_scipys(filled):
    _, _, zeros, _ = filled(spline_fit.VARIES)
    rng = np.random.default_rng(0)
    coefficients = rng.standard_normal(zeros.intervals + 3)
    values = np.zeros(zeros.values.shape)
    values[SPLINE_FIRST : SPLINE_FIRST + coefficients.size] = coefficients
    spline = BSpline(knots_of(zeros), coefficients, 3)
    for time in rng.uniform(zeros.begin, zeros.latest, 50):
        first = spline_fit.locate(zeros, time)
        assert np.sum(zeros.basis) == pytest.approx(1.0, abs=1e-12)
        found = spline_fit.log_stiffness(zeros, values, first)
        assert found == pytest.approx(float(spline(time)), abs=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_the_slope_of_its_squares_is_the_difference_of_them(kind, filled):
    settings, history, zeros, _ = filled(kind)
    spline_fit.weigh(settings, history, zeros, 0, NOISE, 1.0)
    zeros.values[spline_fit.POSITION] = 0.1
    values = np.array(zeros.values)
    spline_fit.gather(settings, history, zeros, values, 0)
    slope = -2.0 * np.array(zeros.pull)
    for i in range(SPLINE_FIRST + spline_fit.coefficients(zeros)):
        above, below = values.copy(), values.copy()
        above[i] += 1e-6
        below[i] -= 1e-6
        difference = spline_fit.gather(settings, history, zeros, above, 0)
        difference -= spline_fit.gather(settings, history, zeros, below, 0)
        scale = 1e-5 * np.abs(slope).max()
        assert slope[i] == pytest.approx(difference / 2e-6, rel=1e-4, abs=scale)


@pytest.mark.parametrize("kind", KINDS)
def test_it_finds_what_is_true(kind, filled):
    settings, history, zeros, level = filled(kind)
    squares = spline_fit.fit(settings, history, zeros, 0, NOISE, 1.0)
    assert squares < zeros.expected
    values = zeros.values
    assert values[spline_fit.POSITION] == pytest.approx(POSITION, abs=0.02)
    assert values[spline_fit.FORCE_ZERO] == pytest.approx(ZERO, abs=0.01)
    assert values[spline_fit.EXPONENT] == pytest.approx(1.5, abs=0.02)
    if kind == spline_fit.SINKS:
        assert values[spline_fit.SPEED] == pytest.approx(SPEED, abs=1e-3)
    first = spline_fit.locate(zeros, zeros.latest)
    found = spline_fit.log_stiffness(zeros, values, first)
    assert found == pytest.approx(level[-1], abs=0.03)


def test_another_solver_comes_to_the_same(filled):
    """Scipy's least squares on the same cost, with prior and roughness, in numpy."""
    settings, history, zeros, _ = filled(spline_fit.VARIES)
    history.points[:COUNT, 2] += 1e-3 * np.random.default_rng(3).standard_normal(COUNT)
    spline_fit.fit(settings, history, zeros, 0, NOISE, 1.0)
    count = SPLINE_FIRST + spline_fit.coefficients(zeros)
    free = np.flatnonzero(np.array(zeros.held[:count]) == 0)
    points = np.array(history.points[:COUNT])
    knots, guess = knots_of(zeros), np.log(settings.initial_damping / settings.initial_stiffness)
    roughness = spline_fit.SECOND_DIFFERENCE * 2e-2 * zeros.knot**3
    first_guess = (
        guess,
        settings.initial_displacement_exponent,
        settings.initial_velocity_exponent,
    )
    deviations = (
        settings.initial_damping_log_std,
        settings.initial_displacement_exponent_std,
        settings.initial_velocity_exponent_std,
    )

    def residuals(part):
        values = np.array(zeros.values)
        values[free] = part
        level = values[SPLINE_FIRST:count]
        expected = law(
            points[:, 0] - values[spline_fit.POSITION],
            points[:, 5],
            BSpline(knots, level, 3)(points[:, 8]),
            *values[[spline_fit.LOG_RATIO, spline_fit.EXPONENT, spline_fit.VELOCITY_EXPONENT]],
        )
        left = points[:, 2] - values[spline_fit.FORCE_ZERO] - expected
        return np.concatenate(
            [
                np.sqrt(points[:, 3]) * left,
                (values[:3] - first_guess) / deviations,
                np.diff(level, 2) / np.sqrt(roughness),
                (level - zeros.level) / spline_fit.LEVEL_DEVIATION,
            ]
        )

    start = np.array(zeros.values)[free]
    found = least_squares(residuals, start, x_scale="jac", xtol=1e-12, ftol=1e-12)
    spread = np.sqrt(np.diag(np.linalg.inv(found.jac.T @ found.jac)))
    assert np.all(np.abs(found.x - start) < 0.3 * spread)
    lower = np.tril(np.array(zeros.information))  # the rest is not read
    information = (lower + np.tril(lower, -1).T)[np.ix_(free, free)]
    np.testing.assert_allclose(np.sqrt(np.diag(np.linalg.inv(information))), spread, rtol=0.1)
