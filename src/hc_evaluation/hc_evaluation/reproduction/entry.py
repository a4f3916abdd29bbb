"""The entry of `hc reproduce`: runs experiments, then writes tables, pictures and results."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from hc_evaluation.places import write_csv
from hc_evaluation.reproduction.campaign import (
    QUICK_SEEDS,
    Progress,
    ReproductionResult,
    run_campaign,
)
from hc_evaluation.reproduction.experiment import load_experiment
from hc_evaluation.reproduction.page import experiment_page, markdown
from hc_evaluation.reproduction.published import published_value
from hc_evaluation.reproduction.tables import PAGES, experiment_table
from hc_evaluation.reproduction.verdict import summary_of

PAGE = "reproduction.md"
RESULTS = "reproduction.json"
TABLE = "reproduction.csv"


def _finite(value: Any) -> Any:
    """JSON has no infinity and no NaN: they become null."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: _finite(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(entry) for entry in value]
    return value


def _rows(result: ReproductionResult) -> list[dict[str, Any]]:
    """One row per experiment, column and score, with its summary and the printed figure."""
    rows = []
    for name, entry in result.experiments.items():
        experiment = load_experiment(name)
        printed = {score: row for row, score in experiment.published_rows.items()}
        for column in experiment.columns:
            for score in entry.columns[column.name]:
                value = None
                if score in printed:
                    value = published_value(experiment.published, column.published, printed[score])
                summary = asdict(summary_of(entry, column.name, score))
                rows.append(
                    {
                        "experiment": name,
                        "column": column.name,
                        "setting": column.setting,
                        "score": score,
                        "published": value,
                        **summary,
                    }
                )
    return rows


def _write_pages(result: ReproductionResult, folder: Path, origin: str) -> list[Path]:
    """A page and a table of each experiment."""
    folder.mkdir(parents=True, exist_ok=True)
    files = []
    for name, entry in result.experiments.items():
        page = folder / f"{name}.md"
        page.write_text(experiment_page(entry, origin), encoding="utf-8")
        heading, _, *lines = experiment_table(load_experiment(name), entry)
        rows = tuple(tuple(line.strip("| ").split(" | ")) for line in (heading, *lines))
        write_csv(page.with_suffix(".csv"), origin or name, rows)
        files += [page, page.with_suffix(".csv")]
    return files


def run_reproduction(
    names: Sequence[str] = (),
    *,
    seeds: int = 100,
    quick: bool = False,
    output: Path,
    workers: int = 2,
    progress: Progress | None = None,
    origin: str = "",
) -> ReproductionResult:
    """Run the papers' experiments and write what came out.

    Writes in `output`: reproduction.md (the page of all), evidence/reproduction/ (a page and a
    table of each experiment), pictures/reproduction_*.png, reproduction.csv (one row per
    experiment, column and score; forces in N), reproduction.json (the same with every seed) and
    runs/*.jsonl, from which the same command goes on after an interruption.

    Args:
        names: experiments, see available_experiments(); none for all.
        seeds: seeds per experiment, counted from 1.
        quick: take at most three seeds.
        output: folder for the results; made if it does not exist.
        workers: processes; the numbers do not depend on it.
        progress: called with an experiment's name, its finished seeds, and all of them.
        origin: a line for the page that says where its figures come from.

    Returns:
        Scores of every seed, and the files.

    Raises:
        ReproductionError: an unknown name, a number below 1, or a folder that cannot be written.
    """
    output = Path(output)
    count = min(seeds, QUICK_SEEDS) if quick else seeds
    result = run_campaign(names, seeds=count, output=output, workers=workers, progress=progress)
    rows = _rows(result)
    table = output / TABLE
    with table.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, fieldnames=list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    everything = {
        "format": 1,
        "summary": rows,
        "experiments": {name: asdict(entry) for name, entry in result.experiments.items()},
    }
    results = output / RESULTS
    results.write_text(json.dumps(_finite(everything), indent=1) + "\n", encoding="utf-8")
    page = output / PAGE
    page.write_text(markdown(result, origin), encoding="utf-8")
    result.files += [table, results, page, *_write_pages(result, output / PAGES, origin)]
    return result
