"""Runs the accuracy experiments and holds their results against the targets.

`run_accuracy` is what `hc bench accuracy` calls. Seeds start at REPORT_SEED, far from those with
which the defaults were chosen.
"""

from __future__ import annotations

import multiprocessing
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import Any

import numpy as np

from hc_estimator import PARAMETER_NAMES
from hc_evaluation.accuracy import catalogue, measure
from hc_evaluation.accuracy.measure import Numbers, Setup, Task
from hc_evaluation.accuracy.recorded import RecordingTask, channel_run, recording_run
from hc_evaluation.accuracy.recordings import RECORDINGS, data_folder
from hc_evaluation.accuracy.scenarios import Scenario

REPORT_SEED = 100_000
SEEDS = 50
QUICK_SEEDS = 6
WORKERS = 2
LETTERS = ("K", "B", "n", "p")

RANDOM_RUNS = 6  # random scenarios per seed asked for
CHI_SQUARE_MEDIAN = 0.4549  # of one degree of freedom
FAR = 4.0  # bounds; exceeded by one of four Gaussian errors in 0.03 % of runs
DISHONEST = 20.0  # mean NEES over a run

Progress = Callable[[str, int, int], None]
Row = dict[str, Any]
Result = dict[str, Any]

EXPERIMENTS = (
    "tissues",
    "changes",
    "noise",
    "recordings",
    "excitation",
    "channels",
    "random",
    "defaults",
    "filters",
)
SUMMARIES = {
    "tissues": "errors against the Cramer-Rao bound, NEES, NIS, false alarms on quiet tissue",
    "changes": "time until an abruptly changed tissue is found again",
    "noise": "sensor noise jumping fourfold",
    "recordings": "half a second predicted on real recordings, against least squares",
    "excitation": "what a motion that shows too little leaves unknown",
    "channels": "time shift, force zero and contact position found between the channels",
    "random": "tissues, motions, rates and noises drawn at random",
    "defaults": "what each default of the recommended filter is worth",
    "filters": "all filters on all simulated tissues",
}

# Settings varied one at a time, and the filter's parts switched off, for `defaults`.
VARIATIONS: tuple[tuple[str, Mapping[str, object]], ...] = (
    ("defaults", {}),
    ("noise given, wrong by 3", {"noise_adaptation": "fixed", "force_noise_std": 0.03}),
    ("no motion adaptation", {"motion_adaptation": False}),
    ("no tempering", {"coherence_share": 0.0}),
    ("coherence_share x 2", {"coherence_share": 0.7}),
    ("coherence_share / 2", {"coherence_share": 0.175}),
    ("coherence_shortest x 2", {"coherence_shortest": 0.05}),
    ("coherence_shortest / 2", {"coherence_shortest": 0.0125}),
    ("coherence_longest x 3", {"coherence_longest": 0.84}),
    ("coherence_longest / 3", {"coherence_longest": 0.093}),
    ("alarm_threshold x 2", {"alarm_threshold": 90.0}),
    ("alarm_threshold / 2", {"alarm_threshold": 22.5}),
    ("alarm_drift 8", {"alarm_drift": 8.0}),
    ("alarm_drift 3.5", {"alarm_drift": 3.5}),
    ("model_error_time x 3", {"model_error_time": 4.5}),
    ("model_error_time / 3", {"model_error_time": 0.5}),
    ("probation x 2", {"probation": 4.0}),
    ("probation / 2", {"probation": 1.0}),
    ("contest_memory x 2", {"contest_memory": 1.0}),
    ("contest_memory / 2", {"contest_memory": 0.25}),
    ("no change found", {"find_changes": False}),
    (
        "walk 1e-8",
        dict.fromkeys(
            (
                "stiffness_log_walk",
                "damping_log_walk",
                "displacement_exponent_walk",
                "velocity_exponent_walk",
            ),
            1e-8,
        ),
    ),
    (
        "walk 1e-6",
        dict.fromkeys(
            (
                "stiffness_log_walk",
                "damping_log_walk",
                "displacement_exponent_walk",
                "velocity_exponent_walk",
            ),
            1e-6,
        ),
    ),
    ("noise_memory x 3", {"noise_memory": 3000.0}),
    ("noise_memory / 3", {"noise_memory": 333.0}),
    ("motion_memory x 3", {"motion_memory": 1200.0}),
    ("motion_memory / 3", {"motion_memory": 133.0}),
)
DEFAULTS_TISSUES = (catalogue.REFERENCE, catalogue.STIFF, catalogue.SOFT, catalogue.STEEP)
DEFAULTS_CHANGES = (catalogue.CHANGES[0], catalogue.CHANGES[3])
DEFAULTS_MISFIT = tuple(catalogue.CHANNEL_FAULTS[i] for i in (1, 3, 4, 6))
DEFAULTS_WEAK = (catalogue.WEAK_MOTIONS[0], catalogue.WEAK_MOTIONS[2])


