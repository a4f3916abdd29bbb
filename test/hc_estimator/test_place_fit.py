"""Least squares over one contact, K to rate, against scipy: the fit, and its evidence."""

import numpy as np
import pytest
from scipy.optimize import minimize

from hc_estimator.multiple_model import place_fit, place_prior

TISSUE = np.array([np.log(0.4), np.log(0.05), 1.7, 0.8])
SHARE = 1.5  # see `history.noise_of_points`
NOISE = (4e-6, 1e-4, SHARE)
VELOCITY_NOISE = 0.09  # variance of a point's velocity by its share in the information [mm^2/s^2]
COUNT = 24


def law(values, depth, velocity):
    """Force of the law at a height of its own, written once more."""
    log_stiffness, log_damping, n, p, position = values
    drag = np.exp(log_damping) * np.sign(velocity) * np.abs(velocity) ** p
    return np.maximum(depth - position, 0.0) ** n * (np.exp(log_stiffness) + drag)


@pytest.fixture
def contact(parts):
    """Settings, place and history of a press that comes to rest, its force with noise."""
    settings, bank = parts
    place, history = bank.place, bank.history
    share = np.linspace(0.1, 0.9, COUNT)
    depth, velocity = 0.3 + 3.0 * share, 12.0 * (1.0 - share) + 0.5
    history.points[:COUNT]["depth"], history.points[:COUNT]["velocity"] = depth, velocity
    history.velocity_noise[0] = VELOCITY_NOISE
    history.velocity_std[0] = np.sqrt(SHARE * VELOCITY_NOISE)
    place.first, place.last = 0, COUNT
    place.before[:4] = TISSUE
    place.before_covariance[:4, :4] = np.diag([0.1, 0.1, 0.05, 0.05]) ** 2
    force = law([*TISSUE, 0.0], depth, velocity)
    history.points[:COUNT]["force"] = force + 0.02 * np.random.default_rng(11).standard_normal(
        COUNT
    )
    return settings, place, history


def fitted(settings, place, history):
    """Squares of a fit with the prior of another place, from the truth on."""
    place_prior.set_other(place, 0.5**2)
    place.values[:] = place.guess
    return place_fit.fit(settings, place, history, NOISE, 1.0, 3)


def cost_by(place, history, values):
    """Squares of the points by their weights, and of the distance from the prior."""
    points = history.points[:COUNT]
    depth, velocity, force, weight = (
        points[name] for name in ("depth", "velocity", "force", "weight")
    )
    off = np.array([*values, 0.0, 0.0]) - place.guess
    squares = weight * (force - law(values, depth, velocity)) ** 2
    return np.sum(squares), off @ place.prior @ off


def test_the_fit_is_the_least_of_its_cost(contact):
    settings, place, history = contact
    squares = fitted(settings, place, history)
    least = minimize(
        lambda values: sum(cost_by(place, history, values)),
        place.values[:5],
        method="Nelder-Mead",
        options={"xatol": 1e-7, "fatol": 1e-9, "maxiter": 20000, "maxfev": 20000},
    )
    by_points, by_prior = cost_by(place, history, place.values[:5])
    assert squares == pytest.approx(by_points, rel=1e-9)
    assert by_points + by_prior == pytest.approx(least.fun, rel=2e-3)


def test_the_evidence_counts_the_weights_of_the_fit_itself(contact):
    """Regression of 2026-11-27: it held for one law's weights, and was asked of two laws' fits."""
    settings, place, history = contact
    squares = fitted(settings, place, history)
    evidence = place_fit.log_evidence(settings, place, history, squares, 1.0, SHARE)
    weights = history.points[:COUNT]["weight"]
    by_points, by_prior = cost_by(place, history, place.values[:5])
    expected = by_points - SHARE * np.sum(np.log(weights)) + by_prior
    expected += np.linalg.slogdet(place.information[:5, :5])[1]
    expected -= np.linalg.slogdet(place.prior[:5, :5])[1]
    assert evidence == pytest.approx(-0.5 * expected, rel=1e-9)


