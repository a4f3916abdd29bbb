"""What the accuracy experiments share: runs spread over processes, seeds, targets."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hc_evaluation.accuracy.measure import Numbers, Setup, Task
from hc_evaluation.accuracy.scenarios import Scenario
from hc_evaluation.workers import each

REPORT_SEED = 100_000  # first of the seeds that are reported; no setting is chosen with them
CHOOSING_SEED = 1_000  # first of the seeds to choose settings with
WORKERS = 2

Row = dict[str, Any]
Result = dict[str, Any]


def _no_report(done: int, total: int) -> None:
    del done, total


@dataclass(frozen=True)
class Bench:
    """Where an experiment's runs are done.

    Attributes:
        setup: Estimator under test.
        seeds: Noise seeds per scenario.
        first_seed: The first of them.
        report: Called with runs done and runs in all.
        workers: Processes.
    """

    setup: Setup
    seeds: int
    report: Callable[[int, int], None] = _no_report
    first_seed: int = REPORT_SEED
    workers: int = WORKERS

    def part(self, setup: Setup, seeds: int) -> Bench:
        """The same processes for another estimator and number of seeds, without reports."""
        return Bench(setup, seeds, first_seed=self.first_seed, workers=self.workers)

    def spread(self, function: Callable[[Any], Any], tasks: Sequence[Any]) -> list[Any]:
        """Results of the function for all tasks, in their order."""
        results: dict[int, Any] = {}
        for place, result in each(function, tasks, self.workers):
            results[place] = result
            self.report(len(results), len(tasks))
        return [results[place] for place in range(len(tasks))]

    def by_seed(self, function: Callable[[Any], Any], tasks: Sequence[Any]) -> list[list[Any]]:
        """The same for all seeds of one contact after the other, a list for each contact."""
        flat = self.spread(function, tasks)
        return [flat[place : place + self.seeds] for place in range(0, len(flat), self.seeds)]

    def runs(
        self, function: Callable[[Task], Numbers], scenarios: Sequence[Scenario]
    ) -> list[dict[str, np.ndarray[Any, Any]]]:
        """All seeds of all scenarios; per scenario one array of shape (seeds,) per number."""
        tasks = [
            Task(self.setup, scenario, self.first_seed + seed)
            for scenario in scenarios
            for seed in range(self.seeds)
        ]
        return [
            {key: np.array([n[key] for n in numbers]) for key in numbers[0]}
            for numbers in self.by_seed(function, tasks)
        ]


def target(name: str, value: float, low: float | None = None, high: float | None = None) -> Row:
    """A figure beside the range that the project asks of it."""
    met = bool(
        np.isfinite(value) and (low is None or value >= low) and (high is None or value <= high)
    )
    return {"name": name, "value": float(value), "low": low, "high": high, "met": met}


def worst(values: Iterable[float], high: bool = True) -> float:
    """Largest of the values, or smallest; NaN if one of them is (max() may pass it over)."""
    array = np.array(list(values), dtype=np.float64)
    return float(np.max(array) if high else np.min(array))
