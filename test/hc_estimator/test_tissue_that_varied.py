"""Presses along tissue that varies: what is known of it in the air, and at the next contact.

Regression of 2026-11-30 (`hc bench accuracy together`, presses and lumps): in the air K was as
certain as at the end of the press, a press on the other flank of an inclusion was a change of the
tissue with another exponent, and at the end of each press K was the mean of all that was felt.
"""

import numpy as np
import pytest

import hc_estimator as hc
from hc_estimator.multiple_model import maneuver as maneuvers
from hc_estimator.multiple_model import spread
from hc_estimator.multiple_model.hypotheses import LOG_STIFFNESS, TREND_ROW
from hc_estimator.multiple_model.kalman import let_stiffness_vary
from hc_evaluation.accuracy.scenarios import simulate
from hc_evaluation.accuracy.together import START_S, contact_of

TISSUE = slice(LOG_STIFFNESS, LOG_STIFFNESS + 4)
CLOCK = 20.0


@pytest.mark.parametrize("seed", [100001, 100016, 100018])
def test_presses_over_a_lump(seed):
    scenario = contact_of("presses, lumps", seed)
    contact = simulate(scenario, seed)
    series = hc.create_estimator("self_tuning_ukf").run(
        contact.time_s, contact.displacement_mm, contact.force_n
    )
    late = contact.time_s > START_S
    error = np.abs(np.log(series.parameters[late, 0] / contact.parameters[late, 0]))
    deviation = series.parameters_std[late, 0] / series.parameters[late, 0]
    assert np.mean(error < 3.0 * deviation) > 0.85
    assert np.median(error) < 0.02
    assert not series.change_detected[late].any()
    n, truth = series.parameters[late, 2], contact.parameters[late, 2]
    assert np.quantile(np.abs(n - truth), 0.9) < 0.1


@pytest.fixture
def bank(parts):
    """Constant tissue is in charge, and a row beside it follows one that varied."""
    bank = parts[1]
    for m in range(bank.rows.shape[0]):
        bank.rows[m].active = int(m in (0, TREND_ROW))
    bank.rows[0].covariance[TISSUE, TISSUE] = 1e-4 * np.eye(4)
    bank.rows[TREND_ROW].covariance[TISSUE, TISSUE] = 0.09 * np.eye(4)
    bank.rows[TREND_ROW].state[LOG_STIFFNESS] = bank.rows[0].state[LOG_STIFFNESS] + 0.2
    bank.judge.chosen, bank.judge.varying = 0, TREND_ROW
    bank.judge.varied_at, bank.judge.steep_time = CLOCK - 1.0, 2.0 * spread.STEEP_FOR
    return bank


def in_air(bank, **settings):
    """What is open of ln K in the air."""
    estimator = hc.create_estimator("self_tuning_ukf", **settings)
    bank.judge.spread[:] = 0.0
    options = estimator._settings.view(np.recarray)[0]
    spread.find_in_air(options, bank.judge, bank.rows, CLOCK)
    return bank.judge.spread[0, 0]


def test_what_varied_may_be_another_tissue_at_the_next_contact(bank):
    assert in_air(bank) == pytest.approx(0.2**2 + 0.09)


@pytest.mark.parametrize("why", ["not clearly", "long ago", "it is in charge", "off"])
def test_otherwise_it_is_what_was_felt_last(why, bank):
    if why == "not clearly":
        bank.judge.steep_time = 0.5 * spread.STEEP_FOR
    if why == "long ago":
        bank.judge.varied_at = CLOCK - 2.0 * spread.VARIED_FOR
    if why == "it is in charge":
        bank.judge.chosen = TREND_ROW
    assert in_air(bank, mixture_covariance=why != "off") == 0.0


@pytest.mark.parametrize(("away", "why"), [(0.5, ""), (0.1, "a tap"), (0.5, "not clearly")])
def test_a_rate_that_was_felt_may_go_on_in_the_air(away, why, bank):
    bank.judge.square_rate = 0.5**2
    bank.tool.contact_clock, bank.tool.away_time = CLOCK, away
    if why == "not clearly":
        bank.judge.steep_time = 0.5 * spread.STEEP_FOR
    gained = spread.growth_in_air(bank.judge, bank.tool, 0.01)
    # Half a unit per second, of a piece for 0.3 s.
    assert gained == pytest.approx(0.0 if why else 2.0 * 0.3 * 0.5**2 * 0.01)


def test_what_varies_is_less_known_and_its_damping_with_it(bank):
    row = bank.rows[TREND_ROW]
    before = row.covariance[TISSUE, TISSUE].copy()
    let_stiffness_vary(row, 0.04)
    added = np.zeros((4, 4))
    added[:2, :2] = 0.04
    np.testing.assert_allclose(row.covariance[TISSUE, TISSUE], before + added)
    row.covariance[LOG_STIFFNESS + 1, :] = 0.0  # a damping that is held fixed
    row.covariance[:, LOG_STIFFNESS + 1] = 0.0
    let_stiffness_vary(row, 0.04)
    assert not row.covariance[LOG_STIFFNESS + 1].any()


def test_rows_that_begin_anew_do_not_make_the_tool_calm(bank):
    """Regression: after an encoder was zeroed in a hold, the next press came as a surprise."""
    maneuver = bank.maneuver
    maneuver.square_speed, maneuver.square_acceleration, maneuver.count = 4.0, 900.0, 5
    maneuvers.forget_rows(maneuver)
    assert maneuver.count == 0
    assert (maneuver.square_speed, maneuver.square_acceleration) == (4.0, 900.0)
    maneuvers.reset(maneuver)
    assert (maneuver.square_speed, maneuver.square_acceleration) == (0.0, 0.0)