def test_a_force_that_is_late_by_whole_points_belongs_to_the_motion_before(contact):
    settings, place, history = contact
    spacing, late = 0.01, 3
    history.points[:COUNT]["source"] = 1.0  # the motion is known
    history.points[:COUNT]["time"] = spacing * np.arange(COUNT)
    in_step = history.points[:COUNT].copy()
    place.spacing = spacing
    place.last = COUNT - late
    squares = fitted(settings, place, history)
    values = place.values.copy()
    history.points[late:COUNT]["force"] = in_step[: COUNT - late]["force"]
    place.last = COUNT
    place.shift = late
    assert fitted(settings, place, history) == pytest.approx(squares, rel=1e-9)
    np.testing.assert_allclose(place.values, values, rtol=1e-9)
    assert np.all(history.points[:late]["weight"] == 0.0)  # nobody knows where the tool was then


SPACING = 0.04


def stiffened(contact, rate):
    """A press, a rest and back on tissue whose K and B change by a rate [1/s] beneath the tool.

    Without a rest a rate looks like damping: both are what differs between there and back.
    """
    settings, place, history = contact
    points, time = history.points[:COUNT], SPACING * np.arange(COUNT)
    corners = np.array([-0.2, 0.35, 0.65, 1.2]) * time[-1]
    depth = np.interp(time, corners, [0.0, 3.0, 3.0, 0.0])
    speed = 3.0 / (corners[1] - corners[0])
    velocity = np.select([time < corners[1], time > corners[2]], [speed, -speed], 0.0)
    points["depth"], points["velocity"], points["time"] = depth, velocity, 5.0 + time
    force = law([*TISSUE, 0.0], depth, velocity) * np.exp(rate * time)
    points["force"] = force + 0.01 * np.random.default_rng(3).standard_normal(COUNT)
    place.square_rate = 0.5**2
    return settings, place, history


@pytest.mark.parametrize("rate", [-0.8, 0.6])
def test_a_tissue_that_varies_along_the_way_is_known_where_the_tool_is_now(rate, contact):
    settings, place, history = stiffened(contact, rate)
    fitted(settings, place, history)
    assert place.values[place_fit.RATE] == pytest.approx(rate, abs=0.15)
    place_fit.note_covariance(settings, place)
    at_first = place.values[:2].copy()
    covariance = place.covariance.copy()
    place_fit.carry(place, history, place.values, place.covariance)
    gone = SPACING * (COUNT - 1)
    np.testing.assert_allclose(place.values[:2], at_first + gone * place.values[place_fit.RATE])
    error = place.values[0] - (TISSUE[0] + rate * gone)
    assert abs(error) < 3.0 * np.sqrt(place.covariance[0, 0])
    way = np.eye(place_fit.UNKNOWNS)
    way[:2, place_fit.RATE] = gone
    np.testing.assert_allclose(place.covariance, way @ covariance @ way.T, rtol=1e-9, atol=1e-15)


def test_a_tissue_that_varies_explains_the_press_without_another_place(contact):
    """Regression of 2026-11-30: what the rate made of the force was another exponent."""
    settings, place, history = stiffened(contact, 0.8)
    evidence = {}
    for square in (0.0, 0.5**2):
        place.square_rate = square
        place_prior.set_same(place)
        place.values[:] = place.guess
        squares = place_fit.fit(settings, place, history, NOISE, 1.0, 3)
        evidence[square] = place_fit.log_evidence(settings, place, history, squares, 1.0, SHARE)
    assert evidence[0.25] > evidence[0.0] + 20.0
    np.testing.assert_allclose(place.values[2:4], TISSUE[2:4], atol=0.05)


def test_a_rate_of_a_fit_before_does_not_stay(contact):
    settings, place, history = contact
    squares = fitted(settings, place, history)
    values = place.values.copy()
    place.values[place_fit.RATE] = 0.7
    # The weights are those of the law found before: not quite the same.
    assert place_fit.fit(settings, place, history, NOISE, 1.0, 3) == pytest.approx(
        squares, rel=0.01
    )
    assert place.values[place_fit.RATE] == 0.0
    np.testing.assert_allclose(place.values, values, atol=0.02)
