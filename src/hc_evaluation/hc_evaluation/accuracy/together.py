"""Two troubles at once: what each experiment shows alone, and what hides when they meet.

Presses from rest, tapping and sines; channels out of step, lumps, a surface that sinks or breathes,
tissue that drifts, zeros that are off: every seed draws another contact of each pair. The same
figures for all of them, so that one sees what a pair costs beside what the estimate said it would.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from hc_evaluation import metrics
from hc_evaluation.accuracy.bench import Bench, Result, Row, target, worst
from hc_evaluation.accuracy.measure import Numbers, Task, run_task, sampled
from hc_evaluation.accuracy.presses import Presses, random_presses
from hc_evaluation.accuracy.scenarios import (
    Motion,
    Scenario,
    Tissue,
    log_uniform,
    simulate,
    without_tension,
)
from hc_evaluation.accuracy.varying_tissue import Inclusion, Surface, Way

DURATION_S = 24.0
START_S = 8.0  # from then on the estimate counts
USUAL = 0.9  # of the samples of a run, and of the runs
RATES_HZ = (200.0, 500.0, 1000.0)
LIKELY = 3.0  # deviations


def _contact(
    name: str,
    motion: Motion,
    fastest: float,
    draw: np.random.Generator,
    presses: Presses | None = None,
) -> Scenario:
    """A contact with everything drawn but its motion; nothing is wrong with it yet.

    Args:
        name: of the scenario.
        motion: of the tool.
        fastest: largest speed at which the tool leaves the tissue, or the tissue the tool [mm/s].
        draw: where everything is drawn from.
        presses: in place of the motion.
    """
    stiffness = log_uniform(draw, 0.1, 2.0)
    tissue = Tissue(
        stiffness,
        stiffness * log_uniform(draw, 0.005, 0.05),
        float(draw.uniform(1.2, 2.0)),
        float(draw.uniform(0.9, 1.1)),
    )
    scenario = Scenario(
        name,
        without_tension(tissue, fastest),
        motion,
        float(draw.choice(RATES_HZ)),
        log_uniform(draw, 0.001, 0.008),
        0.0,
        duration_s=DURATION_S,
        presses=presses,
    )
    largest = float(np.max(simulate(scenario, 0).force))
    return replace(scenario, force_noise_n=largest * log_uniform(draw, 0.0005, 0.003))


def _pressed(name: str, seed: int) -> tuple[Scenario, np.random.Generator]:
    draw = np.random.default_rng([seed, 61])
    presses = random_presses(draw, DURATION_S)
    still = Motion(presses.start_mm)
    return _contact(name, still, presses.fastest_mm_s, draw, presses), draw


def _tapped(name: str, seed: int) -> tuple[Scenario, np.random.Generator]:
    draw = np.random.default_rng([seed, 62])
    frequency, depth = float(draw.uniform(1.0, 2.5)), float(draw.uniform(1.0, 2.5))
    sines = (
        (depth, frequency, float(draw.uniform(0.0, 6.28))),
        (0.1 * depth, 3.3 * frequency, float(draw.uniform(0.0, 6.28))),
    )
    motion = Motion(depth * float(draw.uniform(0.5, 0.9)), sines)
    fastest = 2.0 * np.pi * sum(a * f for a, f, _ in sines)
    return _contact(name, motion, fastest, draw), draw


def _palpated(name: str, seed: int) -> tuple[Scenario, np.random.Generator]:
    draw = np.random.default_rng([seed, 63])
    swing = float(draw.uniform(1.2, 4.0))
    sines = (
        (0.35 * swing, float(draw.uniform(1.0, 1.8)), float(draw.uniform(0.0, 6.28))),
        (0.15 * swing, float(draw.uniform(2.7, 4.5)), float(draw.uniform(0.0, 6.28))),
    )
    # Deep enough that neither a breath out nor a surface that sinks ends the contact.
    motion = Motion(0.5 * swing + 2.0 + float(draw.uniform(0.2, 1.0)), sines)
    fastest = 2.0 * np.pi * sum(a * f for a, f, _ in sines) + 1.6
    return _contact(name, motion, fastest, draw), draw


def _slow(name: str, seed: int) -> tuple[Scenario, np.random.Generator]:
    """A hand that palpates hardly more quickly than the organ breathes."""
    draw = np.random.default_rng([seed, 64])
    swing = float(draw.uniform(1.2, 3.6))
    sines = (
        (0.4 * swing, 0.2, float(draw.uniform(0.0, 6.28))),
        (0.5 * swing, float(draw.uniform(0.4, 0.8)), float(draw.uniform(0.0, 6.28))),
        (0.1 * swing, 1.4, float(draw.uniform(0.0, 6.28))),
    )
    motion = Motion(swing + float(draw.uniform(0.5, 2.0)), sines)
    fastest = 2.0 * np.pi * sum(a * f for a, f, _ in sines) + 1.6
    return _contact(name, motion, fastest, draw), draw


def _out_of_step(scenario: Scenario, draw: np.random.Generator) -> Scenario:
    sign = float(draw.choice([-1.0, 1.0]))
    return replace(scenario, force_delay_s=sign * float(draw.uniform(0.008, 0.05)))


def _lumps(scenario: Scenario, draw: np.random.Generator) -> Scenario:
    way = Way(40.0, DURATION_S / 2.0)
    lump = Inclusion(
        float(draw.uniform(15.0, 25.0)), float(draw.uniform(3.0, 6.0)), log_uniform(draw, 0.5, 3.0)
    )
    return replace(
        scenario, way=way, inclusions=(replace(lump, damping_factor=lump.stiffness_factor),)
    )


def _drifting(scenario: Scenario, draw: np.random.Generator) -> Scenario:
    """Tissue that becomes harder or softer by 20 to 60 %, over ten seconds."""
    factor = float(np.exp(draw.choice([-1.0, 1.0]) * draw.uniform(0.2, 0.5)))
    layer = Inclusion(20.0, 12.0, factor, factor, edge=True)
    return replace(scenario, way=Way(40.0, DURATION_S), inclusions=(layer,))


def _sinking(scenario: Scenario, draw: np.random.Generator) -> Scenario:
    speed = float(draw.choice([-1.0, 1.0])) * float(draw.uniform(0.02, 0.06))
    return replace(scenario, surface=Surface(drift_mm_s=speed))


def _breathing(scenario: Scenario, draw: np.random.Generator) -> Scenario:
    surface = Surface(float(draw.uniform(0.3, 1.0)), 0.25, float(draw.uniform(0.0, 6.28)))
    return replace(scenario, surface=surface)


def _zeros_off(scenario: Scenario, draw: np.random.Generator) -> Scenario:
    position = float(draw.choice([-1.0, 1.0])) * float(draw.uniform(0.1, 0.4))
    largest = float(np.max(simulate(scenario, 0).force))
    zero = float(draw.choice([-1.0, 1.0])) * float(draw.uniform(0.005, 0.02)) * largest
    return replace(scenario, contact_position_mm=position, force_zero_n=zero)


Trouble = Callable[[Scenario, np.random.Generator], Scenario]
Begun = Callable[[str, int], tuple[Scenario, np.random.Generator]]
PAIRS: dict[str, tuple[Begun, tuple[Trouble, ...]]] = {
    "presses": (_pressed, ()),
    "presses, out of step": (_pressed, (_out_of_step,)),
    "presses, surface sinks": (_pressed, (_sinking,)),
    "presses, tissue drifts": (_pressed, (_drifting,)),
    "presses, breathing": (_pressed, (_breathing,)),
    "presses, lumps": (_pressed, (_lumps,)),
    "presses, zeros off, out of step": (_pressed, (_zeros_off, _out_of_step)),
    "presses, breathing, zeros off": (_pressed, (_breathing, _zeros_off)),
    "tapping, out of step": (_tapped, (_out_of_step,)),
    "tapping, tissue drifts": (_tapped, (_drifting,)),
    "tapping, surface sinks": (_tapped, (_sinking,)),
    "tapping, zeros off": (_tapped, (_zeros_off,)),
    "tapping, breathing, zeros off": (_tapped, (_breathing, _zeros_off)),
    "lumps, out of step": (_palpated, (_lumps, _out_of_step)),
    "lumps, surface sinks": (_palpated, (_lumps, _sinking)),
    "lumps, zeros off": (_palpated, (_lumps, _zeros_off)),
    "breathing, out of step": (_palpated, (_breathing, _out_of_step)),
    "breathing, lumps": (_palpated, (_breathing, _lumps)),
    "breathing, zeros off": (_palpated, (_breathing, _zeros_off)),
    "slow, breathing": (_slow, (_breathing,)),
    "slow, breathing, out of step": (_slow, (_breathing, _out_of_step)),
    "slow, breathing, zeros off": (_slow, (_breathing, _zeros_off)),
    "sinking, zeros off": (_palpated, (_sinking, _zeros_off)),
    "tissue drifts, zeros off": (_palpated, (_drifting, _zeros_off)),
}
"""By name: how the tool moves, and what is wrong besides."""


def contact_of(name: str, seed: int) -> Scenario:
    """The contact that a seed draws of a pair.

    Raises:
        KeyError: no such pair.
    """
    begin, troubles = PAIRS[name]
    scenario, draw = begin(name, seed)
    for trouble in troubles:
        scenario = trouble(scenario, draw)
    return scenario


def pair_run(task: Task) -> Numbers:
    """Errors of K and of the delay, what was claimed of them, predictions and flags."""
    contact, series = run_task(task)
    scenario = task.scenario
    chosen = sampled(scenario.rate_hz, contact.time_s, START_S)
    error = metrics.log_parameter_error(series.parameters[chosen], contact.parameters[chosen])[:, 0]
    deviation = series.parameters_std[chosen, 0] / series.parameters[chosen, 0]
    late = contact.time_s >= START_S
    pressed = late & (contact.force > LIKELY * scenario.force_noise_n)
    missed = series.force_predicted[pressed] - contact.force_n[pressed]
    return {
        "K": float(np.median(np.abs(error))),
        "K_90": float(np.quantile(np.abs(error), USUAL)),
        "score_90": float(np.quantile(np.abs(error) / deviation, USUAL)),
        "within": float(np.mean(np.abs(error) <= LIKELY * deviation)),
        "delay": abs(float(series.channel_delay[-1]) - scenario.force_delay_s),
        "predicted": float(np.sqrt(np.nanmean(missed**2))) / scenario.force_noise_n,
        "changes": float(np.count_nonzero(series.change_detected[late])),
        "mismatch": float(np.mean(series.model_mismatch[late])),
    }


def _row(name: str, runs: Sequence[Numbers]) -> Row:
    columns = {key: np.array([run[key] for run in runs]) for key in runs[0]}
    return {
        "pair": name,
        "K": float(np.median(columns["K"])),
        "K_90": float(np.quantile(columns["K_90"], USUAL)),
        "score_90": float(np.quantile(columns["score_90"], USUAL)),
        "within": float(np.mean(columns["within"])),
        "delay_ms": 1e3 * float(np.median(columns["delay"])),
        "delay_90_ms": 1e3 * float(np.quantile(columns["delay"], USUAL)),
        "predicted": float(np.median(columns["predicted"])),
        "changes": float(np.sum(columns["changes"])),
        "mismatch": float(np.mean(columns["mismatch"])),
    }


def together(bench: Bench) -> Result:
    """Two troubles at once."""
    tasks = [
        Task(bench.setup, contact_of(name, bench.first_seed + seed), bench.first_seed + seed)
        for name in PAIRS
        for seed in range(bench.seeds)
    ]
    rows = [
        _row(name, runs) for name, runs in zip(PAIRS, bench.by_seed(pair_run, tasks), strict=True)
    ]
    targets = [
        target("largest median error of K", worst(row["K"] for row in rows), high=0.05),
        target(
            "least share of the samples with K within 3 deviations",
            worst((row["within"] for row in rows), False),
            low=0.9,
        ),
        target(
            "largest median error of the delay, ms",
            worst(row["delay_ms"] for row in rows),
            high=2.0,
        ),
        target(
            "largest share with a misfit told", worst(row["mismatch"] for row in rows), high=0.05
        ),
        target("changes called", float(sum(row["changes"] for row in rows)), high=0.0),
    ]
    return {"rows": rows, "targets": targets}
