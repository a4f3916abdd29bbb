"""Runs one column of an experiment over a signal, and keeps what scores and pictures need."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hc_estimator import (
    DEFAULT_FILTER,
    EstimateSeries,
    Estimator,
    Rejection,
    create_estimator,
    parameter_specifications,
)
from hc_estimator.contact.arrays import force_of
from hc_estimator.multiple_model.hypotheses import LOG_DAMPING, LOG_STIFFNESS
from hc_evaluation.reproduction import position_filters
from hc_evaluation.reproduction.experiment import DEFAULT, Column
from hc_evaluation.reproduction.signals import Signal

FloatArray = NDArray[np.float64]

# Q of the papers' state, in its order, as hc_estimator calls it (variance per second there).
PROCESS_NOISE_NAMES = (
    "process_noise_displacement",
    "process_noise_velocity",
    "process_noise_force",
    "process_noise_stiffness",
    "process_noise_damping",
    "displacement_exponent_walk",
    "velocity_exponent_walk",
)
FORCE_STATE = 2

# What takes hc_estimator's guards away; those that a filter lacks are left out.
LITERAL: Mapping[str, Any] = {
    "limit_parameters": False,
    "outlier_limit": 0,
    "tempering_amplitude": 0.0,
    "noise_adaptation": "fixed",
    "change_detection": "none",
}
PAPERS_LAW = "adhesive"  # the papers' law pulls on a fast retreat


@dataclass(frozen=True)
class Trace:
    """What an estimator made of a signal; arrays of shape (N,) unless said, NaN where it has none.

    Attributes:
        force: force after the update, as the estimator reports it [N].
        law_force: the contact law at the estimated motion and parameters [N].
        force_predicted: force expected before the sample [N].
        displacement: estimated penetration [mm].
        velocity: estimated velocity [mm/s].
        parameters: K, B, n, p, shape (N, 4).
        covariance: their covariance, shape (N, 4, 4).
        noise_std: estimated standard deviation of the noise that the experiment adapts [N].
        nis: normalised innovation squared.
        changes: True where a change was called.
        mismatch: True where the estimator said that the contact law does not fit.
        numerical_failures: samples at which the update had no meaning.
        adhesive: whether its contact law may pull.
    """

    force: FloatArray
    law_force: FloatArray
    force_predicted: FloatArray
    displacement: FloatArray
    velocity: FloatArray
    parameters: FloatArray
    covariance: FloatArray
    noise_std: FloatArray
    nis: FloatArray
    changes: NDArray[np.bool_]
    mismatch: NDArray[np.bool_]
    numerical_failures: int
    adhesive: bool = False


def make_estimator(column: Column, time_s: float, time_step: float) -> Estimator:
    """The estimator of a column, started as the column says.

    Args:
        column: a column with a filter of hc_estimator.
        time_s: stamp of the first sample.
        time_step: time between samples [s].
    """
    filter = DEFAULT_FILTER if column.filter == DEFAULT else column.filter
    names = {s.name for s in parameter_specifications(filter, column.state_space)}
    parameters: dict[str, Any] = {}
    if column.adhesive:
        parameters["contact_model"] = PAPERS_LAW
    if column.setting == "paper":
        parameters |= {name: value for name, value in LITERAL.items() if name in names}
    for name, variance in zip(PROCESS_NOISE_NAMES, column.process_noise, strict=False):
        parameters[name] = variance / time_step
    if column.measurement_noise:
        parameters["displacement_noise_std"] = float(np.sqrt(column.measurement_noise[0]))
        parameters["force_noise_std"] = float(np.sqrt(column.measurement_noise[1]))
    parameters |= column.parameters
    estimator = create_estimator(filter, state_space=column.state_space, **parameters)
    if column.start_state:
        # The estimator starts from its first sample; the papers start from a given state before
        # it. A saved state that says so is the public way to that.
        saved = estimator.state()
        memory = saved["memory"]
        memory["state"] = list(column.start_state)
        memory["covariance"] = np.diag(column.start_variance).tolist()
        memory["started"] = 1
        memory["last_time"] = time_s - time_step
        estimator.restore(saved)
    return estimator


def _add_error(estimator: Estimator, error: Mapping[str, float]) -> None:
    """Add an error to the estimated K and B.

    For the papers' state space that is to the letter what paper A, section 5.3, does to the
    predicted state: neither K nor B is measured, so that the error passes the update unchanged. In
    our default every hypothesis gets it.
    """
    saved = estimator.state()
    memory = saved["memory"]
    if estimator.filter == "rls":  # its estimate is ln K, n and B/K
        regression = memory["regression"]
        stiffness = float(np.exp(regression[0]))
        damping = stiffness * regression[2] + error["B"]
        regression[0] = float(np.log(stiffness + error["K"]))
        regression[2] = damping / (stiffness + error["K"])
    elif "rows" in memory:
        for row in memory["rows"]:
            for index, name in ((LOG_STIFFNESS, "K"), (LOG_DAMPING, "B")):
                row["state"][index] = _log_sum(row["state"][index], error[name])
    else:
        state = memory["state"]
        for index, name in ((3, "K"), (4, "B")):
            if estimator.state_space == "kinematic":
                state[index] = _log_sum(state[index], error[name])
            else:
                state[index] += error[name]
    estimator.restore(saved)


def _log_sum(logarithm: float, added: float) -> float:
    return float(np.log(np.exp(logarithm) + added))


def _of_series(series: EstimateSeries, column: Column) -> Trace:
    noise = series.force_noise_std
    if column.parameters.get("adapted_noise") == "process":
        given = column.process_noise[FORCE_STATE]
        noise = np.sqrt(np.maximum(series.process_noise_scale, 0.0) * given)
    law = force_of(
        series.displacement, series.velocity, series.parameters, adhesive=column.adhesive
    )
    return Trace(
        series.force_reconstructed,
        law,
        series.force_predicted,
        series.displacement,
        series.velocity,
        series.parameters,
        series.covariance,
        noise,
        series.nis,
        series.change_detected,
        series.model_mismatch.astype(np.bool_),
        int(np.count_nonzero(series.rejected == Rejection.NUMERICAL)),
        adhesive=column.adhesive,
    )


def _joined(parts: list[Trace]) -> Trace:
    arrays = {
        f.name: np.concatenate([getattr(part, f.name) for part in parts])
        for f in fields(Trace)
        if f.name not in ("numerical_failures", "adhesive")
    }
    return Trace(
        **arrays,
        numerical_failures=sum(part.numerical_failures for part in parts),
        adhesive=parts[0].adhesive,
    )


def run_column(column: Column, signal: Signal, settings: Mapping[str, Any]) -> Trace:
    """Run a column over a signal.

    Args:
        column: the estimator.
        signal: the data.
        settings: the experiment's `signal` section; its `added_error` disturbs the estimate.
    """
    if column.filter in position_filters.FILTERS:
        return _run_position_filter(column, signal)
    estimator = make_estimator(column, float(signal.time_s[0]), signal.time_step)
    readings = (signal.time_s, signal.displacement_mm, signal.force_n)
    error = settings.get("added_error")
    if error is None:
        return _of_series(estimator.run(*readings), column)
    first, last = int(error["first_step"]), int(error["last_step"])
    edges = [0, *range(first, last + 2), signal.time_s.size]
    parts = []
    for begin, end in itertools.pairwise(edges):
        if first <= begin <= last:
            _add_error(estimator, error)
        part = estimator.run(*(reading[begin:end] for reading in readings))
        parts.append(_of_series(part, column))
    return _joined(parts)


def _run_position_filter(column: Column, signal: Signal) -> Trace:
    result = position_filters.run(
        column.filter,
        signal.displacement_mm,
        signal.rig["slave_effort"],
        signal.time_step,
        column.parameters,
    )
    nothing = np.full(signal.time_s.size, np.nan)
    return Trace(
        result[:, 2],
        result[:, 2],
        result[:, 3],
        result[:, 0],
        result[:, 1],
        np.full((nothing.size, 4), np.nan),
        np.full((nothing.size, 4, 4), np.nan),
        nothing,
        nothing,
        np.zeros(nothing.size, np.bool_),
        np.zeros(nothing.size, np.bool_),
        int(np.count_nonzero(~np.isfinite(result[:, 0]))),
    )
