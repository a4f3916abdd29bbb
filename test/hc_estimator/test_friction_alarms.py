"""Friction in drawn contacts: none is named where something else is wrong, most is found."""

import numpy as np
import pytest
from presses_from_air import TROUBLES, readings

from hc_estimator.stream.friction_checks import find_friction
from hc_estimator.stream.readings import whole

SEEDS = range(20)


@pytest.mark.parametrize("trouble", TROUBLES)
def test_none_is_named_where_there_is_none(trouble):
    for seed in SEEDS:
        place, with_friction, _ = readings(trouble, seed)
        assert whole(find_friction(place, with_friction(0.0))) is None, seed


@pytest.mark.parametrize("trouble", TROUBLES)
def test_most_is_found_where_there_is_one(trouble):
    """Of 5 % of the largest force; presses of a slow sensor, and a short way, show none."""
    found = []
    for seed in SEEDS:
        place, with_friction, contact = readings(trouble, seed)
        one = whole(find_friction(place, with_friction(0.05)))
        found.append(0.0 if one is None else one.newtons / (0.05 * contact["most"]))
    right = np.abs(np.array(found) - 1.0) < 0.25
    assert np.count_nonzero(right) >= 0.3 * len(SEEDS)
    wrong = np.count_nonzero(~right & (np.array(found) > 0.0))
    assert wrong <= 0.1 * len(SEEDS)