def run_accuracy(
    names: Sequence[str] = (),
    seeds: int | None = None,
    quick: bool = False,
    progress: Progress | None = None,
    setup: Setup | None = None,
) -> Result:
    """Run experiments and compare with their targets.

    Args:
        names: some of EXPERIMENTS; none for the first seven.
        seeds: noise seeds per scenario (50; 6 where quick).
        quick: few seeds, for a first look.
        progress: called with the experiment's name, runs done and runs in all.
        setup: estimator under test; the recommended filter with its defaults if None.

    Returns:
        Plain data: per experiment its rows (one per scenario or recording) and targets (name,
        value, low, high, met), the seeds, and the seconds it took.

    Raises:
        ValueError: an unknown name, or seeds below 1.
    """
    chosen = tuple(names) or EXPERIMENTS[:7]
    for name in chosen:
        if name not in EXPERIMENTS:
            raise ValueError(f"experiment {name!r} is not one of {', '.join(EXPERIMENTS)}")
    count = seeds if seeds is not None else (QUICK_SEEDS if quick else SEEDS)
    if count < 1:
        raise ValueError(f"seeds = {count}: give 1 or more")
    estimator = setup if setup is not None else Setup()
    started = time.perf_counter()
    result: Result = {
        "filter": estimator.filter,
        "parameters": dict(estimator.parameters),
        "seeds": count,
        "first_seed": REPORT_SEED,
        "experiments": {},
    }
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(WORKERS, mp_context=context) as pool:
        for name in chosen:

            def report(done: int, total: int, name: str = name) -> None:
                if progress is not None:
                    progress(name, done, total)

            experiment = _RUNNERS[name](pool, estimator, count, report)
            result["experiments"][name] = {"summary": SUMMARIES[name], **experiment}
    result["seconds"] = time.perf_counter() - started
    return result


