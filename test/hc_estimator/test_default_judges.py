"""The parts of the default filter that judge, one by one: choice of a row, turns, what is possible.

Each is held against its own definition; those that learn are in test_default_parts.
"""

import numpy as np
import pytest

import hc_estimator as hc
from hc_estimator.multiple_model import choice, maneuver, plausible, raw_readings
from hc_estimator.multiple_model.hypotheses import (
    DEPTH,
    FITTED,
    FRESH,
    LOG_STIFFNESS,
    OWN,
    SURFACE_ROW,
    VELOCITY,
)
from hc_estimator.multiple_model.rows import reset

TISSUE = np.array([0.3, 0.015, 1.7, 1.05])
CLOCK = 10.0  # contact clock at which rows are judged [s]
EARLY = 3.0  # before which a surface is doubted [s]


def rows_of(options, bank, scores, misfits=(), learns=()):
    """Rows that all count, with the given scores; some misfit, some still learn."""
    for m, score in enumerate(scores):
        row = bank.rows[m]
        reset(options, row, 2.0)
        row.index, row.active, row.score, row.claimed = m, 1, score, 0.0
        row.covariance[7, 7] = 0.01  # a surface that is known
        row.model_error = 1.0 if m in misfits else 0.0
        if m in learns:
            row.recent_nis, row.claimed = 1.0, 1e3
    bank.judge.chosen = 0
    return bank.rows


@pytest.mark.parametrize(
    ("scores", "misfits", "learns", "chosen"),
    [
        ((1.0, 1.0, 1.0, 1.0, 1.0, 1.0), (), (), 0),  # the calmest of equals
        ((1.1, 9.0, 1.0, 1.0, 1.0, 1.0), (), (), 0),  # not clearly worse
        ((1.5, 9.0, 1.0, 1.0, 1.0, 1.0), (), (), 2),  # clearly worse
        ((9.0, 9.0, 9.0, 1.0, 1.0, 1.0), (), (), 4),  # a surface that sinks must be likelier
        ((2.0, 1.0, 9.0, 9.0, 9.0, 9.0), (1,), (), 0),  # one that claims to fit before a misfit
        ((4.0, 1.0, 9.0, 9.0, 9.0, 9.0), (1,), (), 1),  # unless it predicts far worse
        ((4.0, 2.0, 9.0, 9.0, 1.0, 9.0), (0, 1, 2, 3, 4, 5), (), 4),  # among misfits, the best
        ((4.0, 2.0, 9.0, 1.0, 9.0, 1.0), (0, 1, 2, 3, 4, 5), (), 1),  # a surface explains nothing
        ((9.0, 9.0, 3.5, 9.0, 9.0, 1.0), (0, 1), (), 5),  # and one that does
        # What may drift has no advance over a misfit.
        ((2.0, 6.5, 9.0, 9.0, 3.2, 3.2), (0,), (), 0),
        # Still learning: freer rows prove nothing, but the fit, as calm, does.
        ((3.0, 9.0, 1.0, 9.0, 1.0, 1.0), (), (0,), 0),
        ((3.0, 1.0, 0.4, 9.0, 0.4, 0.4), (), (0,), 1),
        ((5.0, 9.0, 1.0, 9.0, 1.0, 1.0), (), (0,), 2),  # far better is far better
    ],
)
def test_the_judge_chooses(scores, misfits, learns, chosen, parts):
    options, bank = parts
    rows_of(options, bank, scores, misfits, learns)
    choice.choose(options, bank.judge, bank.rows, bank.tool, CLOCK)
    assert bank.judge.chosen == chosen


@pytest.mark.parametrize(
    ("fitted", "clock", "chosen"),
    [
        (1.0, EARLY, FITTED),
        (1.25, EARLY, FITTED),
        (1.35, EARLY, SURFACE_ROW),
        (1.25, CLOCK, SURFACE_ROW),
    ],
)
def test_an_early_surface_has_to_foretell_better_than_the_fit(fitted, clock, chosen, parts):
    """Regression: of a tissue that relaxes the fit is not consistent at the first retreat.

    A surface that sinks explained the way back, at twice the stiffness, though what it had foretold
    was three times worse than what the fit had.
    """
    options, bank = parts
    rows_of(options, bank, (9.0, fitted, 9.0, 9.0, 9.0, 1.0), (0, FITTED, 2, 4))
    bank.judge.chosen = FITTED
    bank.rows[FITTED].recent_nis = 10.0
    choice.choose(options, bank.judge, bank.rows, bank.tool, clock)
    assert bank.judge.chosen == chosen


