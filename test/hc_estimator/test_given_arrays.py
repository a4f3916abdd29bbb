"""What users of Python give as readings: the numbers that they mean, or one line."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

import hc_estimator as hc
from hc_estimator.given_arrays import as_numbers

Columns = tuple[Any, Any, Any]


@pytest.fixture(scope="module")
def press() -> Columns:
    """Two seconds of presses at 500 Hz."""
    time_s = np.arange(0.0, 2.0, 0.002)
    depth = 1.0 - np.cos(2.0 * np.pi * time_s)
    return time_s, depth, 0.4 * depth**1.5


def strided(values: Any) -> Any:
    return np.repeat(values, 3)[::3]


def read_only(values: Any) -> Any:
    copy = values.copy()
    copy.setflags(write=False)
    return copy


@pytest.mark.parametrize(
    "given",
    [list, tuple, strided, read_only, lambda a: a[::-1].copy()[::-1], lambda a: a.astype(">f8")],
)
def test_the_same_numbers_in_another_form(press: Columns, given: Callable[[Any], Any]) -> None:
    wanted = hc.create_estimator("ekf").run(*press).parameters[-1]
    found = hc.create_estimator("ekf").run(*map(given, press)).parameters[-1]
    np.testing.assert_array_equal(found, wanted)


def test_what_is_masked_is_missing(press: Columns) -> None:
    """Regression: the readings beneath the mask were taken, without a word."""
    time_s, depth, force = press
    hidden = np.arange(len(depth)) % 5 == 3
    spoilt = np.where(hidden, 7.0, depth)
    wanted = hc.create_estimator("ekf").run(time_s, np.where(hidden, np.nan, depth), force)
    masked = np.ma.masked_array(spoilt, hidden)
    found = hc.create_estimator("ekf").run(time_s, masked, force)
    np.testing.assert_array_equal(found.parameters, wanted.parameters)
    channels = hc.EstimatorArray("ekf", 1).run(time_s, masked[None], force[None])
    np.testing.assert_array_equal(channels.parameters[0], wanted.parameters)


def test_what_a_table_lacks_is_missing() -> None:
    class NAType:
        """As that of pandas."""

    given = np.array([1, None, NAType(), Fraction(1, 2)], object)
    np.testing.assert_array_equal(as_numbers("force_n", given), [1.0, np.nan, np.nan, 0.5])


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda t: np.datetime64("2026-01-01") + t, r"time_s holds dates: give seconds, \(t - t"),
        (lambda t: t, "time_s holds durations: give seconds, t / np.timedelta64"),
        (lambda t: t.astype(np.int64) * 1j, "time_s holds complex numbers"),
        (iter, "time_s holds what is no number"),
    ],
)
def test_dates_are_no_seconds(press: Columns, make: Callable[[Any], Any], said: str) -> None:
    """Regression: nanoseconds passed for seconds, and K came out as .403 +- .065 for .4000."""
    stamps = (1e9 * press[0]).astype("timedelta64[ns]")
    with pytest.raises(TypeError, match=said):
        hc.create_estimator("ekf").run(make(stamps), *press[1:])
    with pytest.raises(TypeError, match=said):
        hc.EstimatorArray("ekf", 1).run(make(stamps), *(column[None] for column in press[1:]))


@pytest.mark.parametrize("large", [10**400, -(10**400)])
def test_a_number_that_no_float_holds_is_a_refused_reading(large: int) -> None:
    """Regression: OverflowError, int too large to convert to float."""
    np.testing.assert_array_equal(as_numbers("force_n", [1, large]), [1.0, np.sign(large) * np.inf])
    channels = hc.EstimatorArray("ekf", 2)
    assert all(channels.step(large, [1.0, 1.0], [0.1, 0.1]).rejected)
    rejected = channels.step(1.0, [1.0, large], [0.1, 0.1]).rejected
    assert [bool(reason) for reason in rejected] == [False, True]


@pytest.mark.parametrize("given", [["1.0", "a"], [[1.0], [1.0, 2.0]]])
def test_what_is_no_number_is_said_of_which_argument(given: Any) -> None:
    with pytest.raises(ValueError, match=r"^force_n h"):
        as_numbers("force_n", given)


def test_arrays_for_step_are_one_line(press: Columns) -> None:
    """Regression: "The requested array would exceed the maximum number of dimension of 1"."""
    with pytest.raises(TypeError, match="step takes three numbers, run takes arrays"):
        hc.create_estimator("ekf").step(*press)


def test_one_channel_in_the_wrong_form_says_the_right_one(press: Columns) -> None:
    """Regression: of a column it was said that its shape is to be (1, 1)."""
    time_s, depth, force = press
    for turned in (depth[:, None], depth):
        with pytest.raises(ValueError, match=r"give \(channels, samples\), 1 and any number"):
            hc.EstimatorArray("ekf", 1).run(time_s, turned, force[None])
    with pytest.raises(ValueError, match=r"channel = 0.0 is not one from 0 to 0"):
        hc.EstimatorArray("ekf", 1).reset(0.0)  # type: ignore[arg-type]
