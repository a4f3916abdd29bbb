"""Our estimators, with their defaults, against the papers' printed figures and their filters.

Two questions, each counted over the experiments, with intervals as for the papers' claims. Is the
contact law at the estimated parameters, which is the force that the papers score, closer to the
true force than the best printed figure, with the identifiable parameters within 5 %? And is the
force half a second ahead, with the parameters held, closer than that of the best of the papers'
filters on the same data?
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from hc_evaluation.reproduction.campaign import ExperimentResult
from hc_evaluation.reproduction.experiment import Experiment
from hc_evaluation.reproduction.intervals import Summary, paired_ratio, summarise
from hc_evaluation.reproduction.published import published_table, published_value, unit_of
from hc_evaluation.reproduction.verdict import summary_of

TOLERANCE = 0.05
MET_YES, MET_NO, MET_OPEN = "yes", "no", "open"


def below(summary: Summary, limit: float) -> str:
    """Whether a median lies below a limit: yes or no with its whole interval, else open."""
    if not np.isfinite(limit) or np.isnan(summary.median):
        return MET_NO
    if summary.median_high < limit:
        return MET_YES
    return MET_NO if summary.median_low >= limit else MET_OPEN


@dataclass(frozen=True)
class Ours:
    """One of our estimators against the printed figures, and against the papers' filters.

    All forces are RMS over the run in N (paper C: root of the sum of squares, as printed there);
    every summary has its median with a 95 % interval.

    Attributes:
        column: its name.
        reported: error of the force that it reports.
        law: error of the contact law at its estimated motion and parameters, which is what the
            papers score.
        one_step: error of the force one step ahead, in the second half of the run.
        held: error of the force half a second ahead with the parameters held, in the second half.
        best: the smallest printed figure in the same unit; NaN if none is printed.
        law_below: whether `law` lies below `best`: yes, no, or open where its interval holds it.
        floor: what a regression on all readings so far reaches, in the same unit; NaN if there is
            none (see `floor`).
        parameter_error: largest error of an identifiable parameter; of nothing if none is.
        held_ratio: seed by seed, the smallest hold-forward error of the papers' filters as
            reproduced, in either setting, over ours.
        held_better: whether that ratio lies above 1: yes, no or open.
        mismatch: share of the samples of the second half at which it says that the contact law
            does not fit, median.
    """

    column: str
    reported: Summary
    law: Summary
    one_step: Summary
    held: Summary
    best: float
    law_below: str
    floor: float
    parameter_error: Summary
    held_ratio: Summary
    held_better: str
    mismatch: float

    @property
    def parameters_within(self) -> str:
        """Whether every identifiable parameter is within the tolerance; yes if none is seen."""
        if self.parameter_error.count == 0:
            return MET_YES
        return below(self.parameter_error, TOLERANCE)

    @property
    def meets_printed(self) -> str:
        """Law below the best printed force error, and identifiable parameters within 5 %."""
        answers = (self.law_below, self.parameters_within)
        if MET_NO in answers:
            return MET_NO
        return MET_OPEN if MET_OPEN in answers else MET_YES


def force_row(experiment: Experiment) -> tuple[str, str]:
    """Printed quantity and score in which our estimators are compared with the print."""
    for row, score in experiment.published_rows.items():
        if score in ("force_rmse", "tele_force_root_sum"):
            return row, score
    return "", "force_rmse"


LAW_SCORES = {"force_rmse": "law_rmse", "tele_force_root_sum": "tele_law_root_sum"}


def _papers_best(
    experiment: Experiment, result: ExperimentResult
) -> tuple[list[float], list[float]]:
    """Smallest hold-forward error of the papers' filters on each seed, and 1 where all failed."""
    best = np.full(len(result.seeds), np.inf)
    for column in experiment.columns:
        scores = result.columns[column.name]
        if column.setting == "ours" or "hold_forward_rmse" not in scores:
            continue
        held = np.asarray(scores["hold_forward_rmse"], np.float64)
        held = np.where(np.asarray(scores["failed"]) > 0.0, np.inf, held)
        best = np.fmin(best, held)
    return best.tolist(), np.isinf(best).astype(np.float64).tolist()


def ours(experiment: Experiment, result: ExperimentResult) -> list[Ours]:
    """Our estimators with their defaults against the printed figures and the papers' filters."""
    row, score = force_row(experiment)
    scale = unit_of(experiment.published)[1] if score.startswith("force") else 1.0
    printed = [
        value
        for name in published_table(experiment.published)
        if (value := published_value(experiment.published, name, row)) is not None
    ]
    best = min(printed) / scale if printed else float("nan")
    held_best, held_failed = _papers_best(experiment, result)
    known = any(np.isfinite(held_best))
    found = []
    for column in experiment.columns:
        if column.setting != "ours":
            continue
        law = summary_of(result, column.name, LAW_SCORES[score])
        scores = result.columns[column.name]
        ratio = summarise([], [])
        if known and "hold_forward_rmse" in scores:
            ratio = paired_ratio(
                held_best, scores["hold_forward_rmse"], held_failed, scores["failed"]
            )
        better = MET_NO
        if ratio.count:
            better = MET_YES if ratio.median_low > 1.0 else MET_OPEN
            better = MET_NO if ratio.median_high <= 1.0 else better
        name = "regression_rmse" if score == "force_rmse" else "regression_root_sum"
        found.append(
            Ours(
                column=column.name,
                reported=summary_of(result, column.name, score),
                law=law,
                one_step=summary_of(result, column.name, "one_step_rmse"),
                held=summary_of(result, column.name, "hold_forward_rmse"),
                best=best,
                law_below=below(law, best),
                floor=result.floors.get(name, float("nan")),
                parameter_error=summary_of(result, column.name, "error_identifiable"),
                held_ratio=ratio,
                held_better=better,
                mismatch=float(np.median(scores["mismatch_share"])),
            )
        )
    return found


@dataclass(frozen=True)
class Count:
    """In how many experiments one of our estimators does better, and where that is open.

    Attributes:
        column: its name.
        yes: names of the experiments where it does.
        open: where its interval does not tell.
        no: where it does not.
    """

    column: str
    yes: tuple[str, ...]
    open: tuple[str, ...]
    no: tuple[str, ...]


def count(
    answers: Mapping[str, Mapping[str, str]],
) -> list[Count]:
    """Sort the answers of each column.

    Args:
        answers: by experiment and column, "yes", "no" or "open".
    """
    columns = list(dict.fromkeys(name for found in answers.values() for name in found))
    return [
        Count(
            column,
            *(
                tuple(name for name, found in answers.items() if found.get(column) == word)
                for word in (MET_YES, MET_OPEN, MET_NO)
            ),
        )
        for column in columns
    ]
