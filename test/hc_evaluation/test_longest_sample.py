"""How long single samples take: shares of the time between readings; the collector as it was."""

import gc

import numpy as np

from hc_evaluation import longest_sample


def test_each_sample_has_a_share_of_the_time_between_readings():
    assert gc.isenabled()
    shares = longest_sample.sample_times(passes=1, samples=300)
    assert gc.isenabled()
    assert shares.shape == (300,)
    assert np.isfinite(shares).all()
    assert (shares > 0.0).all()


def test_figures_are_percentiles_in_percent(monkeypatch):
    times = np.arange(1.0, 1001.0) / 1000.0
    monkeypatch.setattr(longest_sample, "sample_times", lambda: times)
    figures = longest_sample.longest_samples()
    assert figures["varying_longest_percent"] == 100.0
    assert figures["varying_p50_percent"] == np.percentile(100.0 * times, 50.0)
    assert figures["varying_p99_percent"] == np.percentile(100.0 * times, 99.0)
    assert figures["varying_p99_9_percent"] == np.percentile(100.0 * times, 99.9)
