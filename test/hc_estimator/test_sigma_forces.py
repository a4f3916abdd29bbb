"""Forces at all sigma points at once are those of the measurement function, point by point."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hc_estimator.contact.registry import ADHESIVE, HUNT_CROSSLEY
from hc_estimator.state_space import kinematic
from hc_estimator.state_space.sigma_forces import measure_sigma_points

SPREAD = np.sqrt(7.0)


def both(model, center, factor):
    """Outputs of the 15 points, shape (15, 2): at once, and one by one."""
    at_once, one_by_one = np.empty((15, 2)), np.empty((15, 2))
    measure_sigma_points(model, center, factor @ factor.T, factor, SPREAD, at_once)
    points = [center, *(center + SPREAD * factor.T), *(center - SPREAD * factor.T)]
    for point, result in zip(points, one_by_one, strict=True):
        kinematic.measure(model, point, result)
    return at_once, one_by_one


@pytest.mark.parametrize("model", [HUNT_CROSSLEY, ADHESIVE])
@given(seed=st.integers(0, 2**32 - 1), size=st.sampled_from([1e-6, 1e-2, 1.0, 30.0]))
def test_all_points_at_once_are_the_points_one_by_one(model, seed, size):
    """In the air, at rest, at the limits of the exponents and of ln K as well."""
    rng = np.random.default_rng(seed)
    center = np.array([3.0, 20.0, 10.0, -1.6, -4.7, 1.8, 1.05])
    center += size * rng.standard_normal(7) * [1.0, 10.0, 10.0, 1.0, 1.0, 0.3, 0.3]
    center[rng.integers(7)] = rng.choice([0.0, -1.0, 1e-310, 60.0, 3.9999])
    factor = size * np.tril(rng.standard_normal((7, 7)))
    factor[:, rng.integers(7)] = 0.0  # a parameter that is held fixed
    at_once, one_by_one = both(model, center, factor)
    np.testing.assert_allclose(at_once, one_by_one, rtol=1e-11, atol=1e-300)


def test_saturated_forces_stay_finite():
    center = np.array([1e300, 1e300, 0.0, 50.0, 50.0, 4.0, 3.0])
    at_once, one_by_one = both(HUNT_CROSSLEY, center, np.tril(np.ones((7, 7))))
    assert np.isfinite(at_once).all()
    np.testing.assert_allclose(at_once, one_by_one, rtol=1e-11)
