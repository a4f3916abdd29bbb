"""A tissue that was let go of for long: the fit to all that was felt goes on, or what drifts does.

Regression of 2026-11, on the real press of `palpation_press_triangle.csv`: the row that drifts had
followed the tissue as it relaxed and let go, to n = 2.3 where the whole press says 1.65, and
foretold three times the force of the next press.
"""

import numpy as np
import pytest

import hc_estimator as hc
from hc_estimator.contact.arrays import hunt_crossley_force
from hc_estimator.estimate import Hypothesis
from hc_estimator.multiple_model import lift_off
from hc_estimator.multiple_model.history import WIDE
from hc_estimator.multiple_model.hypotheses import (
    EXPONENT_ROW,
    FITTED,
    LOG_STIFFNESS,
    SURFACE_ROW,
    TREND_ROW,
)
from hc_evaluation.accuracy.misfit import misfit_contact
from hc_evaluation.accuracy.recordings import RECORDINGS, data_folder, load, smoothed

COUNT, SPACING = 60, 0.02
TISSUE = (np.log(0.5), np.log(0.01), 1.5, 1.0)
STIFFER = (np.log(0.8), np.log(0.02), 1.5, 1.0)


def law(depth, velocity, log_stiffness, log_damping, n, p):
    """Force of the law, written once more."""
    drag = np.exp(log_damping) * np.sign(velocity) * np.abs(velocity) ** p
    return depth**n * (np.exp(log_stiffness) + drag)


def add_contact(history, begin, parameters):
    """Remember a press that begins at a time [s]."""
    time = begin + SPACING * np.arange(COUNT)
    depth = 0.5 + 2.0 * np.sin(np.pi * np.arange(COUNT) / COUNT)
    velocity = np.gradient(depth, SPACING)
    rows = slice(history.count, history.count + COUNT)
    history.points[rows]["depth"] = depth
    history.points[rows]["velocity"] = velocity
    history.points[rows]["force"] = law(depth, velocity, *parameters)
    history.points[rows]["source"] = WIDE
    history.points[rows]["time"] = time
    history.count += COUNT


@pytest.fixture
def bank_of(records_of):
    """Settings and bank in which a row is chosen; it and the fit have the given parameters."""

    def make(chosen, parameters, fitted, **settings):
        options, bank = records_of(hc.create_estimator("self_tuning_ukf", **settings))
        bank.rows[FITTED].active = 1
        bank.rows[chosen].state[LOG_STIFFNESS : LOG_STIFFNESS + 4] = parameters
        bank.rows[FITTED].state[LOG_STIFFNESS : LOG_STIFFNESS + 4] = fitted
        bank.judge.chosen = chosen
        add_contact(bank.history, 0.0, STIFFER)
        add_contact(bank.history, 3.0, TISSUE)
        return options, bank

    return make


@pytest.mark.parametrize("row", [TREND_ROW, EXPONENT_ROW])
def test_the_fit_goes_on_where_it_explains_the_last_contact_better(row, bank_of):
    options, bank = bank_of(row, STIFFER, TISSUE)
    lift_off.review(options, bank)
    assert bank.judge.chosen == FITTED
    for m in (0, TREND_ROW, EXPONENT_ROW):
        np.testing.assert_allclose(bank.rows[m].state[LOG_STIFFNESS : LOG_STIFFNESS + 4], TISSUE)


@pytest.mark.parametrize(("misfit", "chosen"), [(0.0, TREND_ROW), (0.01, FITTED)])
def test_a_row_that_is_told_not_to_fit_claims_nothing(misfit, chosen, bank_of):
    """It is not far off; the fit goes on only where it was no explanation anyhow."""
    options, bank = bank_of(TREND_ROW, TISSUE + np.log([1.1, 1.1, 1.0, 1.0]), TISSUE)
    bank.rows[TREND_ROW].model_error = misfit
    lift_off.review(options, bank)
    assert bank.judge.chosen == chosen


def test_the_fit_is_asked_and_not_a_row_that_went_astray(bank_of):
    """Regression: the fitted row had begun anew with the one that drifts just before."""
    options, bank = bank_of(TREND_ROW, STIFFER, STIFFER)
    bank.history.fit[:] = TISSUE
    bank.history.covariance[:] = 1e-4 * np.eye(4)
    bank.history.left = 0.02**2
    bank.history.fitted = 1
    lift_off.review(options, bank)
    assert bank.judge.chosen == FITTED
    np.testing.assert_allclose(bank.rows[0].state[LOG_STIFFNESS : LOG_STIFFNESS + 4], TISSUE)
    assert bank.rows[FITTED].model_error == 0.02**2


