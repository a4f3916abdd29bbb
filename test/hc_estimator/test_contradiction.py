"""What least squares say of the damping against the recursive row, and what comes of it."""

import numpy as np
import pytest

import hc_estimator as hc
from hc_estimator.multiple_model import choice, contradiction, spread
from hc_estimator.multiple_model.hypotheses import FITTED, LOG_STIFFNESS

TISSUE = slice(LOG_STIFFNESS, LOG_STIFFNESS + 4)
CLOCK = 20.0


@pytest.fixture
def bank(parts):
    """The settings and a bank with a fit, and constant tissue in charge that says the same."""
    settings, bank = parts[0], parts[1]
    draw = np.random.default_rng(3)
    root = 0.1 * draw.normal(size=(4, 4))
    history, row = bank.history, bank.rows[0]
    history.covariance[:] = root @ root.T
    history.fit[:] = draw.normal(size=4)
    history.left = 0.0
    for m in range(bank.rows.shape[0]):
        bank.rows[m].active = int(m in (0, FITTED))
    for m in (0, FITTED):
        bank.rows[m].state[TISSUE] = history.fit
        bank.rows[m].covariance[TISSUE, TISSUE] = 0.1 * history.covariance
        for name in ("model_error", "counts_from", "since", "contradiction", "score"):
            bank.rows[m][name] = 0.0
        bank.rows[m].recent_nis, bank.rows[m].log_likelihood = 2.0, 100.0
    bank.judge.chosen = 0
    history.trembles = 1  # the tool moves more than the displacement shows
    return settings, bank, history, row


def test_it_is_the_squared_distance_of_damping_and_its_exponent(bank):
    settings, _bank, history, row = bank
    assert contradiction.of_damping(settings, history, row) == 0.0
    off = np.array([0.03, -0.02])
    row.state[[LOG_STIFFNESS + 1, LOG_STIFFNESS + 3]] += off
    row.state[[LOG_STIFFNESS, LOG_STIFFNESS + 2]] += 9.0  # of K and n nothing is asked
    both = np.array(history.covariance)[np.ix_([1, 3], [1, 3])]
    expected = off @ np.linalg.solve(both, off)
    assert contradiction.of_damping(settings, history, row) == pytest.approx(expected)
    history.trembles = 0  # as the displacement shows
    assert contradiction.of_damping(settings, history, row) == 0.0


def test_a_row_that_was_refuted_stays_so_until_both_say_the_same(bank):
    settings, _bank, history, row = bank
    deviation = np.sqrt(history.covariance[1, 1])

    def at(deviations):
        row.state[LOG_STIFFNESS + 1] = history.fit[1] + deviations * deviation
        row.contradiction = contradiction.of_damping(settings, history, row)
        return contradiction.refutes(row)

    way = np.linalg.inv(np.array(history.covariance)[np.ix_([1, 3], [1, 3])])[0, 0]
    by = 1.0 / (np.sqrt(way) * deviation)  # one squared deviation, with p as it is
    assert not at(2.2 * by)
    assert at(2.6 * by)
    assert at(2.2 * by)
    assert not at(1.6 * by)
    assert not at(2.2 * by)


def test_nothing_is_contradicted_where_the_fit_says_nothing(bank):
    settings, _bank, history, row = bank
    row.state[LOG_STIFFNESS + 1] += 9.0
    assert contradiction.of_damping(settings, history, row) > contradiction.REFUTED
    history.left = 1e-4  # the law does not fit
    assert contradiction.of_damping(settings, history, row) == 0.0
    history.left = 0.0
    row.active = 0
    assert contradiction.of_damping(settings, history, row) == 0.0


def test_the_fit_is_given_out_where_it_refutes_the_row(bank):
    settings, bank, _history, row = bank

    def chosen():
        bank.judge.chosen = 0
        choice.choose(settings, bank.judge, bank.rows, bank.tool, CLOCK)
        return bank.judge.chosen

    assert chosen() == 0
    row.contradiction = 2.0 * contradiction.REFUTED
    assert chosen() == FITTED
    bank.rows[FITTED].model_error = 1e-4
    assert chosen() == 0
    bank.rows[FITTED].model_error, row.contradiction = 0.0, 0.9 * contradiction.REFUTED
    assert chosen() == 0


@pytest.mark.parametrize(
    ("squares", "share"), [(0.0, 0.0), (2.0, 0.0), (4.0, 0.5), (6.0, 1.0), (99.0, 1.0)]
)
def test_what_the_fit_says_is_left_open_the_more_the_less_likely_the_row_is(squares, share, bank):
    settings, bank, history, row = bank
    row.state[TISSUE] += np.array([0.01, 0.3, -0.02, 0.1])
    row.contradiction = squares
    way = np.array(row.state[TISSUE]) - history.fit
    bank.rows[FITTED].recent_nis = 99.0  # not a part of the mixture
    spread.find(settings, bank.judge, bank.rows, CLOCK)
    np.testing.assert_allclose(bank.judge.spread, share * np.outer(way, way), rtol=1e-12)


def test_a_row_that_begins_anew_is_not_refuted():
    estimator = hc.create_estimator("self_tuning_ukf")
    memory = estimator._memory.view(np.recarray)[0]
    memory.rows[0].contradiction = 9.0
    estimator.reset()
    assert memory.rows[0].contradiction == 0.0
