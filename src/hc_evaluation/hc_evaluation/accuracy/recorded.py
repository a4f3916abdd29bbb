"""One estimator, or the channel diagnosis, on one recording: numbers for the tables."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hc_evaluation.accuracy.measure import Setup, known_mean
from hc_evaluation.accuracy.recordings import (
    Recording,
    batch_fit,
    causal_fit,
    contact_start,
    load,
    smoothed,
)
from hc_evaluation.accuracy.scenarios import Scenario, simulate
from hc_evaluation.channels import diagnose_channels
from hc_evaluation.hold_forward import Frozen, hold_forward_errors

FIRST_CONTACT_S = 1.5  # of contact before the first estimate is held forward


@dataclass(frozen=True)
class RecordingTask:
    """One recording, and whether least squares is also tried causally (slow)."""

    setup: Setup
    recording: Recording
    folder: str
    causal: bool = True


def recording_run(task: RecordingTask) -> dict[str, Any]:
    """Hold-forward error against least squares, parameters, calls."""
    recording = task.recording
    time, displacement, force = load(Path(task.folder), recording)
    smooth, velocity = smoothed(time, displacement)
    floor = batch_fit(smooth, velocity, force)
    start = FIRST_CONTACT_S + contact_start(time, force)
    series = task.setup.create().run(time, displacement, force)

    def held(estimate: Frozen | np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        return hold_forward_errors(time, smooth, velocity, force, estimate, start_s=start)[1]

    errors, batch = held(Frozen.of(series)), held(floor.parameters)
    causal = np.full(1, np.nan)
    if task.causal:
        causal = held(causal_fit(time, smooth, velocity, force, start_s=start))
    last = series.parameters[-1]
    fits = recording.model_fits
    # K and n of a fit to channels that are out of step are those of other channels.
    found = Frozen.of(series)
    _, late, position, zero = found.at(time.size - 1)
    smooth = np.interp(time - late, time, smooth) - position
    velocity = np.interp(time - late, time, velocity)
    force = force - zero
    linear = batch_fit(smooth, velocity, force, velocity_exponent=1.0)
    stiffness = last[0]
    if recording.elastic:
        speed = float(np.median(np.abs(velocity)))
        linear = batch_fit(smooth, np.zeros_like(velocity), force, velocity_exponent=1.0)
        stiffness = last[0] + last[1] * speed ** last[3]
    return {
        "recording": recording.name,
        "ratio": _rms(errors) / _rms(batch),
        "ratio_causal": _rms(causal) / _rms(batch),
        "ratio_median": float(np.median(errors) / np.median(batch)),
        "floor_n": _rms(batch),
        "parameters": last.tolist(),
        "deviations": series.parameters_std[-1].tolist(),
        "identifiability": series.identifiability[-1].tolist(),
        "batch": linear.parameters.tolist(),
        "k_off": float(stiffness / linear.parameters[0] - 1.0) if fits else float("nan"),
        "n_off": float(last[2] / linear.parameters[2] - 1.0) if fits else float("nan"),
        "changes": float(np.count_nonzero(series.change_detected)),
        "mismatch": float(np.mean(series.model_mismatch)),
        "force_noise_std": float(series.force_noise_std[-1]),
        "nis": known_mean(series.nis[time > time[0] + 1.0]),
    }


def _rms(values: np.ndarray[Any, Any]) -> float:
    return float(np.sqrt(np.mean(values**2)))


def channel_run(task: tuple[Setup, Scenario | Recording, str | None]) -> dict[str, Any]:
    """Channel diagnosis beside what the filter makes of the same signals."""
    setup, source, folder = task
    row: dict[str, Any] = {"name": source.name}
    if isinstance(source, Scenario):
        contact = simulate(source, 100_000)
        time, displacement, force = contact.time_s, contact.displacement_mm, contact.force_n
        row["delay_s_true"] = source.force_delay_s
        row["zero_n_true"] = source.force_zero_n
        row["contact_mm_true"] = source.contact_position_mm
        row["true"] = source.tissue.as_array().tolist()
    else:
        if folder is None:
            raise ValueError(f"the recording {source.name} needs the folder of the recordings")
        time, displacement, force = load(Path(folder), source)
    found = diagnose_channels(time, displacement, force)
    series = setup.create().run(time, displacement, force)
    return row | {
        "delay_s": found.delay_s,
        "delay_s_std": found.delay_std_s,
        "zero_n": found.zero_n,
        "zero_n_std": found.zero_std_n,
        "contact_mm": found.contact_mm,
        "contact_mm_std": found.contact_std_mm,
        "clear": list(found.clear_faults),
        "residual_rms_n": found.residual_rms_n,
        "residual_rms_without_n": found.residual_rms_without_n,
        "parameters": found.parameters.tolist(),
        "filter_parameters": series.parameters[-1].tolist(),
        "changes": float(np.count_nonzero(series.change_detected)),
        "mismatch": float(np.mean(series.model_mismatch)),
    }
