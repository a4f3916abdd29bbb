"""A recording under treatment is estimated once for each state that it is in."""

import dataclasses

import numpy as np
import pytest

from hc_bringup import treated_samples
from hc_bringup.treated_samples import Samples


@pytest.fixture
def runs(monkeypatch):
    """How often the estimator was run."""
    counted, run = [], treated_samples.run_in_pieces

    def counting(*words):
        counted.append(words)
        return run(*words)

    monkeypatch.setattr(treated_samples, "run_in_pieces", counting)
    return counted


def pressed():
    time_s = np.arange(0.0, 6.0, 0.002)
    depth = 2.0 - 3.0 * np.cos(2.0 * time_s)
    return Samples(time_s, depth, 0.4 * np.maximum(depth, 0.0) ** 1.5, 0.0)


def test_the_estimator_runs_anew_only_where_something_is_another(runs):
    """A doctor of ten minutes ran it two times of eleven over what it had just been over."""
    samples = pressed()
    first = samples.estimate()
    assert samples.estimate() is first
    assert dataclasses.replace(samples).estimate() is first
    assert len(runs) == 1
    changes = (
        lambda: samples.shift_force(0.004),
        lambda: samples.scale_force(2.0),
        lambda: samples.take_force_zero(0.1),
        lambda: setattr(samples, "surface_std_mm", 0.1),
        lambda: setattr(samples, "channel_delay", 0.002),
        lambda: setattr(samples, "force_end_n", 5.0),
        lambda: setattr(samples, "displacement_mm", samples.displacement_mm - 0.1),
    )
    for number, change in enumerate(changes, 2):
        change()
        anew = samples.estimate()
        assert samples.estimate() is anew
        assert len(runs) == number
    fresh = dataclasses.replace(samples, _estimated=None).estimate()
    np.testing.assert_array_equal(fresh.parameters, anew.parameters)
    assert len(runs) == number + 1
