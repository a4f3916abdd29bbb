"""Recordings that go through an estimator piece by piece give the numbers of one call."""

import numpy as np
import pytest

from hc_estimator import create_estimator
from hc_estimator.stream.in_pieces import PIECE, run_in_pieces


def presses(count):
    time_s = np.arange(count) * 1e-3
    depth = 1.5 + 2.2 * np.sin(2.1 * time_s) + 0.5 * np.sin(13.0 * time_s)
    force = 0.5 * np.maximum(depth, 0.0) ** 1.5
    generator = np.random.default_rng(1)
    force[::7] = np.nan  # a force that is missing now and then
    return time_s, depth + generator.normal(0.0, 0.002, count), force


@pytest.mark.parametrize("filter", ["self_tuning_ukf", "raukf"])
@pytest.mark.parametrize("count", [0, 1, PIECE, 2 * PIECE + 17])
def test_pieces_are_the_whole_to_the_last_bit(filter, count):
    readings = presses(count)
    whole = create_estimator(filter, missing_readings=True).run(*readings)
    pieces = run_in_pieces(create_estimator(filter, missing_readings=True), *readings)
    np.testing.assert_array_equal(pieces.values, whole.values)


def test_lengths_that_differ_are_refused_as_in_one_call():
    estimator = create_estimator("raukf")
    for columns in ((5, 5, 4), (PIECE, PIECE, PIECE + 1)):
        with pytest.raises(ValueError, match="give three one-dimensional arrays of one length"):
            run_in_pieces(estimator, *map(np.zeros, columns))
