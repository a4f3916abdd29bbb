"""Contacts that are lost: a tool that withdraws faster than the tissue follows, and taps.

In separation (d > 0, F = 0) a force reading says only that the law's sum is not positive. The bound
knows it; an estimator that fits the zeros is wrong by tens of percent and certain of it. Six fixed
contacts, among them those of `catalogue` with the damping that they had when tissue could pull, and
one that is drawn anew for every seed.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hc_estimator.contact.arrays import separated
from hc_evaluation.accuracy import catalogue, measure
from hc_evaluation.accuracy.bench import Bench, Result, target, worst
from hc_evaluation.accuracy.measure import Task
from hc_evaluation.accuracy.scenarios import Motion, Scenario, Tissue, log_uniform, simulate
from hc_evaluation.accuracy.simulated import quiet_rows

SMALLEST_SHARE, LARGEST_SHARE = 0.05, 0.4  # of the samples in separation
ATTEMPTS = 1000  # to draw a scenario within them

_TAPPING_MOTION = Motion(0.9, ((2.0, 1.2, -1.57), (0.4, 3.7, 0.4)))

SEPARATIONS = (
    replace(catalogue.REFERENCE, name="reference", tissue=Tissue(0.2, 0.05, 1.8, 1.05)),
    replace(catalogue.SOFT, name="soft_200hz", rate_hz=200.0, tissue=Tissue(0.05, 0.02, 1.3, 1.0)),
    replace(
        catalogue.VISCOUS, name="viscous_500hz", rate_hz=500.0, tissue=Tissue(2.0, 0.4, 1.5, 1.1)
    ),
    replace(catalogue.TAPPING, name="tapping", tissue=Tissue(0.8, 0.1, 1.4, 1.0)),
    replace(
        catalogue.TAPPING,
        name="tapping_2khz",
        rate_hz=2000.0,
        motion=_TAPPING_MOTION,
        tissue=Tissue(1.5, 0.25, 1.2, 0.95),
    ),
    replace(
        catalogue.QUICK, name="quick_500hz", rate_hz=500.0, tissue=Tissue(0.5, 0.06, 1.6, 0.95)
    ),
)


def separated_share(scenario: Scenario) -> float:
    """Share of a scenario's samples in which the tool has left the tissue at d > 0."""
    contact = simulate(scenario, 0)
    return float(np.mean(separated(contact.displacement, contact.velocity, contact.parameters)))


def random_separation(seed: int) -> Scenario:
    """A random scenario with so much damping that 5 to 40 % of the samples are separated.

    Half of them also tap: their motion leaves the tissue's space altogether.

    Args:
        seed: of the draw.
    """
    draw = np.random.default_rng([seed, 413])
    for attempt in range(ATTEMPTS):
        scenario = catalogue.random_scenario(seed + attempt * 1_000_000)
        ratio = log_uniform(draw, 0.02, 0.6)
        motion = scenario.motion
        if draw.random() < 0.5:
            largest = max(amplitude for amplitude, _, _ in motion.sines)
            motion = replace(
                motion, offset_mm=motion.offset_mm - float(draw.uniform(0.5, 2.0)) * largest
            )
        tissue = replace(scenario.tissue, damping=ratio * scenario.tissue.stiffness)
        found = replace(
            scenario,
            name="random",
            tissue=tissue,
            motion=motion,
            rate_hz=max(scenario.rate_hz, 200.0),
        )
        contact = simulate(found, 0)
        touching = float(np.mean(contact.force > 0.0))
        if SMALLEST_SHARE <= separated_share(found) <= LARGEST_SHARE and touching > 0.4:
            return found
    raise RuntimeError(f"no scenario with separation in {ATTEMPTS} draws from seed {seed}")


def separation(bench: Bench) -> Result:
    """Contacts that are lost."""
    rows = quiet_rows(SEPARATIONS, bench.runs(measure.quiet_run, SEPARATIONS))
    seeds = range(bench.first_seed, bench.first_seed + bench.seeds)
    drawn = [random_separation(seed) for seed in seeds]
    # Each with its own noise: errors of runs with the same noise go the same way.
    tasks = [Task(bench.setup, s, seed) for s, seed in zip(drawn, seeds, strict=True)]
    runs = bench.spread(measure.quiet_run, tasks)
    columns = {key: np.array([run[key] for run in runs]) for key in runs[0]}
    rows += quiet_rows([replace(drawn[0], name="random")], [columns])
    # Every one of these is another scenario: each error counts in its own bounds.
    rows[-1]["ratio"] = [
        float(np.sqrt(np.mean((columns[f"error_{i}"] / columns[f"bound_{i}"]) ** 2)))
        for i in range(4)
    ]
    for row, scenario in zip(rows, SEPARATIONS, strict=False):
        row["separated"] = separated_share(scenario)
    rows[-1]["separated"] = float(np.mean([separated_share(s) for s in drawn]))
    targets = [
        target(
            "largest RMS error at 10 s over its bound",
            worst(worst(row["ratio"]) for row in rows),
            high=1.5,
        ),
        target("smallest mean NEES", worst((row["nees"] for row in rows), False), low=2.5),
        target("largest mean NEES", worst(row["nees"] for row in rows), high=6.0),
        target("largest share with a misfit told", worst(r["mismatch"] for r in rows), high=0.02),
        target("changes called", float(sum(row["changes"] for row in rows)), high=0.0),
    ]
    return {"rows": rows, "targets": targets}