def _spread(
    pool: ProcessPoolExecutor,
    function: Callable[[Any], Any],
    tasks: Sequence[Any],
    report: Callable[[int, int], None],
) -> list[Any]:
    results = []
    chunk = max(1, min(8, len(tasks) // (4 * WORKERS)))
    for done, numbers in enumerate(pool.map(function, tasks, chunksize=chunk), start=1):
        results.append(numbers)
        report(done, len(tasks))
    return results


def _runs(
    pool: ProcessPoolExecutor,
    function: Callable[[Task], Numbers],
    setup: Setup,
    scenarios: Sequence[Scenario],
    seeds: int,
    report: Callable[[int, int], None],
) -> list[dict[str, np.ndarray[Any, Any]]]:
    """All seeds of all scenarios; per scenario one array of shape (seeds,) for each number."""
    tasks = [
        Task(setup, scenario, REPORT_SEED + seed) for scenario in scenarios for seed in range(seeds)
    ]
    flat = _spread(pool, function, tasks, report)
    grouped = []
    for index in range(len(scenarios)):
        numbers = flat[index * seeds : (index + 1) * seeds]
        grouped.append({key: np.array([n[key] for n in numbers]) for key in numbers[0]})
    return grouped


def target(name: str, value: float, low: float | None = None, high: float | None = None) -> Row:
    """A figure beside the range that the project asks of it."""
    met = bool(
        np.isfinite(value) and (low is None or value >= low) and (high is None or value <= high)
    )
    return {"name": name, "value": float(value), "low": low, "high": high, "met": met}


def _worst(values: Iterable[float], high: bool = True) -> float:
    array = np.array(list(values), dtype=np.float64)
    return float(np.max(array) if high else np.min(array))


def _tissues(
    pool: ProcessPoolExecutor, setup: Setup, seeds: int, report: Callable[[int, int], None]
) -> Result:
    scenarios = catalogue.TISSUES
    rows = quiet_rows(scenarios, _runs(pool, measure.quiet_run, setup, scenarios, seeds, report))
    seconds = sum(row["seconds"] for row in rows)
    alarms = sum(row["changes"] for row in rows)
    targets = [
        target(
            "largest RMS error at 10 s over its bound",
            _worst(max(row["ratio"]) for row in rows),
            high=1.5,
        ),
        target("smallest mean NEES", _worst((row["nees"] for row in rows), False), low=2.5),
        target("largest mean NEES", _worst(row["nees"] for row in rows), high=6.0),
        target("smallest mean NIS", _worst((row["nis"] for row in rows), False), low=1.6),
        target("largest mean NIS", _worst(row["nis"] for row in rows), high=2.4),
        target(
            "least share of samples after 1.5 s with what is excited within 5 %",
            _worst((row["within"] for row in rows), False),
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


def _changes(
    pool: ProcessPoolExecutor, setup: Setup, seeds: int, report: Callable[[int, int], None]
) -> Result:
    scenarios = catalogue.CHANGES
    rows: list[Row] = []
    for scenario, runs in zip(
        scenarios, _runs(pool, measure.change_run, setup, scenarios, seeds, report), strict=True
    ):
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
                high=float(np.nanmax([0.5, 1.5 * row["bound_s"]])),
            )
        )
        targets.append(
            target(f"{row['scenario']}: median error after 2 s", row["error_after_2s"], high=0.01)
        )
    targets.append(target("changes missed", float(sum(r["missed"] for r in rows)), high=0.0))
    return {"rows": rows, "targets": targets}


def _noise(
    pool: ProcessPoolExecutor, setup: Setup, seeds: int, report: Callable[[int, int], None]
) -> Result:
    scenarios = catalogue.NOISE_JUMPS
    rows: list[Row] = []
    for scenario, runs in zip(
        scenarios, _runs(pool, measure.noise_run, setup, scenarios, seeds, report), strict=True
    ):
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
        target("smallest NIS after the jump", _worst((r["nis_after"] for r in rows), False), 1.6),
        target("largest NIS after the jump", _worst(r["nis_after"] for r in rows), high=2.4),
        target(
            "largest median of the worst error after the jump",
            _worst(r["worst_error"] for r in rows),
            high=0.02,
        ),
        target("noise jumps called a change", float(sum(r["changes"] for r in rows)), high=0.0),
    ]
    return {"rows": rows, "targets": targets}


def _recordings(
    pool: ProcessPoolExecutor, setup: Setup, seeds: int, report: Callable[[int, int], None]
) -> Result:
    del seeds  # a recording has one noise
    folder = data_folder()
    if folder is None:
        return {"rows": [], "targets": [], "skipped": "the folder with the recordings is absent"}
    tasks = [RecordingTask(setup, recording, str(folder)) for recording in RECORDINGS]
    rows = _spread(pool, recording_run, tasks, report)
    targets = []
    for row, recording in zip(rows, RECORDINGS, strict=True):
        if recording.palpation:
            targets.append(
                target(f"{row['recording']}: hold-forward over floor", row["ratio"], high=1.1)
            )
            targets.append(target(f"{row['recording']}: changes called", row["changes"], high=0.0))
        if recording.model_fits:
            targets.append(
                target(f"{row['recording']}: K off the batch fit", row["k_off"], -0.05, 0.05)
            )
            targets.append(
                target(f"{row['recording']}: n off the batch fit", row["n_off"], -0.05, 0.05)
            )
    return {"rows": rows, "targets": targets}


def _excitation(
    pool: ProcessPoolExecutor, setup: Setup, seeds: int, report: Callable[[int, int], None]
) -> Result:
    scenarios = catalogue.WEAK_MOTIONS
    rows: list[Row] = []
    for scenario, runs in zip(
        scenarios, _runs(pool, measure.weak_run, setup, scenarios, seeds, report), strict=True
    ):
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
        target("largest mean NEES", _worst(r["nees"] for r in rows), high=9.0),
        target("drift in free motion", _worst(r["free_drift"] for r in rows), high=1e-6),
        target("identifiability in free motion", max(free["identifiability"]), high=1e-3),
        target("changes called", float(sum(r["changes"] for r in rows)), high=0.0),
    ]
    return {"rows": rows, "targets": targets}


def _channels(
    pool: ProcessPoolExecutor, setup: Setup, seeds: int, report: Callable[[int, int], None]
) -> Result:
    del seeds
    folder = data_folder()
    tasks: list[Any] = [(setup, scenario, None) for scenario in catalogue.CHANNEL_FAULTS]
    if folder is not None:
        tasks += [(setup, r, str(folder)) for r in RECORDINGS if r.palpation]
    rows = _spread(pool, channel_run, tasks, report)
    targets = []
    for row in rows:
        for key in ("delay_s", "zero_n", "contact_mm"):
            if f"{key}_true" in row:
                off = abs(row[key] - row[f"{key}_true"]) / row[f"{key}_std"]
                targets.append(target(f"{row['name']}: {key} off, in its deviations", off, high=4))
    return {"rows": rows, "targets": targets}


