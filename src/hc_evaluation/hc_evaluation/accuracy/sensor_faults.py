"""Sensors that nobody watches: is K true, and what is said of it, while they fail a little?

Contacts of `faulty_sensors`, with the default settings; only where one channel's reading is lost
and the other's is not, the estimator has to know that NaN is a missing reading. What counts is
everything after eight seconds of contact.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from hc_evaluation import metrics
from hc_evaluation.accuracy.bench import Bench, Result, Row, target, worst
from hc_evaluation.accuracy.faulty_sensors import (
    LEARNING_S,
    LOST,
    NOTHING,
    UNEVEN,
    ZEROS,
    FaultyReadings,
    faulty_readings,
    first_touch_s,
)
from hc_evaluation.accuracy.measure import Numbers, Setup, known_mean
from hc_evaluation.accuracy.rates import declared
from hc_evaluation.accuracy.troubles import (
    AFTER_S,
    BEFORE_S,
    CALLED_S,
    OFTEN,
    TroubleTask,
    claims,
    errors_of,
)

USUAL = 0.9  # of the samples of a run, and of the runs
WITHIN = 3.0  # deviations
CHOSEN_HZ = 20.0  # at which consistency is looked at


def fault_run(task: TroubleTask) -> Numbers:
    """Errors of K, what was claimed of them, consistency, changes and misfit that are none."""
    return scores(task.setup, faulty_readings(task.trouble, task.seed))


def counted_of(readings: FaultyReadings) -> NDArray[np.bool_]:
    """Samples whose estimate counts, shape (N,)."""
    time, moved = readings.contact.time_s, readings.moved_s
    counted: NDArray[np.bool_] = time >= first_touch_s(readings.contact) + LEARNING_S
    if moved is not None:
        counted &= ~((time > moved - BEFORE_S) & (time < moved + AFTER_S))
    return counted


def scores(setup: Setup, readings: FaultyReadings) -> Numbers:
    """What an estimator makes of the readings."""
    contact = readings.contact
    series = setup.create().run(contact.time_s, contact.displacement_mm, contact.force_n)
    counted = counted_of(readings)
    parameters, truth = series.parameters[counted], contact.parameters[counted]
    error, deviation = errors_of(series, contact.parameters, counted)
    seconds = float(contact.time_s[-1]) - float(contact.time_s[counted][0])
    chosen = slice(None, None, max(1, round(error.size / seconds / CHOSEN_HZ)))
    nees = metrics.nees(parameters[chosen], series.covariance[counted][chosen], truth[chosen])
    late = contact.time_s >= first_touch_s(contact) + CALLED_S
    called = np.asarray(series.change_detected, np.bool_) & late
    return claims(error, deviation, series.model_mismatch[counted]) | {
        "K_90": float(np.quantile(error, USUAL)),
        "within": float(np.mean(error <= WITHIN * deviation)),
        "changes": float(np.count_nonzero(called)),
        "nees": known_mean(nees),
    }


def _row(name: str, runs: Sequence[Numbers], faultless: Sequence[Numbers]) -> Row:
    """A line of the table; `over` is that of the errors at 90 % of the same contact's samples."""
    columns = {key: np.array([run[key] for run in runs]) for key in runs[0]}
    usual = np.array([run["K_90"] for run in faultless])
    return {
        "fault": name,
        "K": float(np.median(columns["K"])),
        "K_90": float(np.quantile(columns["K_90"], USUAL)),
        "over": float(np.median(columns["K_90"] / usual)),
        "deviation": float(np.median(columns["deviation"])),
        "within": float(np.mean(columns["within"])),
        "nees": float(np.mean(columns["nees"])),
        "nees_median": float(np.median(columns["nees"])),
        "wrong": float(np.mean(columns["wrong"])),
        "often": float(np.mean(columns["wrong"] > OFTEN)),
        "mismatch": float(np.mean(columns["mismatch"])),
        "changes": float(np.sum(columns["changes"])),
    }


def sensor_faults(bench: Bench) -> Result:
    """Every fault alone, in the same contacts."""
    missing_allowed, skipped = declared(bench)
    if skipped is not None:
        return skipped
    names = (NOTHING, *LOST, *UNEVEN, *ZEROS)
    tasks = [
        TroubleTask(missing_allowed if name in LOST else bench.setup, name, bench.first_seed + seed)
        for name in names
        for seed in range(bench.seeds)
    ]
    runs = bench.by_seed(fault_run, tasks)
    rows = [_row(name, of_fault, runs[0]) for name, of_fault in zip(names, runs, strict=True)]
    return {"rows": rows, "targets": _targets({row["fault"]: row for row in rows})}


def _targets(rows: Mapping[str, Row]) -> list[Row]:
    nothing, zeros = rows[NOTHING], [rows[name] for name in ZEROS]
    uneven = [rows[name] for name in (*LOST, *UNEVEN)]
    largest = worst(row["K_90"] for row in uneven) / nothing["K_90"]
    return [
        target("nothing: share told wrong", nothing["wrong"], high=0.01),
        target("nothing: misfit told", nothing["mismatch"], high=0.02),
        *(
            target(f"{row['fault']}: error over that without", row["over"], high=1.5)
            for row in uneven
        ),
        target("readings: K at 90 %, 9 of 10 runs, over that without", largest, high=1.5),
        target("readings: smallest mean NEES", worst((r["nees"] for r in uneven), False), low=2.0),
        target("readings: largest mean NEES", worst(r["nees"] for r in uneven), high=6.0),
        target("readings: share told wrong", worst(r["wrong"] for r in uneven), high=0.01),
        target("readings: misfit told", worst(r["mismatch"] for r in uneven), high=0.02),
        *(target(f"{row['fault']}: share told wrong", row["wrong"], high=0.05) for row in zeros),
        *(target(f"{row['fault']}: misfit told", row["mismatch"], high=0.05) for row in zeros),
        target("zeros: K at 90 %, 9 of 10 runs", worst(r["K_90"] for r in zeros), high=0.05),
        target(
            "zeros: least share of the samples with K within 3 deviations",
            worst((r["within"] for r in zeros), False),
            low=0.95,
        ),
        target(
            "changes called where none is",
            float(sum(r["changes"] for r in rows.values())),
            high=0.0,
        ),
    ]
