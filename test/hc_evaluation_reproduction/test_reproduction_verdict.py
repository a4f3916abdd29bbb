"""What is concluded from the scores: intervals over seeds, verdicts, ours beside the papers."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import binom

from hc_evaluation.reproduction import load_experiment
from hc_evaluation.reproduction.campaign import ExperimentResult
from hc_evaluation.reproduction.intervals import median_ranks, paired_ratio, summarise
from hc_evaluation.reproduction.ours import MET_NO, MET_OPEN, MET_YES, below, count, ours
from hc_evaluation.reproduction.verdict import (
    FAILS,
    HOLDS,
    NO_DIFFERENCE,
    OPPOSITE,
    RANKING,
    UNRELIABLE,
    compare,
)

ALL = {"identifiable": ("K", "B", "n", "p")}


@pytest.mark.parametrize("count", [6, 10, 25, 100])
def test_the_medians_interval_covers(count: int) -> None:
    low, high = median_ranks(count)
    coverage = binom.cdf(high, count, 0.5) - binom.cdf(low, count, 0.5)
    assert coverage >= 0.95
    narrower = binom.cdf(high - 1, count, 0.5) - binom.cdf(low + 1, count, 0.5)
    assert narrower < 0.95


def test_failed_runs_count_in_the_median_and_not_in_the_mean() -> None:
    found = summarise([1.0, 2.0, 3.0, 1e30, float("nan")], [0.0, 0.0, 0.0, 1.0, 0.0])
    assert (found.count, found.failure_rate) == (4, 0.25)
    assert found.mean == pytest.approx(2.0)
    assert found.median == pytest.approx(2.5)
    assert found.median_high == float("inf")
    half = 4.302652729911275 * 1.0 / np.sqrt(3.0)  # Student's t with 2 degrees of freedom
    assert found.mean_high - found.mean == pytest.approx(half, rel=1e-9)
    assert summarise([], []).count == 0


def test_the_ratio_is_taken_seed_by_seed() -> None:
    found = paired_ratio([2.0, 8.0, 1.0, 5.0], [1.0, 2.0, 1.0, 5.0], [0, 0, 1, 1], [0, 0, 0, 1])
    assert found.count == 3  # where both fail, nothing is said
    assert found.median == 4.0
    assert found.median_high == float("inf")


def _result(name: str, worse: list[float], better: list[float], failed: float) -> ExperimentResult:
    experiment = load_experiment(name)
    columns = {}
    for column in experiment.columns:
        values = better if column.published == experiment.better[1] else worse
        lost = failed if column.published == experiment.better[1] else 0.0
        columns[column.name] = {
            "force_rmse": values,
            "law_rmse": values,
            "one_step_rmse": values,
            "hold_forward_rmse": values,
            "failed": [lost] * len(values),
            "error_identifiable": [0.01] * len(values),
            "mismatch_share": [0.25] * len(values),
        }
    return ExperimentResult(name, list(range(1, len(worse) + 1)), columns, ("n",), {})


@pytest.mark.parametrize(
    ("worse", "better", "failed", "verdict"),
    [
        (30.0e-3, 3.0e-3, 0.0, HOLDS),
        (6.0e-3, 3.0e-3, 0.0, RANKING),
        (3.0e-3, 3.0e-3, 0.0, NO_DIFFERENCE),
        (1.0e-3, 3.0e-3, 0.0, OPPOSITE),
        (30.0e-3, 3.0e-3, 1.0, FAILS),
    ],
)
def test_the_verdict(worse: float, better: float, failed: float, verdict: str) -> None:
    experiment = load_experiment("a_table_1")
    result = _result("a_table_1", [worse] * 10, [better] * 10, failed)
    found = compare(experiment, result, "paper")
    assert found is not None
    assert found.verdict == verdict
    assert found.published_ratio == pytest.approx(30.2395 / 2.9133)
    close = sum((15.2e-3 <= worse <= 60e-3, 1.46e-3 <= better <= 5.8e-3 and failed == 0.0))
    assert found.figures == (close, 2)


def test_a_filter_that_sometimes_fails_is_unreliable() -> None:
    experiment = load_experiment("a_table_1")
    result = _result("a_table_1", [30.0e-3] * 10, [3.0e-3] * 10, 0.0)
    result.columns["RWSTUKF, paper"]["failed"] = [1.0, 1.0, 1.0, *([0.0] * 7)]
    found = compare(experiment, result, "paper")
    assert found is not None
    assert found.verdict == UNRELIABLE


def test_ours_is_compared_with_the_best_printed_figure_by_the_law() -> None:
    experiment = load_experiment("a_table_1")
    found = ours(experiment, _result("a_table_1", [2.9e-3] * 10, [1.0] * 10, 0.0))
    assert all(entry.meets_printed == MET_YES for entry in found)
    assert found[0].best == pytest.approx(2.9133e-3)
    assert found[0].mismatch == 0.25
    result = _result("a_table_1", [2.9e-3] * 10, [1.0] * 10, 0.0)
    result.columns["default"]["law_rmse"] = [3.0e-3] * 10  # what it reports does not count
    assert ours(experiment, result)[0].meets_printed == MET_NO


def test_an_interval_that_holds_the_limit_leaves_it_open() -> None:
    values = [1.0, 1.1, 1.2, 1.3, 1.4, 1.6, 1.7, 1.8, 1.9, 2.0]
    found = summarise(values, [0.0] * 10)
    assert below(found, 2.5) == MET_YES
    assert below(found, 1.5) == MET_OPEN
    assert below(found, 0.5) == MET_NO
    assert below(found, float("nan")) == MET_NO
    assert below(summarise([1.0] * 10, [1.0] * 10), 2.0) == MET_NO  # all failed


def test_the_parameters_count_with_the_force() -> None:
    experiment = load_experiment("a_table_1")
    result = _result("a_table_1", [1e-3] * 10, [1e-3] * 10, 0.0)
    result.columns["default"]["error_identifiable"] = [0.06] * 10
    result.columns["RLS"]["error_identifiable"] = [0.04] * 5 + [0.06] * 5
    assert {e.column: e.meets_printed for e in ours(experiment, result)} == {
        "default": MET_NO,
        "RWSTUKF kinematic": MET_YES,
        "RLS": MET_OPEN,
    }


def test_hold_forward_is_compared_with_the_best_of_the_papers_filters_on_each_seed() -> None:
    experiment = load_experiment("a_table_1")
    result = _result("a_table_1", [1e-3] * 10, [1e-3] * 10, 0.0)
    seeds = np.arange(10)
    # Two of the papers' filters are good on half of the seeds each: the best is good on all.
    result.columns["UKF, paper"]["hold_forward_rmse"] = np.where(seeds < 5, 1.0, 9.0).tolist()
    result.columns["RWSTUKF, practical"]["hold_forward_rmse"] = np.where(
        seeds < 5, 9.0, 1.0
    ).tolist()
    for name in ("RWSTUKF, paper", "UKF, practical"):
        result.columns[name]["hold_forward_rmse"] = [9.0] * 10
    for name, held in (("default", 0.5), ("RWSTUKF kinematic", 2.0), ("RLS", 1.0)):
        result.columns[name]["hold_forward_rmse"] = [held] * 10
    found = {entry.column: entry for entry in ours(experiment, result)}
    assert found["default"].held_ratio.median == pytest.approx(2.0)
    assert found["default"].held_better == MET_YES
    assert found["RWSTUKF kinematic"].held_better == MET_NO
    assert found["RLS"].held_better == MET_NO  # as good is not better
    result.columns["default"]["failed"] = [1.0] * 10
    assert ours(experiment, result)[0].held_better == MET_NO


def test_answers_are_sorted_by_column() -> None:
    found = count({"a": {"x": MET_YES, "y": MET_NO}, "b": {"x": MET_OPEN, "y": MET_NO}})
    assert (found[0].column, found[0].yes, found[0].open, found[0].no) == ("x", ("a",), ("b",), ())
    assert found[1].no == ("a", "b")
