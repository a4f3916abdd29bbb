"""Comparisons: each default varied on its own, and all filters beside each other."""

from __future__ import annotations

import numpy as np

from hc_estimator import available_filters
from hc_evaluation.accuracy import catalogue, measure
from hc_evaluation.accuracy.bench import Bench, Result, Row, worst
from hc_evaluation.accuracy.filter_variations import VARIATIONS
from hc_evaluation.accuracy.measure import Setup
from hc_evaluation.accuracy.recorded import RecordingTask, recording_run
from hc_evaluation.accuracy.recordings import RECORDINGS, data_folder
from hc_evaluation.accuracy.simulated import quiet_rows

DEFAULTS_TISSUES = (catalogue.REFERENCE, catalogue.STIFF, catalogue.SOFT, catalogue.STEEP)
DEFAULTS_CHANGES = (catalogue.CHANGES[0], catalogue.CHANGES[3])
DEFAULTS_MISFIT = tuple(catalogue.CHANNEL_FAULTS[i] for i in (1, 3, 4, 6))
DEFAULTS_WEAK = (catalogue.WEAK_MOTIONS[0], catalogue.WEAK_MOTIONS[2])


def defaults(bench: Bench) -> Result:
    """Every default varied on its own."""
    few = max(2, bench.seeds // 5)
    folder = data_folder()
    rows: list[Row] = []
    for index, (name, parameters) in enumerate(VARIATIONS):
        varied = bench.setup.with_parameters(parameters)
        part = bench.part(varied, few)

        quiet = quiet_rows(
            DEFAULTS_TISSUES,
            part.runs(measure.quiet_run, DEFAULTS_TISSUES),
        )
        changed = part.runs(measure.change_run, DEFAULTS_CHANGES)
        weak = part.runs(measure.weak_run, DEFAULTS_WEAK)
        misfit = part.runs(measure.quiet_run, DEFAULTS_MISFIT)
        row: Row = {
            "variation": name,
            "ratio": worst(worst(r["ratio"]) for r in quiet),
            "nees_low": worst((r["nees"] for r in quiet), False),
            "nees_high": worst(r["nees"] for r in quiet),
            "nis_low": worst((r["nis"] for r in quiet), False),
            "nis_high": worst(r["nis"] for r in quiet),
            "false_alarms": float(sum(r["changes"] for r in quiet)),
            "settling_s": worst(float(np.median(c["settling_s"])) for c in changed),
            "misfit_calls": float(np.mean([np.mean(m["changes"]) for m in misfit])),
            "weak_nees": worst(float(np.mean(w["nees"])) for w in weak),
        }
        if folder is not None:
            sines = [
                RecordingTask(varied, recording, str(folder), causal=False)
                for recording in RECORDINGS
                if recording.palpation and recording.model_fits
            ]
            recorded = part.spread(recording_run, sines)
            row["recordings"] = worst(r["ratio"] for r in recorded[:-1])
            row["press"] = float(recorded[-1]["ratio"])
            row["recorded_changes"] = float(sum(r["changes"] for r in recorded))
        rows.append(row)
        bench.report(index + 1, len(VARIATIONS))
    return {"rows": rows, "targets": [], "seeds": few}


def filters(bench: Bench) -> Result:
    """All filters on all simulated tissues."""
    few = max(2, bench.seeds // 5)
    rows: list[Row] = []
    names = available_filters()
    for index, name in enumerate(names):
        groups = bench.part(Setup(name), few).runs(measure.plain_run, catalogue.TISSUES)
        errors = np.array([[np.median(runs[f"relative_{i}"]) for i in range(4)] for runs in groups])
        forces = np.array([np.median(runs["force_rms"]) for runs in groups])
        if index == 0:
            first_forces = forces
        hardest = int(np.argmax(np.max(errors, axis=1)))
        lost = np.mean(
            [
                ~(np.max([runs[f"relative_{i}"] for i in range(4)], axis=0) <= measure.TOLERANCE)
                for runs in groups
            ]
        )
        rows.append(
            {
                "filter": name,
                "median_error": np.median(errors, axis=0).tolist(),
                "worst_error": float(np.max(errors[hardest])),
                "worst": catalogue.TISSUES[hardest].name,
                "lost": float(lost),
                "force": float(np.exp(np.mean(np.log(forces / first_forces)))),
                "nees": float(np.median([np.median(runs["nees"]) for runs in groups])),
                "nis": float(np.median([np.median(runs["nis"]) for runs in groups])),
            }
        )
        bench.report(index + 1, len(names))
    return {"rows": rows, "targets": [], "seeds": few}
