"""`hc bench effort`: how much worse it is without a force sensor, by noise and friction.

Model-mediated teleoperation; the slave's filter sees motion and motor effort only, through a
disturbance observer, and what it finds is what the hand feels. Scored against the simulated truth.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from hc_evaluation.teleoperation.scores import score
from hc_sim_rig.bilateral import (
    Bilateral,
    BilateralSeries,
    Feedback,
    Network,
    SlaveArm,
    layout,
    simulate,
)
from hc_sim_rig.bilateral.simulation import force_observer

ROUND_TRIP_MS = 100.0
SEEDS = 3
QUICK_SEEDS = 1
# Source, noise of the effort [N], dry friction [N], share of it that the observer knows.
CASES = (
    ("sensor", 0.01, 0.0, 1.0),
    ("effort", 0.01, 0.0, 1.0),
    ("effort", 0.05, 0.0, 1.0),
    ("effort", 0.2, 0.0, 1.0),
    ("effort", 0.01, 0.1, 1.0),
    ("effort", 0.01, 0.1, 0.8),
    ("effort", 0.01, 0.1, 0.0),
    ("effort", 0.01, 0.3, 1.0),
    ("effort", 0.01, 0.3, 0.8),
    ("effort", 0.01, 0.3, 0.0),
)
COLUMNS = (
    ("source", "force_source", "{}"),
    ("effort noise N", "effort_noise_n", "{:g}"),
    ("dry friction N", "dry_friction_n", "{:g}"),
    ("known", "friction_known", "{:.0%}"),
    ("force read N", "force_rmse_n", "{:.3f}"),
    ("the same in step N", "force_rmse_in_step_n", "{:.3f}"),
    ("force error at the hand N", "force_error_n", "{:.2f}"),
    ("transparency", "transparency", "{:.2f}"),
    ("lump contrast", "lump_contrast", "{:.2f}"),
    ("model trusted", "trusted_share", "{:.0%}"),
    ("stable", "stable", "{}"),
)


def settings_of(source: str, noise: float, friction: float, known: float) -> Bilateral:
    """The simulation of a case."""
    return Bilateral(
        network=Network(round_trip_ms=ROUND_TRIP_MS),
        slave=SlaveArm(effort_noise_std_n=noise, dry_friction_n=friction),
        feedback=Feedback(force_source=source, friction_known=known),
    )


def force_read(series: BilateralSeries) -> tuple[float, float]:
    """RMS error of the force that the estimator is given [N]: as it comes, and delay aside."""
    settings = series.settings
    true = series.tissue_force_n
    if settings.feedback.force_source == "sensor":
        error = float(np.sqrt(np.mean((series.column(layout.OUT_FORCE_READING) - true) ** 2)))
        return error, error
    _, force = force_observer(settings).run(
        series.time_s,
        series.column(layout.OUT_POSITION_READING),
        series.column(layout.OUT_EFFORT_READING),
    )
    # Two poles, and the sample of the central difference.
    poles = 2.0 / (2.0 * math.pi * settings.feedback.observer_bandwidth_hz)
    late = round(poles * settings.rate_hz) + 1
    raw = force - true
    shifted = force[late:] - true[:-late]
    return float(np.sqrt(np.mean(raw**2))), float(np.sqrt(np.mean(shifted**2)))


def run_effort(
    *, quick: bool = False, progress: Callable[[float], None] | None = None
) -> dict[str, Any]:
    """Measure all cases: rows of medians over the seeds, stable if every seed is."""
    begin = time.monotonic()
    seeds = QUICK_SEEDS if quick else SEEDS
    rows = []
    for k, case in enumerate(CASES):
        found = []
        for seed in range(seeds):
            series = simulate(settings_of(*case), seed=seed)
            scores = score(series)
            late, in_step = force_read(series)
            values = {"force_rmse_n": late, "force_rmse_in_step_n": in_step}
            found.append(values | scores._asdict())
        head = dict(
            zip(
                ("force_source", "effort_noise_n", "dry_friction_n", "friction_known"),
                case,
                strict=True,
            )
        )
        names = [name for _, name, _ in COLUMNS if name not in head and name != "stable"]
        medians = {name: float(np.median([one[name] for one in found])) for name in names}
        rows.append({**head, **medians, "stable": all(one["stable"] for one in found)})
        if progress is not None:
            progress((k + 1) / len(CASES))
    return {
        "round_trip_ms": ROUND_TRIP_MS,
        "rows": rows,
        "seeds": seeds,
        "seconds": time.monotonic() - begin,
    }


def markdown_table(result: Mapping[str, Any]) -> str:
    """The rows as a Markdown table, which a terminal can show as well."""
    table = [[name for name, _, _ in COLUMNS]]
    for row in result["rows"]:
        cells = {**row, "stable": "yes" if row["stable"] else "NO"}
        table.append([text.format(cells[name]) for _, name, text in COLUMNS])
    widths = [max(len(line[i]) for line in table) for i in range(len(COLUMNS))]
    lines = [
        "| " + " | ".join(c.ljust(w) for c, w in zip(line, widths, strict=True)) + " |"
        for line in table
    ]
    lines.insert(1, "|" + "|".join("-" * (width + 2) for width in widths) + "|")
    return "\n".join(lines)
