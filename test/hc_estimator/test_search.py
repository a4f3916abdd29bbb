"""Least squares that take long go on step by step over the samples (`search`).

A single sample took 32 ms on a scan at 500 Hz, sixteen periods of its sensor, where zeros, lumps
and delays were asked at once. How long one takes is in `hc bench speed`; here is how many steps.
"""

import copy
import dataclasses
import math

import numpy as np
import pytest

import hc_estimator as hc
from hc_estimator.multiple_model import history, search, spline, zero_kinds
from hc_estimator.multiple_model.records import POINTS
from hc_estimator.multiple_model.search import STEP_TIME
from hc_estimator.multiple_model.spline_records import PASS_BEGINS, PASS_GOES_ON
from hc_estimator.multiple_model.zero_records import IDLE, OF_KIND
from hc_evaluation.accuracy.scan import KINDS, random_scan
from hc_evaluation.accuracy.scenarios import simulate

FILTER = "self_tuning_ukf"


def scan_at(rate_hz, seed=3):
    """Time, displacement and force over harder lumps, the force's zero off by 0.3 N."""
    contact = simulate(dataclasses.replace(random_scan(KINDS[0], seed), rate_hz=rate_hz), seed)
    return contact.time_s, contact.displacement_mm, contact.force_n + 0.3


def rows_of(readings):
    return np.stack(readings, axis=1).tolist()


@pytest.fixture
def pressed(recording):
    """Time, displacement and force of one tissue at 1 kHz, the force's zero off by 0.3 N."""
    time, displacement, force = recording(9.0)
    return time, displacement, force + 0.3


@pytest.fixture
def searching(records_of, pressed):
    """An estimator in the middle of a fit that looks for zeros, its settings and its bank."""
    estimator = hc.create_estimator(FILTER)
    settings, bank = records_of(estimator)
    for row in rows_of(pressed):
        estimator.step(*row)
        if bank.zeros.stage == OF_KIND and bank.fit.phase == PASS_GOES_ON and bank.fit.steps == 2:
            return estimator, settings, bank
    raise AssertionError("no search for zeros")


@pytest.mark.parametrize("rate_hz", [100.0, 500.0, 1000.0, 4000.0])
def test_a_sample_takes_a_step_for_each_millisecond_of_its_period(rate_hz, records_of):
    estimator = hc.create_estimator(FILTER)
    _, bank = records_of(estimator)
    asked, most_steps, total = set(), 0, 0
    for row in rows_of(scan_at(rate_hz))[:10000]:
        credit, time = float(bank.search.credit), float(bank.search.time)
        estimator.step(*row)
        most = max(float(bank.clock.period) + 0.5 * STEP_TIME, STEP_TIME)
        granted = min(credit + float(bank.search.time) - time, most)
        steps = round((granted - float(bank.search.credit)) / STEP_TIME)
        most_steps, total = max(most_steps, steps), total + steps
        asked |= {
            name
            for name, stage in (
                ("zeros", bank.zeros.stage),
                ("moving", bank.moving.stage),
                ("delay", bank.delay.stage),
            )
            if stage != 0
        }
    assert most_steps <= math.floor(1.0 / (rate_hz * STEP_TIME) + 0.5) if rate_hz < 1000.0 else 1
    assert total > (100 if rate_hz <= 1000.0 else 5)
    if 500.0 <= rate_hz <= 1000.0:  # a slow sensor has time for all of them between two readings
        assert asked == {"zeros", "moving", "delay"}


def test_a_search_goes_on_after_save_and_restore_to_the_bit(searching, pressed):
    estimator, _, bank = searching
    place = int(np.searchsorted(pressed[0], float(bank.clock.state_time))) + 1
    other = hc.create_estimator(FILTER)
    other.restore(estimator.state())
    rest = [channel[place : place + 3000] for channel in pressed]
    one, two = estimator.run(*rest), other.run(*rest)
    assert np.array_equal(one.parameters, two.parameters)
    assert estimator.state() == other.state()


def test_a_search_keeps_its_points_when_every_second_one_is_forgotten(searching):
    """They got new numbers, and the search had to begin anew."""
    _, settings, bank = searching
    bank.history.count = POINTS
    before = bank.search.history.points[:100].copy()
    history._thin_out(bank.history)
    assert bank.history.count == POINTS // 2
    assert np.array_equal(bank.search.history.points[:100], before)
    bank.search.credit = STEP_TIME
    assert search.is_due(bank)
    search.take_step(settings, bank)
    assert bank.zeros.stage == OF_KIND
    assert bank.fit.steps > 2


def test_a_search_in_tissue_that_was_left_is_given_up(searching):
    _, _, bank = searching
    bank.search.credit = STEP_TIME
    assert search.is_due(bank)
    history.reset(bank.history)
    assert not search.is_due(bank)
    assert bank.zeros.stage == IDLE


def test_a_zero_that_moves_meanwhile_moves_the_points_of_a_search(searching):
    """What the search finds is then by how much that zero is off."""
    _, settings, bank = searching
    moved = copy.deepcopy(bank)
    search.move(moved, 0.1, 0.0, 0.0)
    assert moved.fit.phase == PASS_BEGINS
    for each in (bank, moved):
        while not search.take_step(settings, each):
            pass
    zeros = [float(each.fit.values[spline.FORCE_ZERO]) for each in (bank, moved)]
    assert zeros[1] == pytest.approx(zeros[0] - 0.1, abs=2e-3)
    assert moved.fit.squares == pytest.approx(bank.fit.squares, rel=1e-2)
    assert zero_kinds.explains_all(moved) == zero_kinds.explains_all(bank)
