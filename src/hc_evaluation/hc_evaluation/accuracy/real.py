"""The experiments with real recordings: hold-forward prediction and faults between the channels."""

from __future__ import annotations

from typing import Any

from hc_evaluation.accuracy import catalogue
from hc_evaluation.accuracy.bench import Bench, Result, target
from hc_evaluation.accuracy.recorded import RecordingTask, channel_run, recording_run
from hc_evaluation.accuracy.recordings import RECORDINGS, data_folder


def recordings(bench: Bench) -> Result:
    """Real recordings against least squares."""
    folder = data_folder()
    if folder is None:
        return {"rows": [], "targets": [], "skipped": "the folder with the recordings is absent"}
    tasks = [RecordingTask(bench.setup, recording, str(folder)) for recording in RECORDINGS]
    rows = bench.spread(recording_run, tasks)
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


def channels(bench: Bench) -> Result:
    """Time shift, force zero and contact position, simulated and recorded."""
    folder = data_folder()
    tasks: list[Any] = [(bench.setup, scenario, None) for scenario in catalogue.CHANNEL_FAULTS]
    if folder is not None:
        tasks += [(bench.setup, r, str(folder)) for r in RECORDINGS if r.palpation]
    rows = bench.spread(channel_run, tasks)
    targets = []
    for row in rows:
        for key in ("delay_s", "zero_n", "contact_mm"):
            if f"{key}_true" in row:
                off = abs(row[key] - row[f"{key}_true"]) / row[f"{key}_std"]
                targets.append(target(f"{row['name']}: {key} off, in its deviations", off, high=4))
    return {"rows": rows, "targets": targets}
