"""The experiments on simulated contacts: reduce many runs to rows and targets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from hc_evaluation.accuracy import catalogue, measure
from hc_evaluation.accuracy.bench import Bench, Result, Row, target, worst
from hc_evaluation.accuracy.measure import Task
from hc_evaluation.accuracy.scenarios import Scenario

RANDOM_RUNS = 6  # random scenarios per seed asked for
CHI_SQUARE_MEDIAN = 0.4549  # of one degree of freedom
QUICK_S = 0.3  # within 5 % again after a change, where the bound allows it
FAR = 4.0  # bounds; exceeded by one of four Gaussian errors in 0.03 % of runs
DISHONEST = 20.0  # mean NEES over a run


def tissues(bench: Bench) -> Result:
    """Tissues that do not change: errors against the bound, consistency, false alarms."""
    scenarios = catalogue.TISSUES
    rows = quiet_rows(scenarios, bench.runs(measure.quiet_run, scenarios))
    seconds = sum(row["seconds"] for row in rows)
    alarms = sum(row["changes"] for row in rows)
    targets = [
        target(
            "largest RMS error at 10 s over its bound",
            worst(worst(row["ratio"]) for row in rows),
            high=1.5,
        ),
        target("smallest mean NEES", worst((row["nees"] for row in rows), False), low=2.5),
        target("largest mean NEES", worst(row["nees"] for row in rows), high=6.0),
        target("smallest mean NIS", worst((row["nis"] for row in rows), False), low=1.6),
        target("largest mean NIS", worst(row["nis"] for row in rows), high=2.4),
        target(
            "least share of samples after 1.5 s with what is excited within 5 %",
            worst((row["within"] for row in rows), False),
            low=0.95,
        ),
        target("false alarms in 100 s of quiet tissue", 100.0 * alarms / seconds, high=1.0),
    ]
    return {"rows": rows, "targets": targets}


def quiet_rows(
    scenarios: Sequence[Scenario], groups: Sequence[Mapping[str, np.ndarray[Any, Any]]]
) -> list[Row]:
    """Reduce runs on quiet tissue to one row per scenario."""
    rows: list[Row] = []
    for scenario, runs in zip(scenarios, groups, strict=True):
        errors = np.column_stack([runs[f"error_{i}"] for i in range(4)])
        bounds = np.column_stack([runs[f"bound_{i}"] for i in range(4)])
        rms = np.sqrt(np.mean(errors**2, axis=0))
        bound = np.sqrt(np.mean(bounds**2, axis=0))
        rows.append(
            {
                "scenario": scenario.name,
                "note": scenario.note,
                "rms_error": rms.tolist(),
                "bound": bound.tolist(),
                "ratio": (rms / bound).tolist(),
                "nees": float(np.mean(runs["nees"])),
                "nis": float(np.mean(runs["nis"])),
                "within": float(np.nanmean(runs["within"])),
                "changes": float(np.sum(runs["changes"])),
                "mismatch": float(np.mean(runs["mismatch"])),
                "seconds": float(np.sum(runs["seconds"])),
                "force_rms": float(np.sqrt(np.mean(runs["force_rms"] ** 2))),
                "runs": int(rms.size and errors.shape[0]),
            }
        )
    return rows


def changes(bench: Bench) -> Result:
    """Abruptly changed tissues."""
    scenarios = catalogue.CHANGES
    rows: list[Row] = []
    for scenario, runs in zip(scenarios, bench.runs(measure.change_run, scenarios), strict=True):
        rows.append(
            {
                "scenario": scenario.name,
                "settling_s": float(np.median(runs["settling_s"])),
                "bound_s": float(np.median(runs["bound_s"])),
                "settling_90_s": float(np.quantile(runs["settling_s"], 0.9)),
                "error_after_2s": float(np.median(runs["error_after_2s"])),
                "delay_s": float(np.nanmedian(runs["delay_s"]))
                if np.any(np.isfinite(runs["delay_s"]))
                else float("nan"),
                "missed": int(np.count_nonzero(runs["calls"] == 0)),
                "calls": float(np.mean(runs["calls"])),
                "early_calls": int(np.sum(runs["early_calls"])),
            }
        )
    targets = []
    for row in rows:
        targets.append(
            target(
                f"{row['scenario']}: median s until 5 %",
                row["settling_s"],
                # No estimator is asked for what the bound does not allow.
                high=max(QUICK_S, 1.5 * row["bound_s"]),
            )
        )
        targets.append(
            target(f"{row['scenario']}: median error after 2 s", row["error_after_2s"], high=0.01)
        )
    targets.append(target("changes missed", float(sum(r["missed"] for r in rows)), high=0.0))
    return {"rows": rows, "targets": targets}


def noise(bench: Bench) -> Result:
    """Sensors that turn noisier."""
    scenarios = catalogue.NOISE_JUMPS
    rows: list[Row] = []
    for scenario, runs in zip(scenarios, bench.runs(measure.noise_run, scenarios), strict=True):
        rows.append(
            {
                "scenario": scenario.name,
                "nis_before": float(np.mean(runs["nis_before"])),
                "nis_after": float(np.mean(runs["nis_after"])),
                "worst_error": float(np.median(runs["worst_error"])),
                "worst_error_max": float(np.max(runs["worst_error"])),
                "changes": int(np.sum(runs["changes"])),
                "mismatch": float(np.mean(runs["mismatch"])),
            }
        )
    targets = [
        target("smallest NIS after the jump", worst((r["nis_after"] for r in rows), False), 1.6),
        target("largest NIS after the jump", worst(r["nis_after"] for r in rows), high=2.4),
        target(
            "largest median of the worst error after the jump",
            worst(r["worst_error"] for r in rows),
            high=0.02,
        ),
        target("noise jumps called a change", float(sum(r["changes"] for r in rows)), high=0.0),
    ]
    return {"rows": rows, "targets": targets}


def excitation(bench: Bench) -> Result:
    """Motions that show too little."""
    scenarios = catalogue.WEAK_MOTIONS
    rows: list[Row] = []
    for scenario, runs in zip(scenarios, bench.runs(measure.weak_run, scenarios), strict=True):
        row: Row = {"scenario": scenario.name}
        for key in ("error", "deviation", "identifiability"):
            columns = np.column_stack([runs[f"{key}_{i}"] for i in range(4)])
            row[key] = np.sqrt(np.mean(columns**2, axis=0)).tolist()
        row["nees"] = float(np.mean(runs["nees"]))
        row["changes"] = int(np.sum(runs["changes"]))
        row["free_drift"] = float(np.max(runs["free_drift"]))
        row["force_rms"] = float(np.sqrt(np.mean(runs["force_rms"] ** 2)))
        rows.append(row)
    free = next(r for r in rows if r["scenario"] == "free_motion")
    targets = [
        target("largest mean NEES", worst(r["nees"] for r in rows), high=9.0),
        target("drift in free motion", worst(r["free_drift"] for r in rows), high=1e-6),
        target("identifiability in free motion", worst(free["identifiability"]), high=1e-3),
        target("changes called", float(sum(r["changes"] for r in rows)), high=0.0),
    ]
    return {"rows": rows, "targets": targets}


def random(bench: Bench) -> Result:
    """Everything drawn at random."""
    seeds = range(bench.first_seed, bench.first_seed + RANDOM_RUNS * bench.seeds)
    scenarios = [catalogue.random_scenario(seed) for seed in seeds]
    # Each with its own noise: errors of runs with the same noise go the same way.
    tasks = [Task(bench.setup, s, seed) for s, seed in zip(scenarios, seeds, strict=True)]
    runs = bench.spread(measure.quiet_run, tasks)
    rates = sorted({scenario.rate_hz for scenario in scenarios})
    rows: list[Row] = []
    for rate in [*rates, None]:
        chosen = [
            run
            for scenario, run in zip(scenarios, runs, strict=True)
            if rate is None or scenario.rate_hz == rate
        ]
        ratios = np.array(
            [[abs(r[f"error_{i}"]) / r[f"bound_{i}"] for i in range(4)] for r in chosen]
        )
        consistency = np.array([r["nees"] for r in chosen])
        rows.append(
            {
                "rate": "all" if rate is None else f"{rate:.0f} Hz",
                "runs": len(chosen),
                "rms_ratio": np.sqrt(np.median(ratios**2, axis=0) / CHI_SQUARE_MEDIAN).tolist(),
                "far": float(np.mean(~(np.max(ratios, axis=1) <= FAR))),
                "nees": float(np.median(consistency)),
                "nees_high": float(np.mean(~(consistency <= DISHONEST))),
                "nis": float(np.mean([r["nis"] for r in chosen])),
                "within": float(np.nanmean([r["within"] for r in chosen])),
                "changes": float(np.sum([r["changes"] for r in chosen])),
                "mismatch": float(np.mean([r["mismatch"] for r in chosen])),
                "seconds": float(np.sum([r["seconds"] for r in chosen])),
            }
        )
    every = rows[-1]
    targets = [
        target("largest typical error over its bound", worst(every["rms_ratio"]), high=1.5),
        target("share of runs with an error beyond 4 bounds", every["far"], high=0.05),
        target("median NEES", every["nees"], 2.5, 6.0),
        target("mean NIS", every["nis"], 1.6, 2.4),
        target(
            "false alarms in 100 s of quiet tissue",
            100.0 * every["changes"] / every["seconds"],
            high=1.0,
        ),
    ]
    return {"rows": rows, "targets": targets}
