"""A robot that presses, its pose slower than its wrench: is a delay invented, is one found?

Both channels come at rates of their own, with stamps that jitter and are right. Presses as a person
makes them, in and out of contact, into tissue of which all four parameters are drawn. A delay and p
are next to alike in such a motion: each press shows damping on its way in and on its way out, and
a force that is late looks like more of it. With every pair of rates half of the runs have no delay,
half have one of 5 to 40 ms of either sign.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hc_estimator.contact.arrays import hunt_crossley_force
from hc_evaluation import metrics
from hc_evaluation.accuracy.bench import Bench, Result, Row, target, worst
from hc_evaluation.accuracy.measure import Numbers, Setup, sampled
from hc_evaluation.accuracy.presses import MOVES, Presses
from hc_evaluation.accuracy.rates import Rates, declared, read_apart
from hc_evaluation.accuracy.scenarios import (
    Motion,
    Scenario,
    SimulatedContact,
    Tissue,
    log_uniform,
    penetration,
)

FloatArray = NDArray[np.float64]

RATES = (Rates(125.0, 500.0), Rates(100.0, 1000.0), Rates(250.0, 1000.0), Rates(500.0, 4000.0))
DURATION_S = 20.0
SETTLED_S = 1.5
COUNTED_S = 10.0  # from when on K is counted
JITTER = 0.2  # of a period, to either side
TOLERANCE_S = 0.002
LIKELY = 3.0  # deviations
USUAL = 0.95  # share of the samples that must have K within them
DELAY_MS = (5.0, 40.0)
STROKE_MM = (2.0, 8.0)
SPEED_MM_S = (5.0, 40.0)  # at the fastest of a move
LIFT_MM = (0.5, 1.5)  # above the tissue between two presses
LEAST_DEPTH_MM = 1.0  # into it
REST_S = 1.5  # at most
HALF_WAY = 0.3  # share of the presses of which the tool comes half way back and goes in again
DAMPING_SHARE = (0.05, 1.2)  # of the elastic force, on the fastest way; above 1 the tissue lets go


def pressed(draw: np.random.Generator) -> Presses:
    """Presses of a person: each with a stroke, a speed and rests of its own.

    Args:
        draw: where everything is drawn from.
    """
    kind = str(draw.choice(sorted(MOVES)))
    top = float(np.max(MOVES[kind](np.linspace(0.0, 1.0, 101))[1]))
    start = -float(draw.uniform(*LIFT_MM))
    usual_stroke = float(draw.uniform(*STROKE_MM))
    usual_speed = log_uniform(draw, *SPEED_MM_S)
    moves: list[tuple[float, float, float]] = []
    now, place = 1.0, start

    def go(goal: float) -> None:
        nonlocal now, place
        speed = float(np.clip(usual_speed * log_uniform(draw, 0.7, 1.4), *SPEED_MM_S))
        takes = abs(goal - place) * top / speed
        moves.append((now, takes, goal - place))
        now += takes + float(draw.uniform(0.0, REST_S))
        place = goal

    while now < DURATION_S:
        stroke = float(np.clip(usual_stroke * draw.uniform(0.7, 1.3), *STROKE_MM))
        deepest = max(start + stroke, LEAST_DEPTH_MM)
        go(deepest)
        if draw.uniform() < HALF_WAY:
            go(deepest * float(draw.uniform(0.3, 0.7)))
            go(deepest)
        go(start)
    return Presses(start, kind, tuple(moves))


def multirate_scenario(rates: Rates, delayed: bool, seed: int) -> Scenario:
    """The contact that a seed draws: tissue, presses, noises, and a delay if there is to be one."""
    draw = np.random.default_rng([seed, 817, int(delayed), round(rates.pose)])
    presses = pressed(draw)
    stiffness = log_uniform(draw, 0.2, 2.0)
    p = float(draw.uniform(0.6, 1.2))
    share = log_uniform(draw, *DAMPING_SHARE)
    tissue = Tissue(
        stiffness,
        share * stiffness / presses.fastest_mm_s**p,
        float(draw.uniform(1.2, 2.2)),
        p,
    )
    late = float(draw.choice([-1.0, 1.0])) * float(draw.uniform(*DELAY_MS))
    return Scenario(
        rates.name,
        tissue,
        Motion(0.0),
        0.0,
        log_uniform(draw, 0.005, 0.03),
        log_uniform(draw, 0.02, 0.08),
        duration_s=DURATION_S,
        force_delay_s=1e-3 * late if delayed else 0.0,
        presses=presses,
    )


def readings(rates: Rates, delayed: bool, seed: int) -> SimulatedContact:
    """A drawn contact, read by two clocks that jitter; NaN where a channel has no reading."""
    draw = np.random.default_rng([seed, 818, int(delayed), round(rates.pose)])
    stamps = []
    for rate in (rates.pose, rates.wrench):
        even = np.arange(1, round(DURATION_S * rate)) + float(draw.uniform(0.0, 1.0))
        stamps.append((even + draw.uniform(-JITTER, JITTER, even.size)) / rate)
    return read_apart(multirate_scenario(rates, delayed, seed), seed, *stamps)


def delay_bound(scenario: Scenario, contact: SimulatedContact) -> float:
    """Deviation of the delay for a fit that knows tissue and motion [s].

    Args:
        scenario: the contact.
        contact: its readings; forces where they are finite.
    """
    reads = np.isfinite(contact.force_n)
    late = contact.time_s[reads] - scenario.force_delay_s
    step = 1e-5
    ahead, behind = (
        hunt_crossley_force(*penetration(scenario, late + side)[:2], scenario.tissue.as_array())
        for side in (step, -step)
    )
    rate = (ahead - behind) / (2.0 * step)
    return float(1.0 / np.sqrt(np.sum(np.square(rate / contact.force_noise_std[reads]))))


@dataclass(frozen=True)
class MultirateTask:
    """One run: estimator, rates, whether a channel is late, and the seed of everything else."""

    setup: Setup
    rates: Rates
    delayed: bool
    seed: int


def multirate_run(task: MultirateTask) -> Numbers:
    """What is said of the delay and of K, against the truth."""
    scenario = multirate_scenario(task.rates, task.delayed, task.seed)
    contact = readings(task.rates, task.delayed, task.seed)
    time = contact.time_s
    series = task.setup.create().run(time, contact.displacement_mm, contact.force_n)
    said = series.channel_delay[time >= SETTLED_S] - scenario.force_delay_s
    off = float(abs(said[-1])) if task.delayed else float(np.max(np.abs(said)))
    deviation = float(series.channel_delay_std[-1])
    bound = delay_bound(scenario, contact)
    unknowable = LIKELY * bound > TOLERANCE_S
    tolerance = max(TOLERANCE_S, LIKELY * deviation) if unknowable else TOLERANCE_S
    chosen = sampled(time.size / DURATION_S, time, COUNTED_S)
    error = metrics.log_parameter_error(series.parameters[chosen], contact.parameters[chosen])[:, 0]
    score = np.abs(error) / (series.parameters_std[chosen, 0] / series.parameters[chosen, 0])
    return {
        "off": off,
        "deviation": deviation,
        "bound": bound,
        "far": float(not off < tolerance),
        "K": float(abs(error[-1])),
        "within": float(np.mean(score <= LIKELY)),
        "changes": float(np.count_nonzero(series.change_detected)),
        "mismatch": float(np.mean(series.model_mismatch[time > SETTLED_S])),
    }


def _row(name: str, runs: Sequence[Numbers]) -> Row:
    columns = {key: np.array([run[key] for run in runs]) for key in runs[0]}
    return {
        "contact": name,
        "off": 1e3 * float(np.median(columns["off"])),
        "off_90": 1e3 * float(np.quantile(columns["off"], 0.9)),
        "off_most": 1e3 * float(np.max(columns["off"])),
        "bound": 1e3 * float(np.median(columns["bound"])),
        "deviation": 1e3 * float(np.median(columns["deviation"])),
        "far": float(np.sum(columns["far"])),
        "K": float(np.median(columns["K"])),
        "K_90": float(np.quantile(columns["K"], 0.9)),
        "within": float(np.mean(columns["within"])),
        "changes": float(np.sum(columns["changes"])),
        "mismatch": float(np.mean(columns["mismatch"])),
    }


def multirate(bench: Bench) -> Result:
    """Pose slower than wrench, presses, with a delay and without."""
    setup, skipped = declared(bench)
    if skipped is not None:
        return skipped
    kinds = [(rates, delayed) for delayed in (False, True) for rates in RATES]
    tasks = [
        MultirateTask(setup, rates, delayed, bench.first_seed + seed)
        for rates, delayed in kinds
        for seed in range(bench.seeds)
    ]
    rows = [
        _row(f"{'delayed' if delayed else 'in step'}, {rates.name}", runs)
        for (rates, delayed), runs in zip(kinds, bench.by_seed(multirate_run, tasks), strict=True)
    ]
    none, some = rows[: len(RATES)], rows[len(RATES) :]
    targets = [
        target("in step: largest ms invented", worst(r["off_most"] for r in none), high=2.0),
        target("delayed: runs more than 2 ms off", sum(r["far"] for r in some), high=0.0),
        target(
            "share of the samples with K within 3 deviations",
            float(np.mean([row["within"] for row in rows])),
            low=USUAL,
        ),
        target("changes called", float(sum(row["changes"] for row in rows)), high=0.0),
    ]
    return {"rows": rows, "targets": targets}
