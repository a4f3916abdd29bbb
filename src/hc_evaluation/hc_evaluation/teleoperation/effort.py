"""`hc bench effort`: how much worse it is without a force sensor, by noise and friction.

Model-mediated teleoperation; the slave's filter sees motion and motor effort only, through a
disturbance observer, and what it finds is what the hand feels. Scored against the simulated truth.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from hc_evaluation.reproduction import position_filters
from hc_evaluation.reproduction.position_filters import MM_PER_CM
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
PAPER_VELOCITY_STD_CM_S = 0.02
"""sigma_2 of paper C's table II."""
# Source or filter, noise of the effort [N], dry friction [N], share of it that the filter knows.
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
    *(
        (method, noise, friction, known)
        for method in ("extended", "unscented", "sir_pf")
        for noise, friction, known in ((0.01, 0.0, 1.0), (0.2, 0.0, 1.0), (0.01, 0.3, 0.8))
    ),
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


PLACES = ("effort", "effort, one motion")
"""Of the tables in the document."""


def settings_of(source: str, noise: float, friction: float, known: float) -> Bilateral:
    """The simulation of a case; a source that is a filter's name is effort through that filter."""
    if source not in ("sensor", "effort"):
        plain = settings_of("effort", noise, friction, known)
        return replace(plain, feedback=replace(plain.feedback, force_filter=source))
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
    if settings.feedback.force_filter != "observer":  # no low-pass, no delay to be taken off
        error = float(np.sqrt(np.mean((force - true) ** 2)))
        return error, error
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
        "known_tissue": run_known_tissue(),
        "seeds": seeds,
        "seconds": time.monotonic() - begin,
    }


# Paper C's filters know slave and tissue. Noise is the simulation's, in cm.
PAPER_FILTERS: tuple[tuple[str, str, dict[str, Any]], ...] = (
    ("extended filter (paper C)", "position_ekf", {}),
    ("particles, law moves them", "position_pf", {"particles": 50, "seed": 1}),
    (
        "particles, Eq. 26 as printed",
        "position_pf",
        {"particles": 50, "seed": 1, "force_state": True},
    ),
)
PAPER_FRICTION_N = (0.0, 0.1, 0.3)
KNOWN_COLUMNS = (
    ("estimator", "estimator", "{}"),
    ("knows the tissue", "knows_tissue", "{}"),
    ("dry friction N", "dry_friction_n", "{:g}"),
    ("position error um", "position_rmse_um", "{:.1f}"),
    ("force read N", "force_rmse_n", "{:.3f}"),
    ("the same in step N", "force_rmse_in_step_n", "{:.3f}"),
)


def run_known_tissue(seed: int = 0) -> list[dict[str, Any]]:
    """Paper C's filters beside the observer: they know the tissue, nobody knows the friction.

    The tissue has p = 1 and no lump, as theirs. All are given the same position and effort.
    """
    rows: list[dict[str, Any]] = []
    for friction in PAPER_FRICTION_N:
        settings = settings_of("effort", 0.01, friction, 0.0)
        tissue = replace(
            settings.tissue,
            velocity_exponent=1.0,
            lump_stiffness_factor=1.0,
            lump_damping_factor=1.0,
        )
        # The motion is that of a run with a sensor: the same for everybody.
        feedback = replace(settings.feedback, force_source="sensor")
        settings = replace(settings, tissue=tissue, feedback=feedback)
        series = simulate(settings, seed=seed)
        effort_only = replace(series, settings=settings_of("effort", 0.01, friction, 0.0))
        late, in_step = force_read(effort_only)
        rows.append(
            {
                "estimator": "disturbance observer",
                "knows_tissue": "no",
                "dry_friction_n": friction,
                "position_rmse_um": math.nan,
                "force_rmse_n": late,
                "force_rmse_in_step_n": in_step,
            }
        )
        for method in ("extended", "unscented"):
            known = settings_of(method, 0.01, friction, 0.0)
            place, found_n = force_observer(known).run(
                series.time_s,
                series.column(layout.OUT_POSITION_READING),
                series.column(layout.OUT_EFFORT_READING),
            )
            error = float(np.sqrt(np.mean((found_n - series.tissue_force_n) ** 2)))
            rows.append(
                {
                    "estimator": f"{method}, force a state",
                    "knows_tissue": "no",
                    "dry_friction_n": friction,
                    "position_rmse_um": 1e3
                    * float(np.sqrt(np.mean((place - series.slave_mm) ** 2))),
                    "force_rmse_n": error,
                    "force_rmse_in_step_n": error,
                }
            )
        for name, filter, extra in PAPER_FILTERS:
            found = _paper_filter(series, filter, extra)
            force = float(np.sqrt(np.mean((found[:, 2] - series.tissue_force_n) ** 2)))
            depth = series.slave_mm - tissue.surface_mm
            rows.append(
                {
                    "estimator": name,
                    "knows_tissue": "yes",
                    "dry_friction_n": friction,
                    "position_rmse_um": 1e3 * float(np.sqrt(np.mean((found[:, 0] - depth) ** 2))),
                    "force_rmse_n": force,
                    "force_rmse_in_step_n": force,
                }
            )
    return rows


def _paper_filter(series: BilateralSeries, filter: str, extra: Mapping[str, Any]) -> Any:
    """Run a filter of paper C over position and effort: (samples, 4), mm and N."""
    slave, tissue = series.settings.slave, series.settings.tissue
    n, ten = tissue.displacement_exponent, MM_PER_CM
    model = [
        1e-3 * slave.mass_kg * ten,
        slave.damping * ten,
        0.0,
        tissue.stiffness * ten**n,
        tissue.damping * ten ** (n + 1.0),
        n,
        1.0 + tissue.surface_mm / ten,
    ]
    reading = slave.position_noise_std_mm / ten
    common = {
        "model": model,
        "process_noise": [0.1 * reading, PAPER_VELOCITY_STD_CM_S, 0.01],
        "measurement_variance": reading**2,
    }
    position = series.column(layout.OUT_POSITION_READING) - tissue.surface_mm
    # The effort of a row is the one from there on, which is what u_s(k-1) of Eq. 19 means.
    effort = series.column(layout.OUT_EFFORT_READING)
    step = 1.0 / series.settings.rate_hz
    return position_filters.run(filter, position, effort, step, {**common, **extra})


def markdown_tables(result: Mapping[str, Any]) -> dict[str, str]:
    """Both tables in Markdown, by the names of their places in the document."""
    tables = _table(COLUMNS, result["rows"]), _table(KNOWN_COLUMNS, result["known_tissue"])
    return dict(zip(PLACES, tables, strict=True))


def text_tables(result: Mapping[str, Any]) -> str:
    """Both tables for a terminal, which can show Markdown as well."""
    first, second = markdown_tables(result).values()
    return f"{first}\n\nOn one and the same motion, friction not known:\n\n{second}"


def _table(columns: Sequence[tuple[str, str, str]], rows: Sequence[Mapping[str, Any]]) -> str:
    table = [[name for name, _, _ in columns]]
    for row in rows:
        cells = {
            name: ("yes" if value else "NO") if isinstance(value, bool) else value
            for name, value in row.items()
        }
        line = [text.format(cells[name]) for _, name, text in columns]
        table.append(["" if cell == "nan" else cell for cell in line])
    widths = [max(len(line[i]) for line in table) for i in range(len(columns))]
    lines = [
        "| " + " | ".join(c.ljust(w) for c, w in zip(line, widths, strict=True)) + " |"
        for line in table
    ]
    lines.insert(1, "|" + "|".join("-" * (width + 2) for width in widths) + "|")
    return "\n".join(lines)
