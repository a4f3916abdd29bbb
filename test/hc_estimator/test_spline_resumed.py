"""A fit of splines goes on where the last one of its kind ended; a kind far off is not asked again."""

import math

import numpy as np
import pytest

from hc_estimator.multiple_model import (
    asked_kinds,
    spline,
    spline_descent,
    spline_resumed,
    spline_start,
)
from hc_estimator.multiple_model.spline_records import (
    BENDS,
    MOVES,
    RELAXES,
    SINKS,
    STAYS,
    STEADY,
    VARIES,
)

KINDS = [
    STAYS,
    RELAXES,
    VARIES + STEADY,
    SINKS,
    MOVES,
    VARIES,
    VARIES + BENDS,
    VARIES + SINKS,
    VARIES + MOVES,
]
COUNT, LATER = 400, 50  # points, and those of a second
NOISE = (1e-8, 1e-6, 1.0)


def solved(settings, history, fit):
    """Steps of a fit that has begun."""
    steps = 1
    spline_descent.begin(settings, fit)
    while not spline_descent.go_on(settings, history, fit, NOISE):
        steps += 1
    return steps


@pytest.fixture
def a_second_apart(filled, parts):
    """Settings, history and fit of a kind over all but the first second; the fit of one before."""

    def fill(kind):
        settings, history, fit, _ = filled(kind, with_zeros=False)
        row, kept_fit = parts[1].rows[0], parts[1].moving.kept[0]
        row.state[2:6] = np.log(0.6), np.log(0.06), 1.7, 0.9

        def lay_out(first, last):
            if kind & SINKS:
                fit.held[spline.POSITION] = 0
            assert spline.lay_out(history, fit, first, last, kind)
            spline_start.begin(settings, history, fit, row)

        lay_out(0, COUNT - LATER)
        solved(settings, history, fit)
        spline_resumed.keep(history, fit, kept_fit)
        lay_out(LATER, COUNT)
        return settings, history, fit, kept_fit

    return fill


@pytest.mark.parametrize("kind", KINDS)
def test_it_ends_where_one_from_far_off_ends_in_fewer_steps(kind, a_second_apart):
    settings, history, fit, kept_fit = a_second_apart(kind)
    anew = solved(settings, history, fit)
    squares, values = float(fit.squares), np.array(fit.values)
    settings, history, fit, kept_fit = a_second_apart(kind)
    assert spline_resumed.begin(history, fit, kept_fit)
    steps = solved(settings, history, fit)
    assert steps < anew
    assert fit.squares == pytest.approx(squares, abs=0.05 * fit.expected)
    ours = np.array(fit.values)
    for time in np.linspace(fit.begin, fit.latest, 40):
        spline.locate(fit, time)
        found, expected = (spline.log_stiffness(fit, v) for v in (ours, values))
        assert found == pytest.approx(expected, abs=0.02)
        found, expected = (spline.second(fit, v)[0] for v in (ours, values))
        assert found == pytest.approx(expected, abs=0.02)


@pytest.mark.parametrize("kind", KINDS)
def test_what_was_fitted_to_another_tissue_is_not_taken(kind, a_second_apart):
    _, history, fit, kept_fit = a_second_apart(kind)
    before = np.array(fit.values)
    history.version += 1
    assert not spline_resumed.begin(history, fit, kept_fit)
    history.version -= 1
    spline_resumed.forget(kept_fit)
    assert not spline_resumed.begin(history, fit, kept_fit)
    np.testing.assert_array_equal(fit.values, before)


def test_a_surface_of_the_last_second_is_where_the_law_turned_round_has_it(a_second_apart):
    """It was left where it had been: a millimetre off, in an organ that breathes."""
    _, history, fit, kept_fit = a_second_apart(MOVES)
    assert spline_resumed.begin(history, fit, kept_fit)
    for k in range(COUNT - LATER, COUNT - 10, 5):
        time = history.points[k]["time"]
        spline.locate(fit, time)
        moved = 0.5 * math.sin(2.0 * math.pi * time / 4.0)
        assert spline.second(fit, fit.values)[0] == pytest.approx(moved, abs=0.15)


def test_a_delay_that_is_given_by_now_is_not_that_of_the_kept_fit(a_second_apart):
    _, history, fit, kept_fit = a_second_apart(STAYS)
    kept_fit.values[spline.DELAY] = 0.001
    fit.held[spline.DELAY] = 1
    assert spline_resumed.begin(history, fit, kept_fit)
    assert fit.values[spline.DELAY] == 0.0


def test_a_kind_that_is_far_off_is_asked_again_after_some_seconds(parts):
    asked = parts[1].moving.asked
    asked_kinds.begin(asked, 3)
    assert not asked_kinds.is_ruled_out(asked, 4, 1.0)
    asked_kinds.note(asked, 4, 50.0, 1.0)
    asked_kinds.note(asked, 5, 1.1, 1.0)
    asked_kinds.note(asked, 6, math.nan, 1.0)  # broke down
    asked_kinds.begin(asked, 3)
    assert [asked_kinds.is_ruled_out(asked, k, 2.0) for k in (4, 5, 6)] == [True, False, True]
    later = 1.0 + asked_kinds.ASKED_EVERY
    assert not asked_kinds.is_ruled_out(asked, 4, later)
    asked_kinds.begin(asked, 4)  # another tissue
    assert not asked_kinds.is_ruled_out(asked, 4, 2.0)
