"""Least squares with splines of ln K, surface or exponent, against scipy and differences."""

import numpy as np
import pytest
from scipy.interpolate import BSpline
from scipy.optimize import least_squares

from hc_estimator.multiple_model import (
    spline,
    spline_descent,
    spline_fit,
    spline_outcome,
    spline_prior,
    spline_start,
)
from hc_estimator.multiple_model.hypotheses import OWN, SURFACE_ROW
from hc_estimator.multiple_model.spline_records import (
    BAND,
    BENDS,
    MOVES,
    RELAXES,
    SINKS,
    SPLINE_FIRST,
    STAYS,
    STEADY,
    VARIES,
)

KINDS = [STAYS, RELAXES, STEADY + VARIES, SINKS, VARIES, MOVES, VARIES + MOVES, VARIES + BENDS]
SHARES = np.array([0.0, 0.1, 0.15, 0.05, 0.1])  # of the force that memories take away
COUNT, SPACING = 400, 0.02
NOISE = (1e-8, 1e-6, 1.0)  # of the points; see `history.noise_of_points`
ZERO, POSITION, SPEED = 0.05, 0.3, 0.04


def law(depth, velocity, log_stiffness, log_ratio, n, p):
    """Force of the law, written once more."""
    drag = np.exp(log_ratio) * np.sign(velocity) * np.abs(velocity) ** p
    return np.maximum(np.exp(log_stiffness) * np.maximum(depth, 0.0) ** n * (1.0 + drag), 0.0)


def knots_of(fit, which=0):
    return fit.begin + fit.knot[which] * (np.arange(fit.intervals[which] + 7) - 3.0)


def test_its_splines_are_scipys(filled):
    _, _, fit, _ = filled(VARIES + MOVES)
    rng = np.random.default_rng(0)
    values = np.zeros(fit.values.shape)
    values[SPLINE_FIRST : fit.unknowns] = rng.standard_normal(fit.unknowns - SPLINE_FIRST)
    between = SPLINE_FIRST + fit.intervals[0] + 3
    stiffness = BSpline(knots_of(fit), values[SPLINE_FIRST:between], 3)
    surface = BSpline(knots_of(fit, 1), values[between : fit.unknowns], 3)
    for time in rng.uniform(fit.begin, fit.latest, 50):
        assert spline.locate(fit, time) == SPLINE_FIRST + 8
        found = spline.log_stiffness(fit, values)
        assert found == pytest.approx(float(stiffness(time)), abs=1e-12)
        position, speed = spline.second(fit, values)
        assert position == pytest.approx(float(surface(time)), abs=1e-12)
        assert speed == pytest.approx(float(surface.derivative()(time)), abs=1e-11)


@pytest.mark.parametrize("kind", KINDS)
def test_the_slope_of_its_squares_is_the_difference_of_them(kind, filled):
    settings, history, fit, _ = filled(kind)
    spline_fit.weigh(settings, history, fit, NOISE)
    fit.values[spline.POSITION] = 0.1
    values = np.array(fit.values)
    spline_fit.gather(settings, history, fit, values)
    slope = -2.0 * np.array(fit.pull)
    for i in range(fit.unknowns):
        if kind & BENDS and i == spline.EXPONENT:
            continue  # its place is taken by the spline
        above, below = values.copy(), values.copy()
        above[i] += 1e-6
        below[i] -= 1e-6
        difference = spline_fit.gather(settings, history, fit, above)
        difference -= spline_fit.gather(settings, history, fit, below)
        scale = 1e-5 * np.abs(slope).max()
        assert slope[i] == pytest.approx(difference / 2e-6, rel=1e-4, abs=scale)


def test_it_begins_where_the_law_turned_round_has_the_surface(filled, parts):
    """Regression: from the parameters of a row that was far off no fit came to an end."""
    settings, history, fit, (level, surface, exponent) = filled(MOVES, with_zeros=False)
    points = history.points[:COUNT]
    points["force"] = np.exp(level) * (points["depth"] - surface) ** exponent  # no damping
    row = parts[1].rows[0]
    row.state[2:6] = 3.0, 0.0, 0.6, 1.5
    spline_start.begin(settings, history, fit, row)
    assert fit.values[SPLINE_FIRST] == pytest.approx(level[0], abs=0.1)
    for k in range(20, COUNT - 20, 20):
        spline.locate(fit, points[k]["time"])
        assert spline.second(fit, fit.values)[0] == pytest.approx(surface[k], abs=0.15)


def test_it_begins_with_the_line_of_a_surface_that_sinks(filled):
    _, _, fit, (level, _, _) = filled(SINKS)
    assert fit.values[SPLINE_FIRST] == pytest.approx(level[0], abs=0.3)
    assert fit.values[spline.POSITION] == pytest.approx(POSITION, abs=0.2)
    assert fit.values[spline.SPEED] == pytest.approx(SPEED, abs=0.03)