def _random(
    pool: ProcessPoolExecutor, setup: Setup, seeds: int, report: Callable[[int, int], None]
) -> Result:
    scenarios = [catalogue.random_scenario(REPORT_SEED + i) for i in range(RANDOM_RUNS * seeds)]
    tasks = [Task(setup, scenario, REPORT_SEED) for scenario in scenarios]
    runs = _spread(pool, measure.quiet_run, tasks, report)
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
                "far": float(np.mean(np.max(ratios, axis=1) > FAR)),
                "nees": float(np.median(consistency)),
                "nees_high": float(np.mean(consistency > DISHONEST)),
                "nis": float(np.mean([r["nis"] for r in chosen])),
                "within": float(np.nanmean([r["within"] for r in chosen])),
                "changes": float(np.sum([r["changes"] for r in chosen])),
                "mismatch": float(np.mean([r["mismatch"] for r in chosen])),
                "seconds": float(np.sum([r["seconds"] for r in chosen])),
            }
        )
    every = rows[-1]
    targets = [
        target("largest typical error over its bound", max(every["rms_ratio"]), high=1.5),
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


def _defaults(
    pool: ProcessPoolExecutor, setup: Setup, seeds: int, report: Callable[[int, int], None]
) -> Result:
    few = max(2, seeds // 5)
    folder = data_folder()
    rows: list[Row] = []
    for index, (name, parameters) in enumerate(VARIATIONS):
        varied = Setup(setup.filter, {**setup.parameters, **parameters})

        def nothing(done: int, total: int) -> None:
            del done, total

        quiet = quiet_rows(
            DEFAULTS_TISSUES,
            _runs(pool, measure.quiet_run, varied, DEFAULTS_TISSUES, few, nothing),
        )
        changed = _runs(pool, measure.change_run, varied, DEFAULTS_CHANGES, few, nothing)
        weak = _runs(pool, measure.weak_run, varied, DEFAULTS_WEAK, few, nothing)
        misfit = _runs(pool, measure.quiet_run, varied, DEFAULTS_MISFIT, few, nothing)
        row: Row = {
            "variation": name,
            "ratio": _worst(max(r["ratio"]) for r in quiet),
            "nees_low": _worst((r["nees"] for r in quiet), False),
            "nees_high": _worst(r["nees"] for r in quiet),
            "nis_low": _worst((r["nis"] for r in quiet), False),
            "nis_high": _worst(r["nis"] for r in quiet),
            "false_alarms": float(sum(r["changes"] for r in quiet)),
            "settling_s": _worst(float(np.median(c["settling_s"])) for c in changed),
            "misfit_calls": float(np.mean([np.mean(m["changes"]) for m in misfit])),
            "weak_nees": _worst(float(np.mean(w["nees"])) for w in weak),
        }
        if folder is not None:
            sines = [
                RecordingTask(varied, recording, str(folder), causal=False)
                for recording in RECORDINGS
                if recording.palpation and recording.model_fits
            ]
            recorded = _spread(pool, recording_run, sines, nothing)
            row["recordings"] = _worst(r["ratio"] for r in recorded[:-1])
            row["press"] = float(recorded[-1]["ratio"])
            row["recorded_changes"] = float(sum(r["changes"] for r in recorded))
        rows.append(row)
        report(index + 1, len(VARIATIONS))
    return {"rows": rows, "targets": []}


def _filters(
    pool: ProcessPoolExecutor, setup: Setup, seeds: int, report: Callable[[int, int], None]
) -> Result:
    from hc_estimator import available_filters

    del setup
    few = max(2, seeds // 5)
    rows: list[Row] = []
    names = available_filters()
    for index, name in enumerate(names):

        def nothing(done: int, total: int) -> None:
            del done, total

        groups = _runs(pool, measure.plain_run, Setup(name), catalogue.TISSUES, few, nothing)
        for scenario, runs in zip(catalogue.TISSUES, groups, strict=True):
            rows.append(
                {
                    "filter": name,
                    "scenario": scenario.name,
                    "median_error": [float(np.median(runs[f"relative_{i}"])) for i in range(4)],
                    "force_rms": float(np.median(runs["force_rms"])),
                    "nees": float(np.median(runs["nees"])),
                    "nis": float(np.median(runs["nis"])),
                }
            )
        report(index + 1, len(names))
    return {"rows": rows, "targets": [], "parameters": list(PARAMETER_NAMES)}


_RUNNERS: dict[
    str, Callable[[ProcessPoolExecutor, Setup, int, Callable[[int, int], None]], Result]
] = {
    "tissues": _tissues,
    "changes": _changes,
    "noise": _noise,
    "recordings": _recordings,
    "excitation": _excitation,
    "channels": _channels,
    "random": _random,
    "defaults": _defaults,
    "filters": _filters,
}
