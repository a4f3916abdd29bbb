"""Every mechanism of the default filter off in turn, on every experiment: what earns its place?

One row per mechanism, one cell per experiment: how many of its targets are met, and the largest
exceedance of a target (value over its limit; 1 is on the limit); the last column names the
experiments in which fewer or more targets are met than with everything on. A mechanism without any
earns its place only by what the exceedances say. The list is `filter_variations.MECHANISMS`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from hc_evaluation.accuracy.bench import Bench, Result, Row
from hc_evaluation.accuracy.filter_variations import MECHANISMS
from hc_evaluation.accuracy.measure import Setup

Experiment = Callable[[Bench], Result]


@dataclass(frozen=True)
class _Cell:
    """One experiment with one mechanism off."""

    experiment: Experiment
    setup: Setup
    seeds: int
    first_seed: int


def _targets(cell: _Cell) -> list[Row]:
    """What the experiment finds, all of its runs in this process.

    A cell is a task, not a run of it: of few seeds the start of new processes for every experiment
    took longer than the runs.
    """
    bench = Bench(cell.setup, cell.seeds, first_seed=cell.first_seed, workers=1)
    return list(cell.experiment(bench)["targets"])


def exceedance(target: Mapping[str, Any]) -> float:
    """By how much a figure exceeds its limit: 1 on the limit, less inside, infinite where missing.

    Of a lower limit it is the limit over the figure. A limit of 0 is exceeded by 1 + the figure.
    """
    value = float(target["value"])
    if not np.isfinite(value):
        return float("inf")
    found = 0.0
    if target["high"] is not None:
        high = float(target["high"])
        found = value / high if high > 0.0 else 1.0 + value - high
    if target["low"] is not None:
        low = float(target["low"])
        if low > 0.0:
            found = max(found, low / value if value > 0.0 else float("inf"))
        else:
            found = max(found, 1.0 + low - value)
    return found


def _difference(met: Mapping[str, int], whole: Mapping[str, int]) -> str:
    changes = {name: met[name] - whole[name] for name in met if met[name] != whole[name]}
    return ", ".join(f"{name} {change:+d}" for name, change in changes.items()) or "nothing"


def ablation(bench: Bench, experiments: Mapping[str, Experiment]) -> Result:
    """The table.

    Args:
        bench: where the runs are done; a twelfth of its seeds is used, at least two.
        experiments: what is run for each mechanism.

    Returns:
        Rows with one cell for each experiment, and no targets: the rows are compared.
    """
    few = max(2, bench.seeds // 12)
    cells = [
        _Cell(experiment, bench.setup.with_parameters(parameters), few, bench.first_seed)
        for _, parameters in MECHANISMS
        for experiment in experiments.values()
    ]
    found = iter(bench.spread(_targets, cells))
    rows: list[Row] = []
    whole: dict[str, int] = {}
    for name, _ in MECHANISMS:
        row: Row = {"off": name}
        met: dict[str, int] = {}
        for key in experiments:
            targets = next(found)
            met[key] = sum(bool(entry["met"]) for entry in targets)
            largest = max((exceedance(entry) for entry in targets), default=float("nan"))
            row[key] = f"{met[key]}/{len(targets)}, {largest:.2g}" if targets else "skipped"
        whole = whole or met
        row["difference"] = _difference(met, whole)
        rows.append(row)
    return {"rows": rows, "targets": [], "seeds": few}
