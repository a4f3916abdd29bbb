"""The places that are drawn differ in what they should, and in nothing else."""

import numpy as np
import pytest

from hc_evaluation.accuracy.drawn_places import KINDS, drawn_places

SEEDS = (1000, 1003, 1007, 1011, 1012)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("kind", KINDS)
def test_what_differs_is_what_is_said(kind, seed):
    contact = drawn_places(kind, seed)
    again = drawn_places(kind, seed)
    np.testing.assert_array_equal(contact.force_n, again.force_n)
    count = int(contact.place[-1]) + 1
    assert count >= 4
    first = [np.flatnonzero(contact.place == i)[0] for i in range(count)]
    differs = (contact.parameters[first, 0], contact.parameters[first, 2])
    assert [np.ptp(values) > 0.0 for values in (*differs, contact.surface_mm[first])] == list(
        KINDS[kind]
    )
    assert contact.surface_mm[0] == 0.0


@pytest.mark.parametrize("seed", SEEDS)
def test_every_place_is_touched_and_left_before_the_next(seed):
    contact = drawn_places("all", seed)
    last = int(contact.place[-1])
    for place in range(last + 1):
        here = contact.place == place
        assert np.max(contact.depth_mm[here]) > 1.5
        assert contact.depth_mm[here][0] < 0.0
        assert place == last or contact.depth_mm[here][-1] < 0.0
    # Tissue cannot pull: what is read below zero is noise.
    assert np.min(contact.force_n) > -0.2 * np.max(contact.force_n)
    outside = contact.depth_mm < 0.0
    assert abs(np.mean(contact.force_n[outside])) < 0.01 * np.max(contact.force_n)
