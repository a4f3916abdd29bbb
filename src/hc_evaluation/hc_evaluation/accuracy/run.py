"""Runs the accuracy experiments and holds their results against the targets.

`run_accuracy` is what `hc bench accuracy` calls.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from hc_evaluation.accuracy import (
    ablation,
    comparisons,
    corners,
    delay,
    mechanics,
    misfit,
    multirate,
    places,
    possible,
    rates,
    real,
    scan,
    sensor_faults,
    separation,
    simulated,
    surface,
    together,
    troubles,
)
from hc_evaluation.accuracy.bench import REPORT_SEED, WORKERS, Bench, Result
from hc_evaluation.accuracy.measure import Setup

SEEDS = 50
QUICK_SEEDS = 6

Progress = Callable[[str, int, int], None]


@dataclass(frozen=True)
class Experiment:
    """One experiment.

    Attributes:
        summary: what it asks, in a phrase.
        run: does it.
        by_name_only: long, and without targets of its own: left out unless asked for.
    """

    summary: str
    run: Callable[[Bench], Result]
    by_name_only: bool = False


def _ablation(bench: Bench) -> Result:
    usual = {name: e.run for name, e in EXPERIMENTS.items() if not e.by_name_only}
    return ablation.ablation(bench, usual)


EXPERIMENTS: dict[str, Experiment] = {
    "tissues": Experiment(
        "errors against the Cramer-Rao bound, NEES, NIS, false alarms on quiet tissue",
        simulated.tissues,
    ),
    "changes": Experiment(
        "time until an abruptly changed tissue is found again", simulated.changes
    ),
    "noise": Experiment("sensor noise jumping fourfold", simulated.noise),
    "recordings": Experiment(
        "half a second predicted on real recordings, against least squares", real.recordings
    ),
    "excitation": Experiment(
        "what a motion that shows too little leaves unknown", simulated.excitation
    ),
    "channels": Experiment(
        "time shift, force zero and contact position found between the channels", real.channels
    ),
    "random": Experiment("tissues, motions, rates and noises drawn at random", simulated.random),
    "corners": Experiment(
        "ramps, holds and ways back, with sharp and with round corners", corners.corners
    ),
    "misfit": Experiment(
        "half a second predicted where the contact law does not fit", misfit.misfit
    ),
    "separation": Experiment(
        "tissue that lets go of the tool, tapping: against the bound that knows it",
        separation.separation,
    ),
    "scan": Experiment(
        "tissue that varies along the way: inclusions, layers, there and back", scan.scan
    ),
    "delay": Experiment(
        "channels out of step, zero and contact position off, found live", delay.delay
    ),
    "surface": Experiment("a surface that breathes or drifts under the tool", surface.surface),
    "rates": Experiment("pose and wrench at rates of their own, reading by reading", rates.rates),
    "multirate": Experiment(
        "a robot that presses, its pose slower than its wrench: a delay found, none invented",
        multirate.multirate,
    ),
    "possible": Experiment(
        "no prediction beyond what was felt, none worse than twice the last reading",
        possible.possible,
    ),
    "together": Experiment(
        "two troubles at once: presses, lumps, delays, zeros, surfaces that move",
        together.together,
    ),
    "troubles": Experiment(
        "everything drawn, each trouble alone and several at once: what is told wrong",
        troubles.troubles,
    ),
    "places": Experiment(
        "a tissue palpated place by place: other stiffness, exponent and height",
        places.places,
    ),
    "mechanics": Experiment(
        "what lies between tissue and readings and is in no law: mass, friction, memory, play",
        mechanics.mechanics,
    ),
    "sensor_faults": Experiment(
        "sensors that nobody watches: readings lost or uneven, zeros moved or moving",
        sensor_faults.sensor_faults,
    ),
    "ablation": Experiment(
        "every mechanism of the default filter off in turn, on every experiment",
        _ablation,
        by_name_only=True,
    ),
    "defaults": Experiment(
        "what each default of the recommended filter is worth",
        comparisons.defaults,
        by_name_only=True,
    ),
    "filters": Experiment(
        "all filters on all simulated tissues", comparisons.filters, by_name_only=True
    ),
}


def checked(names: Sequence[str], seeds: int) -> tuple[str, ...]:
    """The experiments to run: those named, or all that are not by_name_only.

    Raises:
        ValueError: an unknown name, or seeds below 1.
    """
    for name in names:
        if name not in EXPERIMENTS:
            raise ValueError(f"experiment {name!r} is not one of {', '.join(EXPERIMENTS)}")
    if seeds < 1:
        raise ValueError(f"seeds = {seeds}: give 1 or more")
    return tuple(names) or tuple(n for n, e in EXPERIMENTS.items() if not e.by_name_only)


def run_accuracy(
    names: Sequence[str] = (),
    seeds: int | None = None,
    quick: bool = False,
    progress: Progress | None = None,
    setup: Setup | None = None,
    first_seed: int = REPORT_SEED,
    workers: int = WORKERS,
) -> Result:
    """Run experiments and compare with their targets.

    Args:
        names: some of EXPERIMENTS; none for all that are not by_name_only.
        seeds: noise seeds per scenario (50; 6 where quick).
        quick: few seeds, for a first look.
        progress: called with the experiment's name, runs done and runs in all.
        setup: estimator under test; the recommended filter with its defaults if None.
        first_seed: of the noise; another one than the default to choose settings with.
        workers: processes; with 1 this one.

    Returns:
        Plain data: per experiment its rows (one per scenario or recording) and targets (name,
        value, low, high, met), the seeds, and the seconds it took.

    Raises:
        ValueError: an unknown name, or seeds below 1.
    """
    count = seeds if seeds is not None else (QUICK_SEEDS if quick else SEEDS)
    chosen = checked(names, count)
    estimator = setup if setup is not None else Setup()
    if not estimator.candidate:  # two workers that compile at once spoil the cache for each other
        estimator.create().warm_up()
    started = time.perf_counter()
    result: Result = {
        "filter": estimator.name,
        "parameters": dict(estimator.parameters),
        "seeds": count,
        "first_seed": first_seed,
        "experiments": {},
    }
    for name in chosen:

        def report(done: int, total: int, name: str = name) -> None:
            if progress is not None:
                progress(name, done, total)

        experiment = EXPERIMENTS[name].run(Bench(estimator, count, report, first_seed, workers))
        result["experiments"][name] = {"summary": EXPERIMENTS[name].summary, **experiment}
    result["seconds"] = time.perf_counter() - started
    return result
