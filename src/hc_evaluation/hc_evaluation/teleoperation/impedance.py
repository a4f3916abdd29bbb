"""`hc bench impedance`: the slave's controller that adapts to the estimate, beside two fixed ones.

Model-mediated teleoperation over delay. What is asked: how hard does the tool press at the first
contact, before anybody knows the tissue, and how well does it follow afterwards.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from hc_evaluation.teleoperation.scores import score
from hc_sim_rig.bilateral import (
    Bilateral,
    BilateralSeries,
    Network,
    SlaveArm,
    layout,
    simulate,
)

SEEDS = 3
QUICK_SEEDS = 1
ROUND_TRIPS_MS = (0.0, 300.0, 1000.0)
DEFAULT = SlaveArm()
CONTROLLERS: dict[str, SlaveArm] = {
    "stiff": DEFAULT,
    "soft": SlaveArm(stiffness=DEFAULT.stiffness_low, controller_damping=0.03),
    "adaptive": SlaveArm(impedance="adaptive"),
}
COLUMNS = (
    ("controller", "controller", "{}"),
    ("round trip ms", "round_trip_ms", "{:g}"),
    ("stable", "stable", "{}"),
    ("first contact peak N", "first_contact_n", "{:.2f}"),
    ("peak force N", "peak_force_n", "{:.2f}"),
    ("tracking error mm", "tracking_mm", "{:.2f}"),
    ("force error N", "force_error_n", "{:.2f}"),
    ("stiffness N/mm", "stiffness", "{:.2f}"),
    ("largest change N/mm/s", "stiffness_rate", "{:.1f}"),
)


def run_controller(
    name: str, round_trip_ms: float, seed: int
) -> tuple[BilateralSeries, dict[str, float | bool]]:
    """Run one controller at one delay: the series, and what it is judged by.

    Args:
        name: of CONTROLLERS.
        round_trip_ms: of the network.
        seed: of everything.
    """
    arm = CONTROLLERS[name]
    settings = Bilateral(slave=arm, network=Network(round_trip_ms=round_trip_ms))
    series = simulate(settings, seed=seed)
    scores = score(series)
    rate = settings.rate_hz
    late = round(0.5e-3 * round_trip_ms * rate)
    hand = np.r_[np.full(late, series.master_mm[0]), series.master_mm[: len(series.time_s) - late]]
    working = series.task.palpation.mask(series.time_s)
    error = (hand - series.slave_mm)[working]
    touch = series.task.first_contact
    # Until the hand has felt the tissue: a round trip, and the second press is over.
    first = (series.time_s >= touch.begin) & (series.time_s < touch.end + 1e-3 * round_trip_ms)
    stiffness = series.column(layout.OUT_SLAVE_STIFFNESS)
    return series, {
        "stable": scores.stable,
        "first_contact_n": float(series.tissue_force_n[first].max()),
        "peak_force_n": scores.peak_force_n,
        "tracking_mm": float(np.sqrt(np.mean(error**2))),
        "force_error_n": scores.force_error_n,
        "stiffness": float(np.median(stiffness[working])),
        "stiffness_rate": float(np.abs(np.diff(stiffness)).max() * rate),
    }


def run_impedance(
    *, quick: bool = False, progress: Callable[[float], None] | None = None
) -> dict[str, Any]:
    """Measure all controllers: rows of medians over the seeds, stable if every seed is."""
    begin = time.monotonic()
    seeds = QUICK_SEEDS if quick else SEEDS
    rows = []
    cases = [(name, delay) for name in CONTROLLERS for delay in ROUND_TRIPS_MS]
    for k, (name, delay) in enumerate(cases):
        found = [run_controller(name, delay, seed)[1] for seed in range(seeds)]
        medians = {
            key: float(np.median([one[key] for one in found]))
            for key in found[0]
            if key != "stable"
        }
        stable = all(one["stable"] for one in found)
        rows.append({"controller": name, "round_trip_ms": delay, **medians, "stable": stable})
        if progress is not None:
            progress((k + 1) / len(cases))
    return {"rows": rows, "seeds": seeds, "seconds": time.monotonic() - begin}


def text_table(result: Mapping[str, Any]) -> str:
    """The rows in Markdown, which a terminal can show as well."""
    table = [[name for name, _, _ in COLUMNS]]
    for row in result["rows"]:
        shown = {**row, "stable": "yes" if row["stable"] else "NO"}
        table.append([text.format(shown[name]) for _, name, text in COLUMNS])
    widths = [max(len(line[i]) for line in table) for i in range(len(COLUMNS))]
    lines = [
        "| " + " | ".join(c.ljust(w) for c, w in zip(line, widths, strict=True)) + " |"
        for line in table
    ]
    lines.insert(1, "|" + "|".join("-" * (width + 2) for width in widths) + "|")
    return "\n".join(lines)
