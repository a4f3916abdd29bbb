"""Recordings through several estimators: errors, honesty and cost of each, side by side."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from hc_bringup.force_error import settled
from hc_bringup.run_data import RunData, of_series, recorded
from hc_estimator import Estimator, create_estimator
from hc_estimator.stream.in_pieces import run_in_pieces
from hc_evaluation.channels import evenly_spaced, unbroken
from hc_evaluation.hold_forward import Frozen, hold_forward_errors, smooth_motion
from hc_evaluation.metrics import nees
from hc_logger.recording import Recording
from hc_msgs_py.units import METRE_IN_MM

Array = NDArray[np.float64]

HORIZON_S: Final = 0.5
LEAST_CONTACT_SHARE: Final = 0.2
MOSTLY: Final = 0.9
"""Share of the samples for which a filter has to state a covariance, so that its NEES is one."""


@dataclass(frozen=True)
class Variant:
    """One way to estimate.

    Attributes:
        label: how it is called in tables and charts.
        filter: name of the filter; empty for the estimates that were recorded.
        settings: state_space, contact_model and settings by name.
    """

    label: str
    filter: str
    settings: Mapping[str, Any]

    def make(self) -> Estimator:
        """Make the estimator.

        Raises:
            ValueError: names what is not allowed.
        """
        return create_estimator(self.filter, **{"missing_readings": True, **self.settings})


@dataclass(frozen=True)
class Scores:
    """What a variant achieved on a recording; NaN where it cannot be told.

    Errors and honesty of all variants of a recording are over the same samples, whatever each of
    them refused or took for free motion (`common_samples`).

    Attributes:
        force_rms_n: error of the force one step ahead, after the first second of contact.
        ahead_rms_n: the same half a second ahead, with the parameters held.
        parameter_errors: median of |estimate / truth - 1| of K, B, n, p, shape (4,).
        nees: mean normalised error squared of the parameters (ideal 4).
        nis: mean normalised innovation squared (ideal 2).
        inside: share of the time in which the true K was within 3 stated deviations.
        mismatch: share of the contact in which the law did not fit.
        changes: changes of the tissue detected.
        refused: share of the samples that were not used.
        microseconds: a step, in a batch; NaN for recorded estimates.
    """

    force_rms_n: float
    ahead_rms_n: float
    parameter_errors: Array
    nees: float
    nis: float
    inside: float
    mismatch: float
    changes: int
    refused: float
    microseconds: float


@dataclass(frozen=True)
class Entry:
    """One recording through one variant."""

    variant: Variant
    data: RunData
    scores: Scores


def compare(
    recordings: Sequence[Recording],
    variants: Sequence[Variant],
    note: Callable[[int, int, str], None] = lambda _done, _all, _what: None,
    prepare: Callable[[Estimator, Mapping[str, Any], Recording], None] = lambda *_: None,
) -> list[list[Entry]]:
    """Run every recording through every variant; one list a recording.

    Args:
        recordings: what was recorded.
        variants: how to estimate; the one without a filter takes what was recorded, where there
            is something.
        note: told how far it is: done, all, what comes next.
        prepare: called with each estimator, the variant's own settings and the recording.

    Raises:
        ValueError: names what is not allowed in a variant.
    """
    table: list[list[Entry]] = []
    number = len(recordings) * len(variants)
    for i, recording in enumerate(recordings):
        row: list[tuple[Variant, RunData, float]] = []
        for j, variant in enumerate(variants):
            note(i * len(variants) + j, number, f"{recording.path.name}, {variant.label}")
            made = _made(recording, variant, prepare)
            if made is not None:
                row.append((variant, *made))
        chosen = common_samples([data for _, data, _ in row])
        table.append(
            [
                Entry(variant, data, scores(data, cost, mine))
                for (variant, data, cost), mine in zip(row, chosen, strict=True)
            ]
        )
    note(number, number, "")
    return table


def common_samples(runs: Sequence[RunData]) -> list[NDArray[np.bool_]]:
    """Return for each run which of its samples count: those that most runs used in contact.

    A variant that refuses what it cannot explain, or takes it for free motion, is not to look
    better for that than one that used it. Runs may hold different samples of one recording; those
    whose times they share are one.

    Args:
        runs: of one recording.

    Returns:
        A mask of each run's samples, shape (samples of that run,).
    """
    if not runs:
        return []
    times = np.unique(np.concatenate([run.time_s for run in runs]))
    there, votes = np.zeros(len(times), int), np.zeros(len(times), int)
    for run in runs:
        at = np.searchsorted(times, run.time_s)
        np.add.at(there, at, 1)
        np.add.at(votes, at[run.contact & run.used], 1)
    counted = settled(times, (there >= len(runs)) & (2 * votes > len(runs)))
    return [counted[np.searchsorted(times, run.time_s)] for run in runs]


def _made(
    recording: Recording,
    variant: Variant,
    prepare: Callable[[Estimator, Mapping[str, Any], Recording], None],
) -> tuple[RunData, float] | None:
    """Return the run of a variant and what a step took [us]."""
    if not variant.filter:
        data = recorded(recording)
        seconds = math.nan
    else:
        estimator = variant.make()
        prepare(estimator, variant.settings, recording)
        estimator.warm_up()
        start = time.thread_time()
        series = run_in_pieces(
            estimator, recording.time_s, recording.displacement_mm, recording.force_n
        )
        seconds = time.thread_time() - start
        data = of_series(recording, estimator, series)
    if data is None:
        return None
    return data, 1e6 * seconds / len(data.time_s)


def scores(data: RunData, microseconds: float, chosen: NDArray[np.bool_]) -> Scores:
    """Judge a run by the samples that were chosen; see Scores."""
    error = (data.force_n - data.force_predicted_n)[chosen]
    parameter_errors, mean_nees, inside = _against_truth(data, chosen)
    touching = data.contact & data.used
    return Scores(
        force_rms_n=_rms(error),
        ahead_rms_n=_ahead(data),
        parameter_errors=parameter_errors,
        nees=mean_nees,
        nis=_mean(data.nis[chosen]),
        inside=inside,
        mismatch=_mean(data.model_mismatch[touching].astype(float)),
        changes=int(np.count_nonzero(data.change_detected)),
        refused=float(np.mean(~data.used)),
        microseconds=microseconds,
    )


def _against_truth(data: RunData, chosen: NDArray[np.bool_]) -> tuple[Array, float, float]:
    if data.truth is None or not chosen.any():
        return np.full(4, np.nan), math.nan, math.nan
    known = chosen & np.isfinite(data.truth).all(axis=1) & (data.truth[:, :2] > 0.0).all(axis=1)
    known &= (data.parameters[:, :2] > 0.0).all(axis=1)
    if not known.any():
        return np.full(4, np.nan), math.nan, math.nan
    values, truth, covariance = data.parameters[known], data.truth[known], data.covariance[known]
    errors = np.median(np.abs(values / truth - 1.0), axis=0)
    held = np.median(data.parameters_std[known], axis=0) == 0.0
    errors[held] = np.nan  # what a filter does not estimate, it is not praised for
    sound = np.isfinite(covariance).all(axis=(1, 2))
    sound &= (np.diagonal(covariance, axis1=1, axis2=2) > 0.0).all(axis=1)
    mean_nees = math.nan
    if np.mean(sound) > MOSTLY:
        # A covariance without a full rank has no such figure.
        with contextlib.suppress(np.linalg.LinAlgError):
            mean_nees = _mean(nees(values[sound], covariance[sound], truth[sound]))
    within = np.abs(values[:, 0] - truth[:, 0]) <= 3.0 * data.parameters_std[known, 0]
    return errors, mean_nees, float(np.mean(within))


def _ahead(data: RunData) -> float:
    """Return the RMS error of the force half a second ahead, for a tool mostly in contact."""
    if np.mean(data.contact) < LEAST_CONTACT_SHARE:
        return math.nan
    try:
        part = unbroken(data.time_s, data.displacement_mm, data.force_n)
        time_s, displacement, force = evenly_spaced(*part)
        step = float(np.median(np.diff(time_s)))
        depth, speed = smooth_motion(displacement, 1.0 / step)
        at = np.clip(np.searchsorted(data.time_s, time_s), 0, len(data.time_s) - 1)
        frozen = Frozen(
            data.parameters[at],
            channel_delay=np.nan_to_num(data.estimates["channel_delay"][at]),
            contact_position=METRE_IN_MM * np.nan_to_num(data.estimates["contact_position"][at]),
            force_zero=np.nan_to_num(data.estimates["force_zero"][at]),
        )
        _, errors = hold_forward_errors(time_s, depth, speed, force, frozen, horizon_s=HORIZON_S)
    except ValueError:
        return math.nan  # too short, or not evenly spaced at all
    return _rms(errors)


def _rms(values: Array) -> float:
    finite = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(finite**2))) if len(finite) else math.nan


def _mean(values: Array) -> float:
    finite = values[np.isfinite(values)]
    return float(np.mean(finite)) if len(finite) else math.nan
