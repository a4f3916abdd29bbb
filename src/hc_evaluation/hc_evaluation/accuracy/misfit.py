"""Contacts that the contact law does not describe: half a second predicted, against least squares.

Drawn at random: a tissue, presses (with or without a hold at the bottom) or sines, a force ahead of
the displacement by up to 25 ms, a contact position that is off, a force that relaxes. And presses
with pauses between them on tissue that relaxes by three processes, and has no other fault. The
floor is a least-squares fit of the contact law over the whole run, as for the real recordings.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from hc_estimator.contact.arrays import hunt_crossley_force
from hc_evaluation.accuracy import catalogue
from hc_evaluation.accuracy.bench import Bench, Result, Row, target
from hc_evaluation.accuracy.measure import Numbers, Setup
from hc_evaluation.accuracy.recorded import FIRST_CONTACT_S
from hc_evaluation.accuracy.recordings import batch_fit, contact_start, smoothed
from hc_evaluation.accuracy.relaxing import Relaxation, draw_relaxation, relaxing_force
from hc_evaluation.accuracy.scenarios import without_tension
from hc_evaluation.hold_forward import Frozen, hold_forward_rms

FloatArray = NDArray[np.float64]

RATE_HZ = 500.0
DURATION_S = 12.0
CORNER_S = 0.015  # over which the presses turn round
HOLD_S = 0.3
DISPLACEMENT_NOISE_MM = 0.003
FORCE_NOISE = 0.003  # of the largest force
PAUSE_S = 2.0  # between presses on a tissue that relaxes, at most
RELAXING = "press_relaxing"
MOTIONS = ("press", "press_hold", "sines", RELAXING)
LARGEST_RATIO = 1.4  # to the floor, in the median; a fit to the whole run knows the future
SETTLED_S = 6.0  # from which on K of a tissue that relaxes is judged
LARGEST_ERROR = 0.25  # of it, against the batch fit, for 90 % of the samples of nine runs in ten


@dataclass(frozen=True)
class MisfitTask:
    """One run: estimator, motion and the seed of everything else."""

    setup: Setup
    motion: str
    seed: int


def misfit_contact(motion: str, seed: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Time [s], displacement [mm] and force [N] of a contact with faults, each of shape (N,)."""
    draw = np.random.default_rng([seed, MOTIONS.index(motion), 77])
    drawn = catalogue.random_scenario(seed).tissue
    time = np.arange(round(DURATION_S * RATE_HZ)) / RATE_HZ
    depth = _motion(motion, time, draw)
    velocity = np.gradient(depth, time)
    # Little damping, as in the phantoms of the recordings.
    drawn = replace(drawn, damping=0.3 * drawn.damping)
    tissue = without_tension(drawn, float(-np.min(velocity))).as_array()
    delay = float(draw.choice([0.0, 0.01, 0.025]))
    position = float(draw.choice([0.0, 0.0, 0.2]))
    relaxing = float(draw.choice([0.0, 0.1, 0.25]))
    relaxation = Relaxation(np.array([relaxing]), np.array([draw.uniform(0.2, 1.0)]))
    if motion == RELAXING:
        delay, position, relaxation = 0.0, 0.0, draw_relaxation(draw)
    force = hunt_crossley_force(depth, velocity, tissue)
    force = relaxing_force(force, 1.0 / RATE_HZ, relaxation)
    displacement = np.interp(time - delay, time, depth) + position
    return (
        time,
        displacement + DISPLACEMENT_NOISE_MM * draw.standard_normal(time.size),
        force + FORCE_NOISE * np.max(force) * draw.standard_normal(time.size),
    )


def _motion(motion: str, time: FloatArray, draw: np.random.Generator) -> FloatArray:
    if motion == "sines":
        slow = float(draw.uniform(1.0, 2.5)) * np.sin(2.0 * np.pi * draw.uniform(0.3, 2.0) * time)
        quick = float(draw.uniform(0.0, 0.5)) * np.sin(2.0 * np.pi * draw.uniform(2.0, 4.0) * time)
        sines: FloatArray = float(draw.uniform(3.0, 4.0)) + slow + quick
        return sines
    deepest = float(draw.uniform(3.0, 8.0))
    instants, depths = [0.0], [-float(draw.uniform(0.5, 3.0))]
    while instants[-1] < DURATION_S:
        for turn in (deepest * draw.uniform(0.8, 1.1), -draw.uniform(0.5, 3.0)):
            instants.append(instants[-1] + abs(turn - depths[-1]) / draw.uniform(3.0, 12.0))
            depths.append(float(turn))
            if motion == RELAXING and turn < 0.0:
                instants.append(instants[-1] + draw.uniform(0.0, PAUSE_S))
                depths.append(float(turn))
            if motion == "press_hold" and turn > 0.0:
                instants.append(instants[-1] + HOLD_S)
                depths.append(float(turn))
    presses: FloatArray = gaussian_filter1d(np.interp(time, instants, depths), CORNER_S * RATE_HZ)
    return presses


def misfit_run(task: MisfitTask) -> Numbers:
    """Hold-forward error over that of the batch fit."""
    time, displacement, force = misfit_contact(task.motion, task.seed)
    smooth, velocity = smoothed(time, displacement)
    batch = batch_fit(smooth, velocity, force)
    start = FIRST_CONTACT_S + contact_start(time, force)

    def held(estimate: Frozen | FloatArray) -> float:
        return hold_forward_rms(time, smooth, velocity, force, estimate, start_s=start)

    floor = held(batch.parameters)
    series = task.setup.create().run(time, displacement, force)
    stiffness = series.parameters[time > SETTLED_S, 0] / batch.parameters[0]
    return {
        "k_90": float(np.quantile(np.abs(np.log(stiffness)), 0.9)),
        "ratio": held(Frozen.of(series)) / floor,
        "k_off": abs(float(series.parameters[-1, 0] / batch.parameters[0]) - 1.0),
        "changes": float(np.count_nonzero(series.change_detected)),
        "misfit": batch.residual_rms / float(np.sqrt(np.mean(force**2))),
        "mismatch": float(np.mean(series.model_mismatch)),
    }


def misfit(bench: Bench) -> Result:
    """Contacts that the contact law does not describe."""
    tasks = [
        MisfitTask(bench.setup, motion, bench.first_seed + seed)
        for motion in MOTIONS
        for seed in range(bench.seeds)
    ]
    rows: list[Row] = []
    for motion, chosen in zip(MOTIONS, bench.by_seed(misfit_run, tasks), strict=True):
        columns = {key: np.array([run[key] for run in chosen]) for key in chosen[0]}
        row: Row = {"motion": motion}
        for key in ("ratio", "k_off", "misfit", "mismatch"):
            row[key] = float(np.median(columns[key]))
        row["ratio_90"] = float(np.quantile(columns["ratio"], 0.9))
        row["k_90"] = float(np.quantile(columns["k_90"], 0.9))
        row["changes"] = float(np.sum(columns["changes"]))
        rows.append(row)
    targets = [
        target(
            f"{row['motion']}: median hold-forward error over the floor",
            row["ratio"],
            high=LARGEST_RATIO,
        )
        for row in rows
    ]
    relaxes = rows[MOTIONS.index(RELAXING)]
    targets.append(
        target(
            f"{RELAXING}: K off the batch fit, at 90 % of the samples, 9 of 10 runs",
            relaxes["k_90"],
            high=LARGEST_ERROR,
        )
    )
    targets.append(target("changes called", float(sum(r["changes"] for r in rows)), high=0.0))
    return {"rows": rows, "targets": targets}
