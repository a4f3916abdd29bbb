"""Predictions stay possible: nothing is foretold that no sensor could read.

Two questions. On contacts of all the other experiments: does any prediction go beyond three times
the largest force felt so far, while depth and speed are within what was felt? One step ahead, and
half a second ahead with the parameters held. And on readings like those of a surgical arm at 66 Hz
(noisy position, guessed zero, a surface that moves, pairs of outliers): is the force one step ahead
ever worse, in any recording or in any second, than twice the error of simply holding the last
reading?
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import medfilt

from hc_estimator.contact.arrays import hunt_crossley_force
from hc_evaluation.accuracy.bench import Bench, Result, Row, target
from hc_evaluation.accuracy.contacts import CONTACTS
from hc_evaluation.accuracy.measure import Numbers, Setup
from hc_evaluation.accuracy.scenarios import log_uniform
from hc_evaluation.hold_forward import Frozen, smooth_motion

FloatArray = NDArray[np.float64]
Readings = tuple[FloatArray, FloatArray, FloatArray]

LARGEST_FACTOR = 3.0
CONTACT_S = 0.5  # of contact before a prediction counts
AHEAD_S, STRIDE_S = 0.5, 0.1
NOISES = 10.0  # deviations of the force noise below which a force counts as none
JUMP = 12.0  # deviations of the displacement's noise by which an outlier jumps, at least
LARGEST_RATIO = 2.0  # to the last reading held
WINDOW_S = 1.0

ARM_RATE_HZ = 66.0
ARM_DURATION_S = 40.0


def arm_readings(seed: int) -> Readings:
    """Time [s], displacement [mm] and force [N] as a surgical arm reads them, shape (N,).

    The operator palpates slowly; the tissue breathes and drifts; the zero of the displacement is
    guessed and up to some millimetres off; the position is noisy and quantised; three pairs of
    outliers, of displacement or force.

    Args:
        seed: of everything.
    """
    draw = np.random.default_rng([seed, 66])
    time = np.arange(round(ARM_DURATION_S * ARM_RATE_HZ)) / ARM_RATE_HZ
    depth = np.full_like(time, float(draw.uniform(1.0, 3.0)))
    for low, high, largest in ((0.1, 0.3, 1.5), (0.3, 0.8, 2.0), (0.8, 1.6, 0.8)):
        angle = 2.0 * np.pi * draw.uniform(low, high) * time + draw.uniform(0.0, 2.0 * np.pi)
        depth += float(draw.uniform(0.3, 1.0)) * largest * np.sin(angle)
    surface = float(draw.uniform(0.3, 1.5)) * np.sin(2.0 * np.pi * draw.uniform(0.15, 0.3) * time)
    surface += float(draw.uniform(-0.1, 0.1)) * time
    stiffness = log_uniform(draw, 0.1, 0.6)
    tissue = np.array(
        [stiffness, stiffness * draw.uniform(0.005, 0.05), draw.uniform(1.0, 1.7), 1.0]
    )
    force = hunt_crossley_force(depth, np.gradient(depth, time), tissue)
    reading = depth + surface + float(draw.uniform(-4.0, 8.0))
    reading += float(draw.uniform(0.05, 0.15)) * draw.standard_normal(time.size)
    reading = 0.02 * np.round(reading / 0.02)
    force_reading = force + float(draw.uniform(0.01, 0.04)) * draw.standard_normal(time.size)
    for start in draw.integers(100, time.size - 10, 3):
        if draw.random() < 0.5:
            reading[start : start + 2] += float(draw.choice([-1.0, 1.0])) * draw.uniform(20, 100)
        else:
            force_reading[start : start + 2] += float(draw.choice([-1.0, 1.0])) * draw.uniform(
                5, 20
            )
    return time, reading, force_reading


def _outliers(displacement: FloatArray) -> NDArray[np.bool_]:
    """True where one or two readings jump away and back: no depth or speed that was felt."""
    readings = np.where(np.isfinite(displacement), displacement, 0.0)
    away = np.abs(readings - medfilt(readings, 5))
    noise = float(np.median(np.abs(np.diff(readings, 2)))) / 0.6745 / np.sqrt(6.0)
    smallest_jump = 0.01 * float(np.ptp(readings))
    return np.asarray(away > np.maximum(JUMP * noise, smallest_jump))


def force_factors(readings: Readings, series: Any) -> tuple[float, float]:
    """Largest predicted over largest felt force: one step ahead, and held half a second ahead.

    Only where depth and speed are within what was felt before, after half a second of contact.

    Args:
        readings: time, displacement, force.
        series: what the estimator made of them.
    """
    time, displacement, force = readings
    usable = np.isfinite(displacement) & np.isfinite(force)
    usable &= ~_outliers(displacement)
    displacement = np.interp(time, time[usable], displacement[usable])
    step = float(np.median(np.diff(time)))
    noise = float(np.nanmedian(np.abs(np.diff(force[usable], 2)))) / 0.6745 / np.sqrt(6.0)
    touching = usable & (displacement > 0.0)
    enough = np.cumsum(touching) * step > CONTACT_S
    # A pair of outliers is nothing that was felt: the median of five leaves it out.
    touch_force = medfilt(np.where(touching, np.abs(force), 0.0), 5)
    touch_depth = medfilt(np.where(touching, displacement, 0.0), 5)
    largest = np.maximum(np.maximum.accumulate(touch_force), NOISES * noise)
    deepest = np.maximum.accumulate(touch_depth)
    inside = np.zeros(time.size, np.bool_)
    inside[1:] = enough[:-1] & usable[1:] & (displacement[1:] <= deepest[:-1])
    predicted = np.abs(series.force_predicted)
    judged = inside & ~np.isnan(predicted)  # an infinite force is foretold, and is impossible
    one_step = float(np.max(predicted[judged] / np.maximum(largest[judged], 1e-9), initial=0.0))
    # Differences of noisy readings are no speed that was felt.
    _, velocity = smooth_motion(displacement, 1.0 / step)
    touch_speed = medfilt(np.where(touching & enough, np.abs(velocity), 0.0), 5)
    fastest = np.maximum.accumulate(touch_speed)
    frozen = Frozen.of(series)
    ahead, stride = round(AHEAD_S / step), max(1, round(STRIDE_S / step))
    held = 0.0
    for origin in range(0, time.size - ahead, stride):
        if not enough[origin]:
            continue
        parameters, _, contact, zero = frozen.at(origin)
        span = slice(origin + 1, origin + 1 + ahead)
        known = usable[span] & (displacement[span] <= deepest[origin])
        known &= np.abs(velocity[span]) <= fastest[origin]
        if not np.any(known):
            continue
        depth = displacement[span][known] - contact
        foretold = hunt_crossley_force(depth, velocity[span][known], parameters) + zero
        worst = float(np.max(np.abs(foretold)))
        held = max(held, (worst if np.isfinite(worst) else np.inf) / largest[origin])
    return one_step, held


def ratios_to_held(readings: Readings, series: Any) -> tuple[float, float]:
    """Ratio of the one-step error to that of the last reading held: all in all, and worst second.

    RMS of both. The first second is the start, and not judged. NaN where no force is foretold.
    """
    time, _, force = readings
    predicted = np.abs(force - series.force_predicted)[1:]
    held = np.abs(np.diff(force))
    window = np.floor((time[1:] - time[0]) / WINDOW_S).astype(int)
    judged = (window > 0) & ~np.isnan(predicted) & np.isfinite(held)
    if not np.any(judged):
        return float("nan"), float("nan")

    def ratio(inside: NDArray[np.bool_]) -> float:
        return float(np.sqrt(np.mean(predicted[inside] ** 2) / np.mean(held[inside] ** 2)))

    seconds = [judged & (window == index) for index in range(1, int(window[-1]) + 1)]
    worst = max((ratio(one) for one in seconds if np.count_nonzero(one) >= 10), default=np.nan)
    return ratio(judged), worst


@dataclass(frozen=True)
class PossibleTask:
    """One run: estimator, kind of contact ("arm" or one of CONTACTS), which of them, and seed."""

    setup: Setup
    kind: str
    index: int
    seed: int


def possible_run(task: PossibleTask) -> Numbers:
    """The largest prediction over the largest force felt, and against the last reading held."""
    make: Callable[[int, int], Readings] = (
        (lambda _index, seed: arm_readings(seed)) if task.kind == "arm" else CONTACTS[task.kind][1]
    )
    readings = make(task.index, task.seed)
    series = task.setup.create().run(*readings)
    one_step, held = force_factors(readings, series)
    numbers = {"one_step": one_step, "held": held, "whole": float("nan"), "ratio": float("nan")}
    if task.kind == "arm":
        numbers["whole"], numbers["ratio"] = ratios_to_held(readings, series)
    return numbers


def possible(bench: Bench) -> Result:
    """Predictions that stay possible."""
    rows: list[Row] = []
    targets: list[Row] = []
    label = "over the largest force felt"
    few = max(1, bench.seeds // 10)
    kinds = {"arm": (1, bench.seeds)} | {k: (count, few) for k, (count, _) in CONTACTS.items()}
    for kind, (count, seeds) in kinds.items():
        tasks = [
            PossibleTask(bench.setup, kind, index, bench.first_seed + seed)
            for index in range(count)
            for seed in range(seeds)
        ]
        runs = bench.spread(possible_run, tasks)
        columns = {key: np.array([run[key] for run in runs]) for key in runs[0]}
        row: Row = {
            "contacts": kind,
            "runs": len(runs),
            "one_step": float(np.max(columns["one_step"])),
            "held": float(np.max(columns["held"])),
        }
        if kind == "arm":
            row["ratio_median"] = float(np.median(columns["ratio"]))
            row["ratio"] = float(np.max(columns["ratio"]))
            row["whole"] = float(np.max(columns["whole"]))
            row["whole_median"] = float(np.median(columns["whole"]))
            for key, name in (("whole", "worst recording"), ("ratio", "worst second")):
                targets.append(
                    target(f"arm: {name} over the last reading held", row[key], high=LARGEST_RATIO)
                )
        rows.append(row)
        for key, name in (("one_step", "one step ahead"), ("held", "held 0.5 s")):
            targets.append(target(f"{kind}: {label}, {name}", row[key], high=LARGEST_FACTOR))
    return {"rows": rows, "targets": targets}