@pytest.mark.parametrize(
    ("log_stiffness", "second", "chosen"),
    [
        (0.0, 1.4, 0),  # K d^n = 5.2 N at most, where 2 N were felt
        (1.0, 1.4, 2),  # 14 N, and another predicts as well
        (1.0, 6.0, 0),  # unless it predicts far worse: a lump may be that hard
    ],
)
def test_a_law_that_foretells_the_impossible_gives_way(log_stiffness, second, chosen, parts):
    options, bank = parts
    plausible.reset(bank.tool)
    bank.tool.deepest, bank.tool.fastest, bank.tool.largest_force = 3.0, 0.0, 2.0
    rows = rows_of(options, bank, (1.0, 9.0, second, 9.0, 9.0, 9.0))
    for row in rows:
        row.state[LOG_STIFFNESS] = 0.0
    rows[0].state[LOG_STIFFNESS] = log_stiffness
    choice.choose(options, bank.judge, rows, bank.tool, CLOCK)
    assert bank.judge.chosen == chosen


def test_zeros_that_move_take_along_stiffness_found(parts):
    _, bank = parts
    plausible.reset(bank.tool)
    plausible.move(bank.tool, 1.5, 0.2)
    assert bank.tool.largest_force == 0.0  # nothing was felt
    bank.tool.deepest, bank.tool.largest_force = 3.0, 2.0
    plausible.move(bank.tool, 1.5, 0.2)
    assert bank.tool.deepest == pytest.approx(1.5)
    assert bank.tool.largest_force == pytest.approx(1.8)


@pytest.mark.parametrize(("likelihood", "chosen"), [(4.9, 4), (5.1, 3)])
def test_a_surface_that_sinks_is_chosen_where_it_is_likelier_by_far(likelihood, chosen, parts):
    options, bank = parts
    rows_of(options, bank, (9.0, 9.0, 9.0, 1.0, 1.0, 1.0))
    bank.rows[3].log_likelihood = likelihood
    choice.choose(options, bank.judge, bank.rows, bank.tool, CLOCK)
    assert bank.judge.chosen == chosen


def test_a_surface_that_sinks_refutes_nobody_before_it_is_chosen(parts):
    """Regression: on the flank of a lump it refuted the row that follows the lump."""
    options, bank = parts
    rows_of(options, bank, (9.0, 9.0, 1.0, 0.1, 9.0, 9.0), misfits=(3,))
    bank.rows[3].log_likelihood = 50.0
    choice.choose(options, bank.judge, bank.rows, bank.tool, CLOCK)
    assert bank.judge.chosen == 2


def test_an_old_error_is_forgiven(parts):
    """A bad start once counted for ten seconds: its square decayed through eight decades."""
    options, bank = parts
    rows_of(options, bank, (1e8, 9.0, 1.0, 1.0, 1.0, 1.0))
    choice.choose(options, bank.judge, bank.rows, bank.tool, CLOCK)
    assert bank.rows[0].score == pytest.approx(choice.FORGIVEN)


