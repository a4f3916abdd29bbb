"""Quantiles of durations from fixed bins."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hc_msgs_py.histogram import DurationHistogram

durations = st.lists(st.integers(0, 10**10), min_size=1, max_size=300)


def filled(values):
    histogram = DurationHistogram()
    for value in values:
        histogram.add(value)
    return histogram


@given(durations, st.floats(0.0, 1.0))
def test_a_quantile_is_within_one_percent_of_the_exact_one(values, fraction):
    exact = np.quantile(values, fraction, method="inverted_cdf")
    assert filled(values).quantile_ns(fraction) == pytest.approx(exact, rel=0.008, abs=0.5)


@given(durations, durations)
def test_merging_equals_counting_together(first, second):
    merged = filled(first)
    merged.merge(filled(second))
    together = filled(first + second)
    assert merged._bins == together._bins
    assert merged.maximum_ns == together.maximum_ns == max(first + second)
    assert merged.count == together.count


@given(st.lists(st.integers(-10, 2**63 - 1), max_size=300))
def test_many_at_once_count_as_one_by_one(values):
    histogram = DurationHistogram()
    histogram.add_many(np.array(values, np.int64))
    one_by_one = filled(values)
    assert histogram._bins == one_by_one._bins
    assert histogram.maximum_ns == one_by_one.maximum_ns
    assert histogram.count == len(values)


def test_seconds_are_counted_whatever_they_are():
    histogram = DurationHistogram()
    for seconds in (-1.0, float("nan"), 0.0, 2.5e-4, 2.0, 1e300, float("inf")):
        histogram.add_s(seconds)
    assert histogram.count == 7
    assert histogram.quantile_s(0.4) == 0.0
    assert histogram.quantile_s(4 / 7) == pytest.approx(2.5e-4, rel=0.008)
    assert histogram.maximum_s == 1e9


def test_shares_between_edges():
    histogram = filled([5, 1000, 1000, 10**6, 10**9])
    assert histogram.between(np.array([100, 10**5, 10**8])).tolist() == [1, 2, 1, 1]
    assert DurationHistogram().between(np.array([100])).tolist() == [0, 0]


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
