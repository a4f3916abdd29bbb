"""Lines between readings at regular times, against dense least squares."""

import numpy as np
import pytest

from hc_estimator.stream import linear_comb


def left_by(places, values, ratio, phase):
    """What dense least squares leaves, by degree of freedom."""
    along = (places - phase) / ratio
    knots = np.floor(along).astype(int)
    share = along - knots
    knots -= knots.min()
    matrix = np.zeros((places.size, knots.max() + 2))
    matrix[np.arange(places.size), knots] = 1.0 - share
    matrix[np.arange(places.size), knots + 1] = share
    centred = values - values.mean()
    readings = np.linalg.lstsq(matrix, centred, rcond=None)[0]
    free = places.size - matrix.shape[1]
    return np.sqrt(np.sum((centred - matrix @ readings) ** 2) / free)


@pytest.mark.parametrize("uneven", [False, True])
def test_misfits_are_those_of_dense_least_squares(uneven):
    draw = np.random.default_rng(4)
    places = np.sort(draw.uniform(0.0, 150.0, 150)) if uneven else np.arange(150.0)
    values = np.cumsum(draw.standard_normal(150))
    ratios, phases = draw.uniform(2.2, 9.0, 12), draw.uniform(0.0, 3.0, 12)
    found = linear_comb.misfits(places, values, ratios, phases)
    expected = [left_by(places, values, *comb) for comb in zip(ratios, phases, strict=True)]
    np.testing.assert_allclose(found, expected, rtol=1e-6)


def test_equations_that_are_not_positive_are_solved_all_the_same():
    """By rounding a pivot may vanish; what no sample depends on stays at zero then."""
    diagonal, beside = np.array([[1.0, 1.0, 2.0]]), np.array([[1.0, 0.0, 0.0]])
    solution = linear_comb._solve(diagonal, beside, np.array([[1.0, 1.0, 4.0]]))
    assert np.isfinite(solution).all()
    assert solution[0, 2] == 2.0
