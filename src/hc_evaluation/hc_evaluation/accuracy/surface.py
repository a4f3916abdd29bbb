"""A surface that moves under the tool: an organ that breathes, a tool that is carried along.

The contact position drifts under a constant law; depth and surface can be told apart only while the
depth swings. Every seed draws tissue, palpation and phase. Where the depth does not swing the
estimate must say that it does not know the surface: no matter what it says, its stated deviation
has to cover the error.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from hc_evaluation import metrics
from hc_evaluation.accuracy.bench import Bench, Result, Row, target
from hc_evaluation.accuracy.measure import Numbers, Task, run_task, sampled
from hc_evaluation.accuracy.scenarios import (
    Motion,
    Scenario,
    Tissue,
    log_uniform,
    simulate,
    without_tension,
)
from hc_evaluation.accuracy.varying_tissue import Surface

DURATION_S = 20.0
START_S = 8.0  # two breaths
BREATHING_MM, BREATHING_HZ = 1.0, 0.25
DRIFT_MM_S = 0.05
STIFFNESS_TOLERANCE = 0.05
POSITION_TOLERANCE_MM = 0.05
UNKNOWN_MM = 0.3  # stated deviation from which a surface counts as unknown


def _palpation(seed: int) -> Scenario:
    """Tissue, two sines, rate and noise of a seed; the surface does not move yet.

    The depth swings by 1.2 to 4 mm, quicker than an organ breathes, and the sensors are good ones:
    with more noise or slower motion the Cramer-Rao bound (contact position and its rate as states)
    does not allow K within 5 %.
    """
    draw = np.random.default_rng([seed, 25])
    swing = float(draw.uniform(1.2, 4.0))
    sines = (
        (0.35 * swing, float(draw.uniform(1.0, 1.8)), float(draw.uniform(0.0, 6.28))),
        (0.15 * swing, float(draw.uniform(2.7, 4.5)), float(draw.uniform(0.0, 6.28))),
    )
    stiffness = log_uniform(draw, 0.1, 3.0)
    damping = stiffness * log_uniform(draw, 0.01, 0.1)
    tissue = Tissue(
        stiffness, damping, float(draw.uniform(1.3, 2.0)), float(draw.uniform(0.9, 1.1))
    )
    # Deep enough that a breath out does not end the contact.
    motion = Motion(0.5 * swing + 2.0 * BREATHING_MM + float(draw.uniform(0.2, 1.0)), sines)
    fastest = 2.0 * np.pi * (sum(a * f for a, f, _ in sines) + BREATHING_MM * BREATHING_HZ)
    scenario = Scenario(
        "",
        without_tension(tissue, fastest),
        motion,
        float(draw.choice([200.0, 500.0, 1000.0])),
        float(draw.uniform(0.001, 0.003)),
        0.0,
        duration_s=DURATION_S,
    )
    largest = float(np.max(simulate(scenario, 0).force))
    noise = log_uniform(draw, 0.0003, 0.001)
    return replace(scenario, force_noise_n=noise * largest)


def breathing(seed: int) -> Scenario:
    """Palpation of an organ that breathes: 1 mm, 0.25 Hz."""
    phase = float(np.random.default_rng([seed, 26]).uniform(0.0, 2.0 * np.pi))
    return replace(
        _palpation(seed), name="breathing", surface=Surface(BREATHING_MM, BREATHING_HZ, phase)
    )


def drift(seed: int) -> Scenario:
    """Palpation while the surface sinks or rises by 0.05 mm/s."""
    sign = float(np.random.default_rng([seed, 27]).choice([-1.0, 1.0]))
    return replace(_palpation(seed), name="drift", surface=Surface(drift_mm_s=sign * DRIFT_MM_S))


def still(seed: int) -> Scenario:
    """The same palpation on a surface that does not move."""
    return replace(_palpation(seed), name="still")


def held(seed: int) -> Scenario:
    """The tool rests while the organ breathes: depth and surface are one and the same."""
    scenario = breathing(seed)
    motion = Motion(scenario.motion.offset_mm)
    return replace(scenario, name="held, breathing", motion=motion)


KINDS: tuple[Callable[[int], Scenario], ...] = (breathing, drift, still, held)


def surface_run(task: Task) -> Numbers:
    """Error of K and of the contact position, and what is said about the latter."""
    contact, series = run_task(task)
    chosen = sampled(task.scenario.rate_hz, contact.time_s, START_S)
    true = contact.parameters[chosen]
    relative = metrics.relative_parameter_error(series.parameters[chosen], true)
    position = series.contact_position[chosen] - contact.contact_position[chosen]
    deviation = series.contact_position_std[chosen]
    # Not estimated (NaN) says nothing about a surface that moves.
    covered = np.abs(position) <= 3.0 * deviation
    late = contact.time_s >= START_S
    return {
        "K": float(np.median(relative[:, 0])),
        "K_90": float(np.quantile(relative[:, 0], 0.9)),
        "position": float(np.sqrt(np.mean(position**2))),
        "deviation": float(np.median(deviation)),
        "covered": float(np.mean(covered)),
        "unknown": float(np.mean(deviation >= UNKNOWN_MM)),
        "changes": float(np.count_nonzero(series.change_detected)),
        "mismatch": float(np.mean(series.model_mismatch[late])),
    }


def _row(name: str, runs: Sequence[Numbers]) -> Row:
    columns = {key: np.array([run[key] for run in runs]) for key in runs[0]}
    row: Row = {"surface": name}
    for key in ("K", "K_90", "deviation", "covered", "unknown", "mismatch"):
        row[key] = float(np.median(columns[key]))
    row["position"] = float(np.median(columns["position"]))
    row["position_90"] = float(np.quantile(columns["position"], 0.9))
    row["changes"] = float(np.sum(columns["changes"]))
    return row


def surface(bench: Bench) -> Result:
    """A surface that moves."""
    tasks = [
        Task(bench.setup, make(bench.first_seed + seed), bench.first_seed + seed)
        for make in KINDS
        for seed in range(bench.seeds)
    ]
    rows = [
        _row(make(bench.first_seed).name, runs)
        for make, runs in zip(KINDS, bench.by_seed(surface_run, tasks), strict=True)
    ]
    targets: list[Row] = []
    for row in rows[:3]:
        name = row["surface"]
        targets += [
            target(f"{name}: K off at 90 % of the samples", row["K_90"], high=STIFFNESS_TOLERANCE),
            target(f"{name}: RMS mm off", row["position"], high=POSITION_TOLERANCE_MM),
        ]
    unknown = rows[-1]
    targets += [
        target("held: share with the surface said to be unknown", unknown["unknown"], low=0.95),
        target("changes called", float(sum(row["changes"] for row in rows)), high=0.0),
    ]
    return {"rows": rows, "targets": targets}
