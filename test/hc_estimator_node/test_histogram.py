"""Quantiles of durations from fixed bins."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hc_estimator.online.histogram import DurationHistogram

durations = st.lists(st.integers(0, 10**10), min_size=1, max_size=300)


def filled(values):
    histogram = DurationHistogram()
    for value in values:
        histogram.add(value)
    return histogram


@given(durations, st.floats(0.0, 1.0))
def test_a_quantile_is_within_a_thirty_second_of_the_exact_one(values, fraction):
    exact = np.quantile(values, fraction, method="inverted_cdf")
    assert filled(values).quantile_ns(fraction) == pytest.approx(exact, rel=1 / 32, abs=0.5)


@given(durations, durations)
def test_merging_equals_counting_together(first, second):
    merged = filled(first)
    merged.merge(filled(second))
    together = filled(first + second)
    assert merged._bins == together._bins
    assert merged.maximum_ns == together.maximum_ns == max(first + second)
    assert merged.count == together.count


def test_extremes_count_without_harm():
    histogram = filled([-5, 0, 2**60])
    assert histogram.count == 3
    assert histogram.maximum_ns == 2**60
    assert histogram.quantile_ns(0.0) == 0.0


def test_nothing_counted_has_no_quantile_and_clear_forgets():
    histogram = filled([7, 8])
    histogram.clear()
    assert np.isnan(histogram.quantile_ns(0.5))
    assert histogram.maximum_ns == 0


def test_a_fraction_outside_zero_to_one_is_refused():
    with pytest.raises(ValueError, match=r"fraction = 1\.5"):
        filled([1]).quantile_ns(1.5)