def test_it_begins_with_the_row_where_no_difference_says_anything(filled, parts):
    settings, history, fit, _ = filled(MOVES, with_zeros=False)
    history.points[:COUNT]["depth"] = 2.0  # at rest
    row = parts[1].rows[SURFACE_ROW]
    row.state[2], row.state[OWN] = 0.3, 0.7
    spline_start.begin(settings, history, fit, row)
    np.testing.assert_array_equal(fit.values[SPLINE_FIRST : SPLINE_FIRST + 1], 0.3)
    np.testing.assert_array_equal(fit.values[SPLINE_FIRST + 1 : fit.unknowns], 0.7)


def test_its_step_follows_the_bend_of_the_valley(filled):
    """Regression: a tangent's step was thrice refused and then a thousand times too short."""
    settings, history, fit, _ = filled(MOVES, with_zeros=False)
    spline_prior.take_prior(settings, fit)
    spline_fit.weigh(settings, history, fit, NOISE)
    values = np.array(fit.values)

    def cost(at):
        return spline_fit.gather(settings, history, fit, at) + spline_prior.prior_cost(fit, at)

    before = cost(values)
    spline_prior.add_prior(fit, values)
    assert spline_descent.step(fit, values, 1e-3, fit.unknowns)
    straight = np.array(fit.next)
    spline_fit.follow_bend(settings, history, fit, values)
    bent = np.array(fit.next)
    assert np.any(bent != straight)
    assert cost(bent) < 0.5 * min(before, cost(straight))


def test_what_was_not_seen_since_the_latest_point_is_not_known(filled, parts):
    settings, history, fit, _ = filled(MOVES, with_zeros=False)
    spline_descent.solve_least_squares(settings, history, fit, NOISE)
    moving = parts[1].moving
    deviations = []
    for age in (0.0, 0.3):
        spline_outcome.note_outcome(fit, moving, fit.latest + age)
        deviations.append(np.sqrt(np.diag(np.array(moving.covariance))))
    walk = np.sqrt(fit.wandering[1])
    assert deviations[1][4] > walk * np.sqrt(0.3**3 / 3.0)
    assert deviations[1][5] > walk * np.sqrt(0.3)
    assert deviations[1][0] == pytest.approx(deviations[0][0])  # the tissue stays


@pytest.mark.parametrize("kind", KINDS)
def test_it_finds_what_is_true(kind, filled):
    zeros_off = kind in (STAYS, VARIES, SINKS)
    settings, history, fit, (level, surface, exponent) = filled(kind, with_zeros=zeros_off)
    squares = spline_descent.solve_least_squares(settings, history, fit, NOISE)
    assert squares < fit.expected
    values = fit.values
    if zeros_off:
        assert values[spline.POSITION] == pytest.approx(POSITION, abs=0.02)
        assert values[spline.FORCE_ZERO] == pytest.approx(ZERO, abs=0.01)
    if kind & RELAXES:
        first = SPLINE_FIRST + 1
        np.testing.assert_allclose(values[first : first + SHARES.size], SHARES, atol=0.01)
    if kind & SINKS:
        assert values[spline.SPEED] == pytest.approx(SPEED, abs=1e-3)
    spline.locate(fit, fit.latest)
    value, _ = spline.second(fit, values)
    if kind & MOVES:
        assert value == pytest.approx(surface[-1], abs=0.02)
    n = value if kind & BENDS else values[spline.EXPONENT]
    assert n == pytest.approx(exponent[-1], abs=0.02)
    assert spline.log_stiffness(fit, values) == pytest.approx(level[-1], abs=0.03)


def test_its_prior_is_the_sum_of_its_terms(filled):
    settings, _, fit, _ = filled(VARIES + MOVES, with_zeros=False)
    spline_prior.take_prior(settings, fit)
    values = np.random.default_rng(4).standard_normal(fit.values.shape)
    between = SPLINE_FIRST + fit.intervals[0] + 3
    level, surface = values[SPLINE_FIRST:between], values[between : fit.unknowns]
    walks = (spline_prior.OWN_WALKS[spline_prior.TREND_ROW, 0], spline_prior.SURFACE_WALK)
    parts = [
        (values[0] - np.log(settings.initial_damping / settings.initial_stiffness))
        / settings.initial_damping_log_std,
        (values[1] - settings.initial_displacement_exponent)
        / settings.initial_displacement_exponent_std,
        (values[2] - settings.initial_velocity_exponent) / settings.initial_velocity_exponent_std,
        *((level - fit.level) / spline_prior.LEVEL_DEVIATION),
        *(surface / np.sqrt(surface.size)),
    ]
    for which, part in enumerate((level, surface)):
        variance = spline_prior.SECOND_DIFFERENCE * walks[which] * fit.knot[which] ** 3
        parts += list(np.diff(part, 2) / np.sqrt(variance))
    expected = float(np.sum(np.square(parts)))
    assert spline_prior.prior_cost(fit, values) == pytest.approx(expected, rel=1e-10)


