"""Is K true within what is said of it, whatever the motion and whatever is wrong?

Contacts of `drawn_contact`: nothing wrong, each trouble alone, and two and three at once. What
counts is what a user would believe and should not: samples whose K is further off than four stated
deviations and a per cent, with no misfit told.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hc_evaluation import metrics
from hc_evaluation.accuracy.bench import Bench, Result, Row, target, worst
from hc_evaluation.accuracy.drawn_contact import TROUBLES, DrawnContact, drawn_contact
from hc_evaluation.accuracy.measure import Numbers, Setup

FloatArray = NDArray[np.float64]

START_S = 8.0  # from when on the estimate counts
BEFORE_S, AFTER_S = 0.1, 2.0  # about an abrupt change it does not
LIKELY = 4.0  # deviations
NEGLIGIBLE = 0.01  # of K
OFTEN = 0.1  # of a run's samples
CALLED_S = 2.0  # a change counts as called for so long after it
NOTHING = "nothing"
COUNTS = {"two of them": 2, "three of them": 3}


@dataclass(frozen=True)
class TroubleTask:
    """One run: estimator, the trouble (or how many of them) and seed."""

    setup: Setup
    trouble: str
    seed: int


def troubles_of(name: str, seed: int) -> tuple[str, ...]:
    """The troubles that a row's name and a seed stand for.

    Raises:
        KeyError: no such row.
    """
    if name == NOTHING:
        return ()
    if name in COUNTS:
        draw = np.random.default_rng([seed, 779])
        chosen = draw.choice(sorted(TROUBLES), COUNTS[name], replace=False)
        return tuple(str(trouble) for trouble in chosen)
    if name not in TROUBLES:
        raise KeyError(name)
    return (name,)


def trouble_run(task: TroubleTask) -> Numbers:
    """Errors of K, what was claimed of them, changes and misfit told."""
    contact = drawn_contact(troubles_of(task.trouble, task.seed), task.seed)
    return believed(task.setup, contact)


def errors_of(
    series: Any, truth: FloatArray, counted: NDArray[np.bool_]
) -> tuple[FloatArray, FloatArray]:
    """Errors of ln K of the samples that count, and the deviations that are claimed of them."""
    parameters = series.parameters[counted]
    error: FloatArray = np.abs(metrics.log_parameter_error(parameters, truth[counted])[:, 0])
    return error, series.parameters_std[counted, 0] / parameters[:, 0]


def claims(error: FloatArray, deviation: FloatArray, mismatch: ArrayLike) -> Numbers:
    """What an estimator claims of K: wrong is what is unlikely, and of which no misfit is said.

    Args:
        error: of ln K, shape (N,).
        deviation: that is claimed of it, shape (N,).
        mismatch: whether a misfit is said, shape (N,).
    """
    flagged = np.asarray(mismatch, np.bool_)
    wrong = ~flagged & ~(error <= LIKELY * deviation + NEGLIGIBLE)
    return {
        "K": float(np.median(error)),
        "deviation": float(np.median(deviation)),
        "wrong": float(np.mean(wrong)),
        "mismatch": float(np.mean(flagged)),
    }


def believed(setup: Setup, contact: DrawnContact) -> Numbers:
    """Errors of K along a contact, what an estimator claims of them, changes and misfit told."""
    series = setup.create().run(contact.time_s, contact.displacement_mm, contact.force_n)
    time, changed = contact.time_s, contact.changed_s
    counted = time >= START_S
    called = np.asarray(series.change_detected, np.bool_) & (time >= CALLED_S)
    if changed is not None:
        counted &= ~((time > changed - BEFORE_S) & (time < changed + AFTER_S))
        called &= ~((time >= changed) & (time < changed + CALLED_S))
    error, deviation = errors_of(series, contact.parameters, counted)
    return claims(error, deviation, series.model_mismatch[counted]) | {
        "changes": float(np.count_nonzero(called))
    }


def _row(name: str, runs: Sequence[Numbers]) -> Row:
    columns = {key: np.array([run[key] for run in runs]) for key in runs[0]}
    return {
        "trouble": name,
        "K": float(np.median(columns["K"])),
        "K_90": float(np.quantile(columns["K"], 0.9)),
        "deviation": float(np.median(columns["deviation"])),
        "wrong": float(np.mean(columns["wrong"])),
        "often": float(np.mean(columns["wrong"] > OFTEN)),
        "mismatch": float(np.mean(columns["mismatch"])),
        "changes": float(np.sum(columns["changes"])),
    }


def rows_of(bench: Bench, run: Callable[[TroubleTask], Numbers], names: Sequence[str]) -> list[Row]:
    """One row of the table for each trouble, over the runs of all seeds."""
    tasks = [
        TroubleTask(bench.setup, name, bench.first_seed + seed)
        for name in names
        for seed in range(bench.seeds)
    ]
    return [_row(name, runs) for name, runs in zip(names, bench.by_seed(run, tasks), strict=True)]


def troubles(bench: Bench) -> Result:
    """Everything drawn, with every trouble alone and with several at once."""
    rows = rows_of(bench, trouble_run, (NOTHING, *TROUBLES, *COUNTS))
    alone = [row for row in rows if row["trouble"] in TROUBLES]
    several = [row for row in rows if row["trouble"] in COUNTS]
    targets = [
        target("nothing wrong: share told wrong", rows[0]["wrong"], high=0.01),
        target("nothing wrong: misfit told", rows[0]["mismatch"], high=0.02),
        target("one trouble: share told wrong", worst(r["wrong"] for r in alone), high=0.05),
        target("several: share told wrong", worst(r["wrong"] for r in several), high=0.1),
        target("changes called where none is", float(sum(r["changes"] for r in rows)), high=0.0),
    ]
    return {"rows": rows, "targets": targets}
