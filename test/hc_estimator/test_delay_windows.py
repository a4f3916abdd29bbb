"""How the windows of the delay are joined: what they differ by counts, and few need more."""

import numpy as np
import pytest
from scipy.stats import norm, t

import hc_estimator as hc
from hc_estimator.multiple_model import delay, delay_rules
from hc_estimator.multiple_model.records import CANDIDATES
from hc_evaluation.accuracy.scenarios import simulate
from hc_evaluation.accuracy.separation import random_separation


def finder_of(values, deviations):
    """Settings, and a finder whose windows found these delays with these deviations [s]."""
    estimator = hc.create_estimator("self_tuning_ukf")
    finder = estimator._memory.view(np.recarray)[0].delay
    finder.windows = len(values)
    finder.grid_step = 0.01
    for w, (value, deviation) in enumerate(zip(values, deviations, strict=True)):
        finder.fine_valid[w] = 1
        finder.fine_delay[w] = value
        finder.fine_information[w] = (1.0 / deviation**2, 0.0, 0.0)
        finder.fine_vector[w] = (value / deviation**2, 0.0)
    return estimator._settings.view(np.recarray)[0], finder


def test_windows_that_agree_are_weighed_by_what_they_know():
    values, deviations = np.array([0.9, 1.1, 1.0, 1.05]) * 1e-3, np.array([2, 1, 4, 2]) * 1e-4
    options, finder = finder_of(values, deviations)
    assert delay._join(options, finder, CANDIDATES // 2)
    weights = 1.0 / deviations**2
    assert finder.fine[0] == pytest.approx(np.sum(weights * values) / np.sum(weights), rel=1e-6)
    least = np.hypot(1.0 / np.sqrt(np.sum(weights)), 1e-4)
    assert finder.fine[1] == pytest.approx(least, rel=1e-6)


def test_one_window_that_claims_too_much_does_not_decide():
    """Regression of 2026-11-24: 1.4 ms where there was no delay, by one window of thirteen."""
    rng = np.random.default_rng(4)
    values = np.append(1e-3 * rng.standard_normal(12), 2e-3)
    deviations = np.append(np.full(12, 1e-3), 1e-4)
    options, finder = finder_of(values, deviations)
    assert delay._join(options, finder, CANDIDATES // 2)
    assert abs(finder.fine[0]) < 3.0 * finder.fine[1]
    assert finder.fine[1] > 2e-4


def test_a_delay_that_most_windows_do_not_find_is_none():
    """Regression of 2026-11-24: -53 ms where the tool taps, by 4 windows of 13; K 9 % off."""
    scenario = random_separation(100043)
    contact = simulate(scenario, 100000)
    series = hc.create_estimator("self_tuning_ukf").run(
        contact.time_s, contact.displacement_mm, contact.force_n
    )
    assert np.all(series.channel_delay == 0.0)
    assert series.parameters[-1] == pytest.approx(contact.parameters[-1], rel=0.02)


def test_few_windows_need_more_deviations():
    """Student's quantile as scipy has it, within the error of three terms of its expansion."""
    for freedom in (12, 20, 60):
        exact = t.isf(norm.sf(delay_rules.SMALL), freedom)
        assert delay_rules.student_quantile(freedom) == pytest.approx(exact, rel=0.12)