@pytest.mark.parametrize("kind", [STAYS, RELAXES, VARIES, VARIES + MOVES])
def test_its_evidence_is_laplaces(kind, filled):
    settings, history, fit, _ = filled(kind, with_zeros=False)
    squares = spline_descent.solve_least_squares(settings, history, fit, NOISE)
    free = np.flatnonzero(
        np.concatenate([fit.fixed == 0, np.ones(fit.unknowns - SPLINE_FIRST, bool)])
    )
    lower = np.tril(np.array(fit.information))
    posterior = (lower + np.tril(lower, -1).T)[np.ix_(free, free)]
    prior = np.zeros((fit.unknowns, fit.unknowns))
    for i in range(fit.unknowns):
        for k in range(min(BAND, i + 1)):
            prior[i, i - k] = prior[i - k, i] = fit.prior[i, k]
    prior = prior[np.ix_(free, free)]
    expected = -0.5 * (squares + spline_prior.prior_cost(fit, fit.values))
    expected -= 0.5 * (np.linalg.slogdet(posterior)[1] - np.linalg.slogdet(prior)[1])
    assert spline_prior.log_evidence(fit, squares) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(("kind", "which"), [(VARIES, 0), (MOVES, 1)])
def test_its_rates_wander_as_is_likeliest(kind, which, filled):
    """About the fit, in numpy, the evidence is largest at the wandering that it has learned."""
    settings, history, fit, _ = filled(kind, with_zeros=False)
    history.points[:COUNT]["force"] += 1e-3 * np.random.default_rng(3).standard_normal(COUNT)
    spline_descent.solve_least_squares(settings, history, fit, NOISE)
    usual = (spline_prior.OWN_WALKS[spline_prior.TREND_ROW, 0], spline_prior.SURFACE_WALK)[which]
    learned = float(fit.wandering[which])
    assert usual / spline_prior.CALMER < learned < usual * spline_prior.WILDER
    spline_fit.gather(settings, history, fit, fit.values)
    count = fit.unknowns
    free = [i for i in range(count) if i >= SPLINE_FIRST or fit.fixed[i] == 0]
    lower = np.tril(np.array(fit.seen)[:count, :count])
    seen = (lower + np.tril(lower, -1).T)[np.ix_(free, free)]
    pull = np.array(fit.pull)[free]
    away = (np.array(fit.values) - np.array(fit.guess))[free]

    def evidence(wandering):
        spline_prior.take_prior(settings, fit)
        spline_prior.add_wandering(fit, which, -1.0)
        fit.wandering[which] = wandering
        spline_prior.add_wandering(fit, which, 1.0)
        prior = np.zeros((count, count))
        for i in range(count):
            for k in range(min(BAND, i + 1)):
                prior[i, i - k] = prior[i - k, i] = fit.prior[i, k]
        prior = prior[np.ix_(free, free)]
        change = np.linalg.solve(seen + prior, pull - prior @ away)
        squares = change @ seen @ change - 2.0 * pull @ change
        cost = squares + (away + change) @ prior @ (away + change)
        return (
            -0.5 * cost
            - 0.5 * np.linalg.slogdet(seen + prior)[1]
            + (0.5 * np.linalg.slogdet(prior)[1])
        )

    here = evidence(learned)
    assert here > evidence(4.0 * learned)
    assert here > evidence(learned / 4.0)


def test_another_solver_comes_to_the_same(filled):
    """Scipy's least squares on the same cost, with prior and roughness, in numpy."""
    settings, history, fit, _ = filled(VARIES)
    history.points[:COUNT]["force"] += 1e-3 * np.random.default_rng(3).standard_normal(COUNT)
    spline_descent.solve_least_squares(settings, history, fit, NOISE)
    count = fit.unknowns
    free = [i for i in range(count) if i >= SPLINE_FIRST or fit.held[i] == 0]
    points = np.array(history.points[:COUNT])
    knots, guess = knots_of(fit), np.log(settings.initial_damping / settings.initial_stiffness)
    roughness = spline_prior.SECOND_DIFFERENCE * fit.wandering[0] * fit.knot[0] ** 3
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
        values = np.array(fit.values)
        values[free] = part
        level = values[SPLINE_FIRST:count]
        expected = law(
            points["depth"] - values[spline.POSITION],
            points["motion_velocity"],
            BSpline(knots, level, 3)(points["time"]),
            *values[[spline.LOG_RATIO, spline.EXPONENT, spline.VELOCITY_EXPONENT]],
        )
        left = points["force"] - values[spline.FORCE_ZERO] - expected
        return np.concatenate(
            [
                np.sqrt(points["weight"]) * left,
                (values[:3] - first_guess) / deviations,
                np.diff(level, 2) / np.sqrt(roughness),
                (level - fit.level) / spline_prior.LEVEL_DEVIATION,
            ]
        )

    start = np.array(fit.values)[free]
    found = least_squares(residuals, start, x_scale="jac", xtol=1e-12, ftol=1e-12)
    spread = np.sqrt(np.diag(np.linalg.inv(found.jac.T @ found.jac)))
    assert np.all(np.abs(found.x - start) < 0.3 * spread)
    lower = np.tril(np.array(fit.information))  # the rest is not read
    information = (lower + np.tril(lower, -1).T)[np.ix_(free, free)]
    np.testing.assert_allclose(np.sqrt(np.diag(np.linalg.inv(information))), spread, rtol=0.1)
