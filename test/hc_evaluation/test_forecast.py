"""Forecasts keep their word: the motion that they ask for gives what they promise."""

import numpy as np
import pytest

from hc_estimator.contact.arrays import force_gradient
from hc_estimator.contact.hunt_crossley import hunt_crossley_force
from hc_evaluation.forecast import NAMES, WANTED, forecast, stroke

TISSUE = np.array([0.5, 0.05, 1.5, 1.0])
NOISE = 0.02


def covariance(**deviations):
    values = {"K": 0.01, "B": 0.002, "n": 0.01, "p": 0.02} | deviations
    return np.diag([values[name] ** 2 for name in NAMES])


def test_sensitivities_are_the_derivatives_of_the_law():
    depth, speed = stroke(3.0, 8.0, 200.0)
    rows = force_gradient(depth, speed, TISSUE)[:, 2:]
    for i in range(4):
        step = 1e-6
        high, low = TISSUE.copy(), TISSUE.copy()
        if i < 2:
            high[i] *= np.exp(step)
            low[i] *= np.exp(-step)
        else:
            high[i] += step
            low[i] -= step
        pairs = list(zip(depth, speed, strict=True))
        difference = [
            max(hunt_crossley_force(d, v, *high), 0.0) - max(hunt_crossley_force(d, v, *low), 0.0)
            for d, v in pairs
        ]
        np.testing.assert_allclose(rows[:, i], np.array(difference) / (2 * step), atol=1e-6)


def test_what_is_known_needs_no_motion():
    assert forecast(TISSUE, covariance(), force_noise_std=NOISE, depth_mm=3, rate_hz=500) == []


@pytest.mark.parametrize(("name", "deviation"), [("K", 0.2), ("B", 0.05), ("n", 0.3), ("p", 0.5)])
def test_a_motion_gives_what_was_promised(name, deviation):
    """Least squares on noisy strokes of the kind asked for, started from what was known."""
    known = covariance(**{name: deviation})
    found = forecast(TISSUE, known, force_noise_std=NOISE, depth_mm=3.0, rate_hz=500.0)
    (plan,) = found
    index = NAMES.index(name)
    assert plan.parameter == name
    assert plan.std <= WANTED[index]
    assert plan.parameter in plan.sentence
    errors = []
    scale = np.array([TISSUE[0], TISSUE[1], 1.0, 1.0])
    prior = np.linalg.inv(known / np.outer(scale, scale))
    generator = np.random.default_rng(2)
    for _ in range(200):
        rows, noise = [], []
        for k in range(plan.strokes):
            speed = plan.speeds_mm_s[k % len(plan.speeds_mm_s)]
            rows.append(force_gradient(*stroke(3.0, speed, 500.0), TISSUE)[:, 2:] / NOISE)
            noise.append(generator.standard_normal(len(rows[-1])))
        matrix = np.concatenate(rows)
        offset = np.linalg.cholesky(np.linalg.inv(prior)) @ generator.standard_normal(4)
        information = prior + matrix.T @ matrix
        error = np.linalg.solve(information, matrix.T @ np.concatenate(noise) + prior @ offset)
        errors.append(error[index])
    assert np.std(errors) == pytest.approx(plan.std, rel=0.25)


def test_a_fast_stroke_is_asked_for_where_only_speed_tells():
    found = forecast(
        TISSUE, covariance(B=0.05, p=1.0), force_noise_std=0.1, depth_mm=3.0, rate_hz=500.0
    )
    assert {f.parameter for f in found} == {"B", "p"}
    slow = forecast(
        TISSUE,
        covariance(B=0.05, p=1.0),
        force_noise_std=0.1,
        depth_mm=3.0,
        rate_hz=500.0,
        fastest_mm_s=1.0,
    )
    strokes = {f.parameter: f.strokes for f in found}
    assert all(f.strokes > strokes[f.parameter] for f in slow if f.parameter == "p")
    assert all(max(f.speeds_mm_s) <= 1.0 for f in slow)


def test_without_a_start_there_is_no_forecast():
    nothing = np.full((4, 4), np.nan)
    assert forecast(TISSUE, nothing, force_noise_std=NOISE, depth_mm=3.0, rate_hz=500.0) == []
    assert forecast(TISSUE, covariance(), force_noise_std=NOISE, depth_mm=0.0, rate_hz=500.0) == []


def test_stamps_of_nanoseconds_do_not_fill_the_memory():
    """Regression: `hc doctor` took 5 GB for strokes at the rate that such stamps seem to have."""
    known = covariance(p=0.5)
    options = {"force_noise_std": NOISE, "depth_mm": 3.0}
    (usual,) = forecast(TISSUE, known, rate_hz=500.0, **options)
    (fast,) = forecast(TISSUE, known, rate_hz=1e12, **options)
    assert fast.std < usual.std
    # Ten times the samples say as much as samples of a tenth of the variance.
    (tenfold,) = forecast(TISSUE, known, rate_hz=1e6, **options)
    (quiet,) = forecast(TISSUE, known, rate_hz=1e5, force_noise_std=NOISE / 10**0.5, depth_mm=3.0)
    assert tenfold.std == pytest.approx(quiet.std, rel=1e-3)
    for rate_hz in (0.0, np.nan, np.inf):
        assert forecast(TISSUE, known, rate_hz=rate_hz, **options) == []


def test_what_is_no_covariance_gives_no_forecast():
    """Regression: a singular matrix was an internal error of `hc doctor`."""
    known = np.outer([0.5, 0.05, 1.0, 1.0], [0.5, 0.05, 1.0, 1.0]) * 1e200
    assert forecast(TISSUE, known, force_noise_std=NOISE, depth_mm=3.0, rate_hz=500.0) == []
