"""Mean and median over seeds with 95 % confidence intervals, in closed form.

A run that failed counts as infinitely bad: it enters the median and its interval (by order
statistics, which need no finite values), and is left out of the mean, whose failure rate is told
beside it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import binom, t

CONFIDENCE = 0.95


@dataclass(frozen=True)
class Summary:
    """One score over the seeds.

    Attributes:
        count: number of runs.
        failure_rate: share of them that failed.
        mean: mean over the runs that did not fail, NaN if all did.
        mean_low: lower end of its interval (Student's t).
        mean_high: upper end.
        median: median over all runs, failed ones as infinity.
        median_low: lower end of its interval (order statistics).
        median_high: upper end.
    """

    count: int
    failure_rate: float
    mean: float
    mean_low: float
    mean_high: float
    median: float
    median_low: float
    median_high: float


def _mean(values: np.ndarray) -> tuple[float, float, float]:
    if values.size == 0:
        return float("nan"), float("nan"), float("nan")
    with np.errstate(over="ignore", invalid="ignore"):  # diverged runs that did not fail outright
        mean = float(np.mean(values))
        error = float(np.std(values, ddof=1)) / np.sqrt(values.size) if values.size > 1 else np.nan
    half = float(t.ppf(0.5 + 0.5 * CONFIDENCE, values.size - 1)) * float(error)
    return mean, mean - half, mean + half


def median_ranks(count: int) -> tuple[int, int]:
    """Positions in the sorted values between which the median lies with 95 % confidence.

    Below six values there is no such pair; the smallest and the largest stand for it.
    """
    low = int(binom.ppf(0.5 * (1.0 - CONFIDENCE), count, 0.5))
    return max(low - 1, 0), min(count - low, count - 1)


def summarise(values: Sequence[float], failed: Sequence[float]) -> Summary:
    """Summarise one score.

    Args:
        values: the score of each run; a NaN (nothing to score) is left out.
        failed: 1 for each run that failed, else 0.
    """
    given = np.asarray(values, np.float64)
    lost = np.asarray(failed, np.float64) > 0.0
    known = ~np.isnan(given) | lost
    given, lost = given[known], lost[known]
    if given.size == 0:
        nothing = float("nan")
        return Summary(0, nothing, nothing, nothing, nothing, nothing, nothing, nothing)
    kept = given[~lost & np.isfinite(given)]
    ranked = np.sort(np.where(lost, np.inf, given))
    low, high = median_ranks(ranked.size)
    middle = ranked[(ranked.size - 1) // 2], ranked[ranked.size // 2]
    median = float(middle[0]) if middle[0] == middle[1] else float(0.5 * (middle[0] + middle[1]))
    return Summary(
        int(given.size),
        float(np.mean(lost)),
        *_mean(kept),
        median,
        float(ranked[low]),
        float(ranked[high]),
    )


def paired_ratio(
    worse: Sequence[float],
    better: Sequence[float],
    worse_failed: Sequence[float],
    better_failed: Sequence[float],
) -> Summary:
    """Ratio of two filters' scores seed by seed; a seed on which both fail says nothing.

    Args:
        worse: scores of the filter that should lose.
        better: scores of the filter that should win, on the same seeds.
        worse_failed: 1 where the first failed; the ratio is then infinite.
        better_failed: 1 where the second failed; the ratio is then 0.
    """
    first = np.where(np.asarray(worse_failed) > 0.0, np.inf, np.asarray(worse, np.float64))
    second = np.where(np.asarray(better_failed) > 0.0, np.inf, np.asarray(better, np.float64))
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = first / second
    ratio = ratio[~np.isnan(ratio)]
    return summarise(ratio.tolist(), [0.0] * ratio.size)
