"""Runs the accuracy experiments and holds their results against the targets.

`run_accuracy` is what `hc bench accuracy` calls.
"""

from __future__ import annotations

import multiprocessing
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor

from hc_evaluation.accuracy import (
    comparisons,
    corners,
    delay,
    misfit,
    possible,
    rates,
    real,
    scan,
    separation,
    simulated,
    surface,
)
from hc_evaluation.accuracy.bench import REPORT_SEED, WORKERS, Bench, Result
from hc_evaluation.accuracy.measure import Setup

SEEDS = 50
QUICK_SEEDS = 6

Progress = Callable[[str, int, int], None]

EXPERIMENTS = (
    "tissues",
    "changes",
    "noise",
    "recordings",
    "excitation",
    "channels",
    "random",
    "corners",
    "misfit",
    "separation",
    "scan",
    "delay",
    "surface",
    "rates",
    "possible",
    "defaults",
    "filters",
)
SUMMARIES = {
    "tissues": "errors against the Cramer-Rao bound, NEES, NIS, false alarms on quiet tissue",
    "changes": "time until an abruptly changed tissue is found again",
    "noise": "sensor noise jumping fourfold",
    "recordings": "half a second predicted on real recordings, against least squares",
    "excitation": "what a motion that shows too little leaves unknown",
    "channels": "time shift, force zero and contact position found between the channels",
    "random": "tissues, motions, rates and noises drawn at random",
    "corners": "ramps, holds and ways back, with sharp and with round corners",
    "misfit": "half a second predicted where the contact law does not fit",
    "separation": "tissue that lets go of the tool, tapping: against the bound that knows it",
    "scan": "tissue that varies along the way: inclusions, layers, there and back",
    "delay": "channels out of step, zero and contact position off, found live",
    "surface": "a surface that breathes or drifts under the tool",
    "rates": "pose and wrench at rates of their own, reading by reading",
    "possible": "no prediction beyond what was felt, none worse than twice the last reading",
    "defaults": "what each default of the recommended filter is worth",
    "filters": "all filters on all simulated tissues",
}

BY_NAME_ONLY = ("defaults", "filters")  # long, and compared with each other instead of targets

_RUNNERS: dict[str, Callable[[Bench], Result]] = {
    "tissues": simulated.tissues,
    "changes": simulated.changes,
    "noise": simulated.noise,
    "recordings": real.recordings,
    "excitation": simulated.excitation,
    "channels": real.channels,
    "random": simulated.random,
    "corners": corners.corners,
    "misfit": misfit.misfit,
    "separation": separation.separation,
    "scan": scan.scan,
    "delay": delay.delay,
    "surface": surface.surface,
    "rates": rates.rates,
    "possible": possible.possible,
    "defaults": comparisons.defaults,
    "filters": comparisons.filters,
}


def run_accuracy(
    names: Sequence[str] = (),
    seeds: int | None = None,
    quick: bool = False,
    progress: Progress | None = None,
    setup: Setup | None = None,
) -> Result:
    """Run experiments and compare with their targets.

    Args:
        names: some of EXPERIMENTS; none for all but BY_NAME_ONLY.
        seeds: noise seeds per scenario (50; 6 where quick).
        quick: few seeds, for a first look.
        progress: called with the experiment's name, runs done and runs in all.
        setup: estimator under test; the recommended filter with its defaults if None.

    Returns:
        Plain data: per experiment its rows (one per scenario or recording) and targets (name,
        value, low, high, met), the seeds, and the seconds it took.

    Raises:
        ValueError: an unknown name, or seeds below 1.
    """
    chosen = tuple(names) or tuple(n for n in EXPERIMENTS if n not in BY_NAME_ONLY)
    for name in chosen:
        if name not in EXPERIMENTS:
            raise ValueError(f"experiment {name!r} is not one of {', '.join(EXPERIMENTS)}")
    count = seeds if seeds is not None else (QUICK_SEEDS if quick else SEEDS)
    if count < 1:
        raise ValueError(f"seeds = {count}: give 1 or more")
    estimator = setup if setup is not None else Setup()
    started = time.perf_counter()
    result: Result = {
        "filter": estimator.name,
        "parameters": dict(estimator.parameters),
        "seeds": count,
        "first_seed": REPORT_SEED,
        "experiments": {},
    }
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(WORKERS, mp_context=context) as pool:
        for name in chosen:

            def report(done: int, total: int, name: str = name) -> None:
                if progress is not None:
                    progress(name, done, total)

            experiment = _RUNNERS[name](Bench(pool, estimator, count, report))
            result["experiments"][name] = {"summary": SUMMARIES[name], **experiment}
    result["seconds"] = time.perf_counter() - started
    return result
