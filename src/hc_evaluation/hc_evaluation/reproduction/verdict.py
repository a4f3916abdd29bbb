"""What an experiment's numbers say about the paper's claim."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hc_evaluation.reproduction.campaign import ExperimentResult
from hc_evaluation.reproduction.experiment import Column, Experiment
from hc_evaluation.reproduction.intervals import Summary, paired_ratio, summarise
from hc_evaluation.reproduction.published import published_value, unit_of

OFTEN_FAILED = 0.05  # failure rate from which a wide interval is due to failures
MOSTLY_FAILED = 0.5  # failure rate from which a filter counts as not working
MET = 0.5  # share of the printed ratio that must be there for the claim to hold in size
CLOSE = 2.0  # factor within which a figure counts as that of the paper

HOLDS = "holds"
RANKING = "ranking only"
NO_DIFFERENCE = "no difference"
OPPOSITE = "opposite"
UNRELIABLE = "unreliable"
FAILS = "filters fail"


def summary_of(result: ExperimentResult, column: str, score: str) -> Summary:
    """Summary of one score of one column; of nothing where the column has no such score."""
    scores = result.columns[column]
    failed = scores["failed"] if score != "failed" else [0.0] * len(scores["failed"])
    values = scores.get(score)
    return summarise([], []) if values is None else summarise(values, failed)


@dataclass(frozen=True)
class Comparison:
    """The two filters that the claim is about, in one setting.

    Attributes:
        setting: "paper" or "practical".
        verdict: one of the words above.
        ratio: of the loser's score to the winner's, seed by seed.
        published_ratio: the same of the printed figures, NaN if none.
        figures: of the printed figures in the compared score, how many ours come within CLOSE of,
            and how many there are.
    """

    setting: str
    verdict: str
    ratio: Summary
    published_ratio: float
    figures: tuple[int, int]


def printed_row(experiment: Experiment, score: str) -> str:
    """The printed quantity that is our score; empty if it is not printed."""
    for row, name in experiment.published_rows.items():
        if name == score:
            return row
    return ""


def _pair(experiment: Experiment, setting: str) -> tuple[Column, Column] | None:
    found = []
    for published in experiment.better:
        columns = [
            c for c in experiment.columns if c.setting == setting and c.published == published
        ]
        if not columns:
            return None
        found.append(columns[0])
    return (found[0], found[1]) if len(found) == 2 else None


def compare(
    experiment: Experiment, result: ExperimentResult, setting: str, score: str = ""
) -> Comparison | None:
    """Compare the two filters of the claim in one setting.

    Args:
        experiment: the experiment.
        result: its scores.
        setting: "paper" or "practical".
        score: the score to compare in; empty for the one that the claim is ranked by.

    Returns:
        The comparison, None if the setting lacks one of the filters.
    """
    pair = _pair(experiment, setting)
    if pair is None:
        return None
    worse, better = pair
    score = score or experiment.ranked_by
    scores = [result.columns[column.name] for column in pair]
    ratio = paired_ratio(
        scores[0][score], scores[1][score], scores[0]["failed"], scores[1]["failed"]
    )
    row = printed_row(experiment, score)
    printed = [
        published_value(experiment.published, column.published, row) for column in (worse, better)
    ]
    published = float("nan")
    if printed[0] is not None and printed[1] is not None:
        published = printed[0] / printed[1]
    # The force is printed in the table's unit, all else in its own.
    scale = unit_of(experiment.published)[1] if score.startswith("force") else 1.0
    close = count = 0
    for column, value in zip(pair, printed, strict=True):
        if value is not None:
            count += 1
            ours = summary_of(result, column.name, score).median * scale
            close += bool(value / CLOSE <= ours <= value * CLOSE)
    failing = float(np.mean(scores[1]["failed"]))
    if failing >= MOSTLY_FAILED:
        verdict = FAILS
    elif ratio.median_low > 1.0:
        met = not np.isfinite(published) or ratio.median >= MET * published
        verdict = HOLDS if met else RANKING
    elif ratio.median_high < 1.0:
        verdict = OPPOSITE
    elif failing >= OFTEN_FAILED and ratio.median_low < ratio.median_high:
        verdict = UNRELIABLE
    else:
        verdict = NO_DIFFERENCE
    return Comparison(setting, verdict, ratio, published, (close, count))
