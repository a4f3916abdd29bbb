"""Scans: the tool palpates while it moves sideways, over inclusions and layers, there and back.

Every seed draws another scan: tissue, two sines in depth, way, one to three inclusions, noise. The
kinds differ in what is felt along the way: harder or softer than the tissue around, damping that
follows the stiffness or goes its own way, layers whose exponent changes too. The rig's
`palpation_scan` is one row, and the real recording of that kind another (held forward, over least
squares in windows of two seconds, which knows the future).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hc_evaluation import metrics
from hc_evaluation.accuracy.bench import Bench, Result, Row, target
from hc_evaluation.accuracy.measure import Setup, known_mean, sampled
from hc_evaluation.accuracy.recordings import (
    Recording,
    batch_fit,
    contact_start,
    data_folder,
    load,
    smoothed,
)
from hc_evaluation.accuracy.scenarios import (
    Motion,
    Scenario,
    SimulatedContact,
    Tissue,
    log_uniform,
    simulate,
    without_tension,
)
from hc_evaluation.accuracy.varying_tissue import Inclusion, Way, along_the_way
from hc_evaluation.hold_forward import Frozen, hold_forward_rms
from hc_sim_rig import Rig, load_scenario

FloatArray = NDArray[np.float64]

START_S = 1.5  # from then on the estimate counts
LARGEST_SCORE = 3.0  # stated deviations within which K is to lie
WINDOW_S = 2.0  # of the floor on a recorded scan
LOWEST_EXPONENT, HIGHEST_EXPONENT = 1.2, 2.3  # of layers
QUICK_RATES = (500.0, 1000.0, 2000.0)
RIG_SCAN = "palpation_scan"
RECORDED_SCAN = Recording("recorded_scan", "palpation_scan.csv", 0.0, False)


@dataclass(frozen=True)
class Kind:
    """One row of the table.

    Attributes:
        name: of the row.
        factors: smallest and largest factor on K.
        damping: smallest and largest share of ln K's change that ln B takes part in.
        exponent: largest change of n.
        edges: whether layers begin (the tissue stays different) instead of lumps.
        rates: sampling rates [Hz] to draw from.
        wide: smallest and largest time that the tool takes over one standard deviation [s].
    """

    name: str
    factors: tuple[float, float]
    damping: tuple[float, float] = (1.0, 1.0)
    exponent: float = 0.0
    edges: bool = False
    rates: tuple[float, ...] = QUICK_RATES
    wide: tuple[float, float] = (0.8, 3.0)


KINDS = (
    Kind("harder", (1.5, 4.0)),
    Kind("softer", (0.3, 0.7)),
    Kind("own_damping", (0.3, 4.0), damping=(-0.3, 0.7)),
    Kind("narrow", (0.5, 2.5), wide=(0.4, 0.8)),
    Kind("layers", (0.4, 2.5), exponent=0.25, edges=True),
    Kind("200hz", (0.3, 4.0), rates=(200.0,)),
    Kind("100hz", (0.3, 4.0), rates=(100.0,), wide=(1.5, 3.0)),
)
# Largest error of K along the way: in the median, and at 95 % of the samples.
LIMITS: Mapping[str, tuple[float, float]] = {"200hz": (0.01, 0.03), "100hz": (0.02, 0.06)}
LIMIT = (0.003, 0.015)


def random_scan(kind: Kind, seed: int) -> Scenario:
    """A scan of a kind.

    Args:
        kind: what is felt along the way.
        seed: of the draw.
    """
    draw = np.random.default_rng([seed, 2026, KINDS.index(kind)])

    frequencies = (draw.uniform(0.6, 1.2), draw.uniform(1.9, 3.2))
    amplitudes = (draw.uniform(0.8, 1.6), draw.uniform(0.3, 0.7))
    motion = Motion(
        sum(amplitudes) + float(draw.uniform(0.6, 1.8)),
        tuple(
            (float(a), float(f), float(draw.uniform(0.0, 2.0 * np.pi)))
            for a, f in zip(amplitudes, frequencies, strict=True)
        ),
    )
    there = float(draw.uniform(12.0, 20.0))
    length = float(draw.uniform(25.0, 60.0))
    count = int(draw.integers(1, 4))
    centres = length * (np.arange(count) + draw.uniform(0.3, 0.7, count)) / count
    n = float(draw.uniform(1.3, 2.1))
    inclusions: list[Inclusion] = []
    for centre in centres:
        factor = log_uniform(draw, *kind.factors)
        follows = float(draw.uniform(*kind.damping))
        # The tool is fastest in the middle of the way (minimum jerk): 15/8 of its mean speed.
        width = float(draw.uniform(*kind.wide)) * 1.875 * length / there
        change = float(draw.uniform(-kind.exponent, kind.exponent))
        behind = n + sum(i.exponent_difference for i in inclusions) * kind.edges
        if not LOWEST_EXPONENT <= behind + change <= HIGHEST_EXPONENT:
            change = -change
        inclusions.append(
            Inclusion(
                float(centre),
                min(width, 0.27 * length / count),
                factor,
                factor**follows,
                change,
                kind.edges,
            )
        )
    way = Way(length, there)
    tissue = Tissue(
        log_uniform(draw, 0.05, 3.0), log_uniform(draw, 0.01, 0.2), n, float(draw.uniform(0.9, 1.1))
    )
    # Where damping goes its own way it must not hold the tool either.
    places = np.linspace(0.0, length, 500)
    relative = along_the_way(np.ones((places.size, 4)), places, tuple(inclusions))
    most = max(1.0, float(np.max(relative[:, 1] / relative[:, 0])))
    fastest = float(2.0 * np.pi * sum(a * f for a, f, _ in motion.sines))
    tissue = replace(tissue, damping=tissue.stiffness * tissue.damping * most)
    tissue = without_tension(tissue, fastest)
    tissue = replace(tissue, damping=tissue.damping / most)
    deepest = motion.offset_mm + sum(amplitudes)
    largest = tissue.stiffness * deepest**tissue.displacement_exponent
    return Scenario(
        kind.name,
        tissue,
        motion,
        float(draw.choice(kind.rates)),
        log_uniform(draw, 0.001, 0.005),
        largest * log_uniform(draw, 0.0005, 0.003),
        duration_s=2.0 * there,
        way=way,
        inclusions=tuple(inclusions),
    )


@dataclass(frozen=True)
class ScanTask:
    """One scan: estimator, kind (None: the rig's scenario) and seed."""

    setup: Setup
    kind: Kind | None
    seed: int


def scanned(kind: Kind | None, seed: int) -> tuple[Scenario | None, SimulatedContact]:
    """The readings and the truth of a scan, and its scenario if it is not the rig's."""
    if kind is not None:
        scenario = random_scan(kind, seed)
        return scenario, simulate(scenario, seed)
    series = Rig(load_scenario(RIG_SCAN), seed=seed).run()
    truth = series.truth
    zeros = np.zeros(series.time_s.size)
    return None, SimulatedContact(
        series.time_s,
        series.displacement_mm,
        series.force_n,
        truth.displacement_mm,
        truth.velocity_mm_s,
        np.gradient(truth.velocity_mm_s, series.time_s),
        truth.force_n,
        truth.parameters,
        zeros + 0.002,
        zeros + 0.010,
        zeros,
    )


def scan_run(task: ScanTask) -> dict[str, Any]:
    """Errors of K along the way with their z-scores, about twenty a second; what was told."""
    _, contact = scanned(task.kind, task.seed)
    series = task.setup.create().run(contact.time_s, contact.displacement_mm, contact.force_n)
    rate = 1.0 / float(np.median(np.diff(contact.time_s)))
    chosen = sampled(rate, contact.time_s, START_S)
    estimated, true = series.parameters[chosen], contact.parameters[chosen]
    with np.errstate(all="ignore"):
        error = metrics.log_parameter_error(estimated, true)
        deviation = series.parameters_std[chosen, 0] / estimated[:, 0]
    late = contact.time_s >= START_S
    return {
        "error": np.nan_to_num(np.abs(error), nan=np.inf),
        "score": np.nan_to_num(np.abs(error[:, 0] / deviation), nan=np.inf),
        "changes": float(np.count_nonzero(series.change_detected)),
        "mismatch": float(np.mean(series.model_mismatch[late])),
        "nis": known_mean(series.nis[late]),
    }


def _row(name: str, runs: Sequence[Mapping[str, Any]]) -> Row:
    error = np.concatenate([run["error"] for run in runs])
    score = np.concatenate([run["score"] for run in runs])
    return {
        "scan": name,
        "median": float(np.median(error[:, 0])),
        "at_95": float(np.quantile(error[:, 0], 0.95)),
        "medians": np.median(error, axis=0).tolist(),
        "scores_within": float(np.mean(score <= LARGEST_SCORE)),
        "changes": float(sum(run["changes"] for run in runs)),
        "mismatch": float(np.mean([run["mismatch"] for run in runs])),
        "nis": float(np.mean([run["nis"] for run in runs])),
    }


def windowed_fit(
    time: FloatArray, displacement: FloatArray, velocity: FloatArray, force: FloatArray
) -> FloatArray:
    """K, B, n, p of a least-squares fit to each window of two seconds, shape (N, 4)."""
    parameters = np.full((time.size, 4), np.nan)
    window = np.floor((time - time[0]) / WINDOW_S).astype(int)
    guess = None
    for index in range(int(window[-1]) + 1):
        inside = window == index
        if np.count_nonzero(displacement[inside] > 0.0) >= 50:
            fit = batch_fit(displacement[inside], velocity[inside], force[inside], guess=guess)
            guess = fit.parameters
        if guess is not None:
            parameters[inside] = guess
    return parameters


def recorded_run(task: tuple[Setup, str]) -> Row:
    """The real scan, held forward; the floor is the fit to every two seconds."""
    setup, folder = task
    time, displacement, force = load(Path(folder), RECORDED_SCAN)
    smooth, velocity = smoothed(time, displacement)
    start = START_S + contact_start(time, force)
    series = setup.create().run(time, displacement, force)
    floor = hold_forward_rms(
        time, smooth, velocity, force, windowed_fit(time, smooth, velocity, force), start_s=start
    )
    held = hold_forward_rms(time, smooth, velocity, force, Frozen.of(series), start_s=start)
    return {
        "scan": RECORDED_SCAN.name,
        "ratio": held / floor,
        "floor_n": floor,
        "changes": float(np.count_nonzero(series.change_detected)),
        "mismatch": float(np.mean(series.model_mismatch)),
    }


def scan(bench: Bench) -> Result:
    """Tissue that varies along the way."""
    kinds: list[Kind | None] = [*KINDS, None]
    tasks = [
        ScanTask(bench.setup, kind, bench.first_seed + seed)
        for kind in kinds
        for seed in range(bench.seeds)
    ]
    rows: list[Row] = []
    targets: list[Row] = []
    for kind, runs in zip(kinds, bench.by_seed(scan_run, tasks), strict=True):
        name = RIG_SCAN if kind is None else kind.name
        row = _row(name, runs)
        rows.append(row)
        median, at_95 = LIMITS.get(name, LIMIT)
        targets += [
            target(f"{name}: error of K, median", row["median"], high=median),
            target(f"{name}: error of K, at 95 % of the samples", row["at_95"], high=at_95),
            target(f"{name}: K within 3 of its deviations", row["scores_within"], low=0.95),
            target(f"{name}: misfit told", row["mismatch"], high=0.05),
        ]
    targets.append(target("changes called", float(sum(r["changes"] for r in rows)), high=0.0))
    folder = data_folder()
    if folder is not None:
        row = bench.part(bench.setup, 1).spread(recorded_run, [(bench.setup, str(folder))])[0]
        rows.append(row)
        targets.append(target(f"{row['scan']}: hold-forward over floor", row["ratio"], high=0.7))
    return {"rows": rows, "targets": targets}
