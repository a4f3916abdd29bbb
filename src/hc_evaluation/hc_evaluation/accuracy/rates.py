"""Channels at rates of their own, fed reading by reading.

A robot's pose comes at 125 Hz, its wrench at 500 Hz or 4 kHz, each with its own stamps. Nothing is
interpolated: every sample has one reading, the other is missing (NaN). The bound takes the same
readings. Every seed draws another contact and another offset between the stamps.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hc_evaluation import metrics
from hc_evaluation.accuracy import catalogue
from hc_evaluation.accuracy.bench import Bench, Result, Row, target, worst
from hc_evaluation.accuracy.measure import Numbers, Setup, bound_of, known_mean, sampled
from hc_evaluation.accuracy.scenarios import Scenario, SimulatedContact, simulate

FloatArray = NDArray[np.float64]

DECLARED = {"missing_readings": True}  # what tells an estimator that NaN is a missing reading
DURATION_S = 10.0
SETTLED_S = 2.0
POSE_NOISE_MM = 0.005


@dataclass(frozen=True)
class Rates:
    """Rates of pose and wrench [Hz]."""

    pose: float
    wrench: float

    @property
    def name(self) -> str:
        """For tables."""
        return f"pose {self.pose:g} Hz, wrench {self.wrench:g} Hz"


RATES = (Rates(125.0, 500.0), Rates(125.0, 4000.0), Rates(1000.0, 100.0))


@dataclass(frozen=True)
class RatesTask:
    """One run: estimator, rates and the seed of everything else."""

    setup: Setup
    rates: Rates
    seed: int


def readings(rates: Rates, seed: int) -> SimulatedContact:
    """A random contact read by two clocks; NaN where a channel has no reading, shape (N,)."""
    draw = np.random.default_rng([seed, 125])
    steps = 1.0 / rates.pose, 1.0 / rates.wrench
    offset = float(draw.uniform(0.1, 0.9)) * min(steps)
    scenario = replace(
        catalogue.random_scenario(seed), displacement_noise_mm=POSE_NOISE_MM, name=rates.name
    )
    pose = offset + np.arange(0.0, DURATION_S, steps[0])
    return read_apart(scenario, seed, pose, np.arange(0.0, DURATION_S, steps[1]))


def read_apart(
    scenario: Scenario, seed: int, pose_s: FloatArray, wrench_s: FloatArray
) -> SimulatedContact:
    """A contact whose channels are read at times of their own.

    Args:
        scenario: the contact.
        seed: of the noise.
        pose_s: stamps of the displacements [s], shape (P,).
        wrench_s: stamps of the forces [s], shape (W,).

    Returns:
        Readings in the order of their stamps; NaN where a channel has none, shape (P + W,).
    """
    time = np.concatenate([pose_s, wrench_s])
    order = np.argsort(time)
    is_pose = (np.arange(time.size) < pose_s.size)[order]
    contact = simulate(scenario, seed, time[order])
    return replace(
        contact,
        displacement_mm=np.where(is_pose, contact.displacement_mm, np.nan),
        force_n=np.where(is_pose, np.nan, contact.force_n),
        displacement_noise_std=np.where(is_pose, contact.displacement_noise_std, np.inf),
        force_noise_std=np.where(is_pose, np.inf, contact.force_noise_std),
    )


def rates_run(task: RatesTask) -> Numbers:
    """Errors over the bound that has the same readings, consistency, flags."""
    contact = readings(task.rates, task.seed)
    time = contact.time_s
    series = task.setup.create().run(time, contact.displacement_mm, contact.force_n)
    chosen = sampled(time.size / DURATION_S, time, SETTLED_S)
    error = metrics.log_parameter_error(series.parameters[-1], contact.parameters[-1])
    deviations = np.sqrt(np.diagonal(bound_of(contact)[-1]))
    late = (time > 1.0) & np.isfinite(contact.force_n)
    return {f"ratio_{i}": float(abs(error[i]) / deviations[i]) for i in range(4)} | {
        "nees": float(
            np.mean(
                metrics.nees(
                    series.parameters[chosen],
                    series.covariance[chosen],
                    contact.parameters[chosen],
                )
            )
        ),
        "nis": known_mean(series.nis[late]),
        "changes": float(np.count_nonzero(series.change_detected)),
        "mismatch": float(np.mean(series.model_mismatch[time > SETTLED_S])),
    }


def _row(name: str, runs: Sequence[Numbers]) -> Row:
    columns = {key: np.array([run[key] for run in runs]) for key in runs[0]}
    return {
        "rates": name,
        "ratio": [float(np.sqrt(np.mean(columns[f"ratio_{i}"] ** 2))) for i in range(4)],
        "nees": float(np.mean(columns["nees"])),
        "nees_median": float(np.median(columns["nees"])),
        "nis": float(np.mean(columns["nis"])),
        "changes": float(np.sum(columns["changes"])),
        "mismatch": float(np.mean(columns["mismatch"])),
    }


def declared(bench: Bench) -> tuple[Setup, Result | None]:
    """The estimator with single readings declared; and what to say if it takes none."""
    setup = bench.setup if bench.setup.candidate else bench.setup.with_parameters(DECLARED)
    try:
        setup.create()
    except ValueError as error:
        return setup, {"rows": [], "targets": [], "skipped": f"needs missing readings: {error}"}
    return setup, None


def rates(bench: Bench) -> Result:
    """Channels at rates of their own."""
    setup, skipped = declared(bench)
    if skipped is not None:
        return skipped
    tasks = [
        RatesTask(setup, pair, bench.first_seed + seed)
        for pair in RATES
        for seed in range(bench.seeds)
    ]
    rows = [
        _row(pair.name, runs)
        for pair, runs in zip(RATES, bench.by_seed(rates_run, tasks), strict=True)
    ]
    targets = [
        target("largest share with a misfit told", worst(r["mismatch"] for r in rows), high=0.02),
        target(
            "largest RMS error over its bound", worst(worst(r["ratio"]) for r in rows), high=1.5
        ),
        target("smallest mean NEES", worst((r["nees"] for r in rows), False), low=2.5),
        target("largest mean NEES", worst(r["nees"] for r in rows), high=6.0),
        target("changes called", float(sum(r["changes"] for r in rows)), high=0.0),
    ]
    return {"rows": rows, "targets": targets}
