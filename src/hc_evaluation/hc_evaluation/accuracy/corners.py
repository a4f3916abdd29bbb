"""Motions with corners: ramps, holds and ways back, as a stage or a robot drives them.

Drawn at random: a tissue that the contact law describes (and that the tool does not leave: B is
limited by the fastest way back), and three presses, each with its own depth
and speed about that of the row, a hold at the bottom and the way back. The corners are sharp (the
velocity jumps between two samples) or round (it changes over some 60 ms).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid
from scipy.ndimage import gaussian_filter1d

from hc_estimator.contact.arrays import hunt_crossley_force
from hc_evaluation import metrics
from hc_evaluation.accuracy.bench import Bench, Result, Row, target, worst
from hc_evaluation.accuracy.measure import Numbers, Setup
from hc_evaluation.accuracy.scenarios import Tissue, without_tension

FloatArray = NDArray[np.float64]

RATE_HZ = 1000.0
HOLD_S = 1.0
START_MM = 0.3
ROUND_S = 0.02  # standard deviation of what rounds a corner
DISPLACEMENT_NOISE_MM = 0.003
FORCE_NOISE_N = 0.01
DEPTHS_MM = {0.1: 1.0, 0.5: 3.0, 2.0: 6.0, 10.0: 10.0}  # largest, by speed in mm/s
CORNERS = ("sharp", "round")
PARAMETERS = ("K", "B", "n", "p")


@dataclass(frozen=True)
class CornerTask:
    """One run: estimator, speed [mm/s], kind of corner and the seed of everything else."""

    setup: Setup
    speed: float
    corner: str
    seed: int


def cornered_contact(
    speed: float, corner: str, seed: int
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Simulate one contact.

    Args:
        speed: about which the presses' speeds are drawn [mm/s].
        corner: one of CORNERS.
        seed: of tissue, presses and noise.

    Returns:
        Time [s], displacement [mm] and force [N], each of shape (N,); true K, B, n, p, shape (4,).
    """
    draw = np.random.default_rng([seed, list(DEPTHS_MM).index(speed), CORNERS.index(corner)])
    stiffness = 10.0 ** draw.uniform(-0.7, 0.7)
    damping = stiffness * 10.0 ** draw.uniform(-1.7, -0.5)
    drawn = Tissue(stiffness, damping, draw.uniform(1.1, 2.2), draw.uniform(0.85, 1.15))
    legs = [np.zeros(round(0.2 * RATE_HZ))]
    for _ in range(3):
        way = DEPTHS_MM[speed] * draw.uniform(0.5, 1.0)
        pace = speed * draw.uniform(0.5, 2.0)
        count = round(way / pace * RATE_HZ)
        legs += [np.full(count, pace), np.zeros(round(HOLD_S * RATE_HZ)), np.full(count, -pace)]
    velocity = np.concatenate(legs)
    tissue = without_tension(drawn, float(-np.min(velocity))).as_array()
    if corner == "round":
        velocity = gaussian_filter1d(velocity, ROUND_S * RATE_HZ, mode="nearest")
    way_mm: FloatArray = cumulative_trapezoid(velocity, dx=1.0 / RATE_HZ, initial=0)
    displacement = START_MM + way_mm
    force = hunt_crossley_force(displacement, velocity, tissue)
    return (
        np.arange(displacement.size) / RATE_HZ,
        displacement + DISPLACEMENT_NOISE_MM * draw.standard_normal(displacement.size),
        force + FORCE_NOISE_N * draw.standard_normal(displacement.size),
        tissue,
    )


def corner_run(task: CornerTask) -> Numbers:
    """Errors, consistency and flags of one run."""
    time, displacement, force, tissue = cornered_contact(task.speed, task.corner, task.seed)
    series = task.setup.create().run(time, displacement, force)
    last = series.parameters[-1]
    errors = metrics.relative_parameter_error(last, tissue)
    numbers = {f"error_{name}": float(e) for name, e in zip(PARAMETERS, errors, strict=True)}
    return numbers | {
        "nees": float(metrics.nees(last, series.covariance[-1], tissue)),
        "changes": float(np.count_nonzero(series.change_detected)),
        "mismatch": float(np.mean(series.model_mismatch)),
    }


def corners(bench: Bench) -> Result:
    """Motions whose velocity jumps."""
    kinds = [(speed, corner) for speed in DEPTHS_MM for corner in CORNERS]
    tasks = [
        CornerTask(bench.setup, speed, corner, bench.first_seed + seed)
        for speed, corner in kinds
        for seed in range(bench.seeds)
    ]
    rows: list[Row] = []
    for (speed, corner), chosen in zip(kinds, bench.by_seed(corner_run, tasks), strict=True):
        columns = {key: np.array([run[key] for run in chosen]) for key in chosen[0]}
        row: Row = {
            "motion": f"{speed:g} mm/s, {corner}",
            "error": [float(np.median(columns[f"error_{name}"])) for name in PARAMETERS],
            "nees": float(np.median(columns["nees"])),
            "nees_90": float(np.quantile(columns["nees"], 0.9)),
            "changes": float(np.sum(columns["changes"])),
            "mismatch": float(np.mean(columns["mismatch"])),
        }
        rows.append(row)
    targets = [
        target("smallest median NEES", worst((r["nees"] for r in rows), False), low=1.5),
        target("largest median NEES", worst(r["nees"] for r in rows), high=6.0),
        target("largest NEES of 9 of 10 runs", worst(r["nees_90"] for r in rows), high=15.0),
        target("largest share with a mismatch told", worst(r["mismatch"] for r in rows), high=0.05),
        target("changes called", float(sum(r["changes"] for r in rows)), high=0.0),
    ]
    return {"rows": rows, "targets": targets}