def test_a_maneuver_takes_back_scores_and_choice(parts):
    """Regression: after a corner the row that had followed the wrong motion stayed in charge."""
    options, bank = parts
    rows_of(options, bank, (1.0, 2.0, 3.0, 4.0, 5.0, 6.0))
    bank.tool.contact_clock = 1.0
    for _ in range(maneuver.PERIOD):
        maneuver.keep(bank, 1.0)
    assert bank.maneuver.count == 1
    bank.judge.count = 4
    bank.judge.said_at[:4] = (0.9, 0.99, 1.01, 1.02)
    bank.judge.said[:4] = 7.0
    rows_of(options, bank, (50.0, 50.0, 50.0, 0.1, 50.0, 50.0))
    bank.rows[3].log_likelihood = 99.0
    bank.judge.chosen = 3
    raw_readings.take(bank.delay, 0, 1.0, 2.0)
    maneuver._go_back(bank, 0, 1.0)
    assert bank.judge.chosen == 0
    assert [bank.rows[m].score for m in range(6)] == [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    assert bank.rows[3].log_likelihood == 0.0
    assert np.all(bank.judge.said[:2] == 7.0)  # what was said before it stands
    assert not np.any(bank.judge.said[2:4, :FRESH, 0] == 7.0)  # the rest is said anew


def test_a_surface_goes_on_while_a_maneuver_is_not_seen_yet(parts):
    """Regression: it was left where it had been 60 ms before, a tenth of a millimetre away."""
    options, bank = parts
    rows_of(options, bank, (1.0, 2.0, 3.0, 4.0, 5.0, 6.0))
    row = bank.rows[SURFACE_ROW]
    row.state[OWN], row.state[OWN + 1] = 0.2, 1.5
    row.covariance[OWN, OWN], row.covariance[OWN + 1, OWN + 1] = 1e-4, 1e-2
    for _ in range(maneuver.PERIOD):
        maneuver.keep(bank, 1.0)
    raw_readings.take(bank.delay, 0, 1.0, 2.0)
    maneuver._go_back(bank, 0, 1.06)
    assert row.state[OWN] == pytest.approx(0.2 + 1.5 * 0.06)
    assert row.covariance[OWN, OWN] > 1e-4 + 1e-2 * 0.06**2 - 1e-12


def test_a_fitted_row_that_did_not_exist_before_a_maneuver_goes(parts):
    options, bank = parts
    rows_of(options, bank, (1.0,) * FRESH)
    bank.rows[FITTED].active = 0
    for _ in range(maneuver.PERIOD):
        maneuver.keep(bank, 1.0)
    bank.rows[FITTED].active = 1
    raw_readings.take(bank.delay, 0, 1.0, 2.0)
    maneuver._go_back(bank, 0, 1.0)
    assert bank.rows[FITTED].active == 0


# What is possible


def felt(options, bank, log_stiffness):
    """Rows at 2 mm and 1 mm/s with the given ln K; 10 N, 3 mm and 5 mm/s were felt."""
    rows = rows_of(options, bank, (1.0,) * FRESH)
    plausible.reset(bank.tool)
    bank.tool.known_time = 1.0
    bank.judge.chosen, bank.sensor_noise[1] = 0, 1e-4
    bank.tool.deepest, bank.tool.fastest, bank.tool.largest_force = 3.0, 5.0, 10.0
    for m, value in enumerate(log_stiffness):
        rows[m].state[DEPTH], rows[m].state[VELOCITY] = 2.0, 1.0
        rows[m].state[LOG_STIFFNESS] = value
    return rows


def test_a_row_that_expects_the_impossible_begins_anew_from_one_that_does_not(parts):
    options, bank = parts
    rows = felt(options, bank, [0.0, 0.0, 12.0, 0.0, 0.0, -1.0])
    bank.judge.chosen = 5
    plausible.check(options, bank)
    assert rows[2].state[LOG_STIFFNESS] == -1.0  # the row in charge is the model
    assert rows[2].predicted_force == pytest.approx(rows[5].predicted_force)
    assert rows[0].state[LOG_STIFFNESS] == 0.0  # the others stay


def test_where_no_row_is_possible_all_are_brought_down(parts):
    options, bank = parts
    rows = felt(options, bank, [12.0] * FRESH)
    plausible.check(options, bank)
    largest = plausible.LARGEST_FACTOR * 10.0 + plausible.NOISE * 0.01
    for m in range(FRESH):
        assert rows[m].predicted_force <= largest * (1.0 + 1e-9)
        assert rows[m].covariance[LOG_STIFFNESS, LOG_STIFFNESS] == 1.0  # and let go


@pytest.mark.parametrize("new", ["depth", "speed", "contact"])
def test_what_was_not_felt_yet_may_be_as_strong_as_it_likes(new, parts):
    options, bank = parts
    rows = felt(options, bank, [12.0] * FRESH)
    if new == "depth":
        bank.tool.deepest = 1.9
    elif new == "speed":
        bank.tool.fastest = 0.9
    else:
        bank.tool.known_time = 0.05
    plausible.check(options, bank)
    assert all(rows[m].state[LOG_STIFFNESS] == 12.0 for m in range(FRESH))


def test_a_model_error_beyond_the_forces_themselves_explains_nothing(parts):
    options, bank = parts
    rows = felt(options, bank, [0.0] * FRESH)
    for model_error, worthless in ((1.0, 0.0), (1e6, 0.1), (1.0, 0.0)):
        rows[0].model_error = model_error
        for _ in range(100):
            plausible.learn(bank.tool, rows[0], 5.0, 0.001)
        assert bank.tool.worthless_time == pytest.approx(worthless, abs=2e-3)


def test_a_law_that_explains_nothing_begins_anew_and_says_so(plant):
    """Regression: its model error outlived ten seconds of good data, K off by any factor."""
    rng = np.random.default_rng(2)
    time = np.arange(14000) / 1000.0
    depth, velocity = plant.motion(time)
    force = plant.force(depth, velocity, *TISSUE)
    d, f = plant.noisy(depth, force, 6)
    nonsense = (time > 2.0) & (time < 4.0)
    f[nonsense] = 200.0 * rng.random(nonsense.sum()) * (rng.random(nonsense.sum()) < 0.3)
    series = hc.create_estimator("self_tuning_ukf").run(time, d, f)
    assert series.parameters[-1, 0] == pytest.approx(TISSUE[0], rel=0.01)
    assert np.isfinite(series.parameters).all()
    assert not series.model_mismatch[-1000:].any()