def test_a_tissue_that_drifts_goes_on_as_it_was_last(bank_of):
    """Of two contacts only the last is asked: the mean of both would be a fit's."""
    options, bank = bank_of(TREND_ROW, TISSUE, STIFFER)
    lift_off.review(options, bank)
    assert bank.judge.chosen == TREND_ROW
    np.testing.assert_allclose(
        bank.rows[TREND_ROW].state[LOG_STIFFNESS : LOG_STIFFNESS + 4], TISSUE
    )


def vary(bank, factors):
    """Let the force of the last contact grow by factors along it, as over an inclusion."""
    last = slice(bank.history.count - COUNT, bank.history.count)
    along = np.interp(np.arange(COUNT), np.linspace(0, COUNT, len(factors)), factors)
    bank.history.points[last]["force"] *= along


@pytest.mark.parametrize(
    ("factors", "end", "before", "chosen"),
    [
        ([1.0, 1.1, 1.2, 1.3], 2.0, 0, TREND_ROW),  # over the flank of an inclusion
        ([1.3, 1.2, 1.1, 1.0], 0.5, 0, FITTED),  # relaxes, for all that is known
        ([1.3, 1.2, 1.1, 1.0], 0.5, 1, TREND_ROW),  # the other flank
    ],
)
def test_a_tissue_that_became_stiffer_varies_along_the_way(factors, end, before, chosen, bank_of):
    """Regression of 2026-11-30: at the end of a press over an inclusion K was the mean of all."""
    both = np.array([1.0, 1.0, 0.0, 0.0])
    options, bank = bank_of(TREND_ROW, TISSUE + np.log(end) * both, TISSUE + np.log(1.15) * both)
    vary(bank, factors)
    bank.judge.stiffened = before
    lift_off.review(options, bank)
    assert bank.judge.chosen == chosen
    assert bank.judge.stiffened == int(end > 1.0 or before)


def test_a_stiffness_that_rose_clearly_is_no_relaxation(bank_of):
    options, bank = bank_of(TREND_ROW, TISSUE, STIFFER)
    bank.judge.rise = 0.5
    bank.tool.away_time = lift_off.AWAY_TIME - 0.001
    lift_off.look(options, bank, 0.002)
    assert bank.judge.stiffened == 1
    assert bank.judge.rise == 0.0  # of the contact that is over


@pytest.mark.parametrize("why", ["surface", "no fit", "few", "off"])
def test_nothing_is_asked_without_need(why, bank_of):
    row = SURFACE_ROW if why == "surface" else TREND_ROW
    options, bank = bank_of(row, STIFFER, TISSUE, review_contact=why != "off")
    if why == "no fit":
        bank.rows[FITTED].active = 0
    if why == "few":
        bank.history.count = COUNT + 5
    lift_off.review(options, bank)
    assert bank.judge.chosen == row


def test_the_second_press_on_a_real_phantom_is_foretold():
    folder = data_folder()
    if folder is None:
        pytest.skip("no recordings beside the project (../shared/data)")
    recording = next(r for r in RECORDINGS if r.name == "press_triangle")
    time, displacement, force = load(folder, recording)
    between = int(np.searchsorted(time, 6.0))  # the first press is over at 4.5 s
    again = (time > 6.0) & (time < 7.0)
    depth, velocity = smoothed(time, displacement)
    errors = []
    for review in (True, False):
        estimator = hc.create_estimator("self_tuning_ukf", review_contact=review)
        series = estimator.run(time[:between], displacement[:between], force[:between])
        foretold = hunt_crossley_force(depth, velocity, series.parameters[-1])
        errors.append(np.sqrt(np.mean((force - foretold)[again] ** 2)))
    assert errors[0] < 0.1 * np.sqrt(np.mean(force[again] ** 2))
    assert errors[0] < 0.2 * errors[1]


@pytest.mark.parametrize("seed", [5000, 5001, 5002])
def test_a_tissue_that_relaxes_is_neither_a_surface_nor_a_drift(seed):
    """It was told to be a surface that moves, at twice the stiffness and surely so."""
    time, displacement, force = misfit_contact("press_relaxing", seed)
    series = hc.create_estimator("self_tuning_ukf").run(time, displacement, force)
    late = time > 8.0
    assert np.mean(series.hypothesis[late] <= Hypothesis.CONSTANT_FITTED) > 0.7
    assert not np.any(series.hypothesis[late] == Hypothesis.SURFACE_MOVES)
    assert np.mean(series.model_mismatch[late]) > 0.95
    assert not np.any(series.change_detected)
