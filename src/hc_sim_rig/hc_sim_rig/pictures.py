"""Pictures of the scenarios, of the loop and of the set-up for the documents.

    python -m hc_sim_rig.pictures docs/pictures

Not imported by the rig itself: matplotlib is slow to import.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

from hc_sim_rig.drives import Teleoperation
from hc_sim_rig.picture_style import (
    BLACK,
    BLUE,
    GREEN,
    LINE,
    MEASURED,
    ORANGE,
    PURPLE,
    THICK,
    THIN,
    TRUE,
    in_style,
    legend_above,
    new_figure,
    save,
)
from hc_sim_rig.records import RigSeries
from hc_sim_rig.rig import Rig
from hc_sim_rig.scenario import Scenario, available_scenarios, load_scenario
from hc_sim_rig.set_up_drawing import draw_set_up

SHOWN_S = {"multisine": 5.0, "sensor_faults": 5.0, "teleoperation": 20.0}
"""Scenarios of which a part says more than the whole [s]."""


@in_style
def draw_scenario(scenario: Scenario) -> Figure:
    """Return a picture of a scenario: displacement, force, and what else is special about it."""
    series = Rig(scenario).run(min(SHOWN_S.get(scenario.name, 1e9), scenario.duration_s))
    figure = new_figure(4.8)
    figure.suptitle(f"{scenario.name}: {scenario.description}")
    grid = figure.add_gridspec(2, 2, width_ratios=[1.7, 1.0])
    motion = figure.add_subplot(grid[0, 0])
    force = figure.add_subplot(grid[1, 0], sharex=motion)
    _draw_motion(motion, scenario, series)
    _draw_force(force, scenario, series)
    _draw_loop(figure.add_subplot(grid[0, 1]), series)
    _draw_special(figure.add_subplot(grid[1, 1]), scenario, series)
    return figure


def _draw_motion(axes: Any, scenario: Scenario, series: RigSeries) -> None:
    t = series.time_s
    if isinstance(scenario.drive, Teleoperation):
        axes.plot(t, series.master.position_mm, color=PURPLE, label="master (slave's mm)")
        axes.plot(t, series.coupling.command_mm, color=PURPLE, ls=":", label="as the slave has it")
        axes.plot(t, series.slave.position_mm, color=BLUE, label="slave")
        axes.axhline(scenario.tissue.surface_mm, color=GREEN, lw=THIN, label="surface")
        axes.set_ylabel("position [mm]")
    else:
        axes.plot(t, series.displacement_mm, color=MEASURED, lw=THICK, label="measured")
        axes.plot(t, series.truth.displacement_mm, color=TRUE, lw=THIN, label="true")
        axes.axhline(0.0, color=GREEN, lw=THIN, label="surface")
        axes.set_ylabel("displacement [mm]")
    legend_above(axes, 4)


def _draw_force(axes: Any, scenario: Scenario, series: RigSeries) -> None:
    t = series.time_s
    axes.plot(t, series.force_n, color=MEASURED, lw=THICK, label="measured")
    axes.plot(t, series.truth.force_n, color=TRUE, lw=THIN, label="true")
    if isinstance(scenario.drive, Teleoperation):
        feedback = series.coupling.feedback_force_n
        axes.plot(t, feedback, color=PURPLE, lw=THIN, label="as the master has it")
        axes.plot(t, series.coupling.operator_force_n, color=BLACK, lw=LINE, label="operator")
    axes.set_ylabel("force [N]")
    axes.set_xlabel("time [s]")
    legend_above(axes, 4)


def _draw_loop(axes: Any, series: RigSeries) -> None:
    axes.plot(series.truth.displacement_mm, series.truth.force_n, color=TRUE, lw=THIN)
    axes.set_xlabel("true displacement [mm]")
    axes.set_ylabel("true force [N]")


def _draw_special(axes: Any, scenario: Scenario, series: RigSeries) -> None:
    """Parameters where they change, else the sensors' errors."""
    parameters = series.truth.parameters
    if np.ptp(parameters[:, 0]) > 0.0:
        by_place = np.ptp(series.lateral_mm) > 0.0
        across = series.lateral_mm if by_place else series.time_s
        names = ("K", "B", "n", "p")
        for column, name in enumerate(names):
            relative = parameters[:, column] / parameters[0, column]
            axes.plot(across, relative, label=f"{name} / {parameters[0, column]:.3g}")
        axes.set_xlabel("sideways [mm]" if by_place else "time [s]")
        axes.set_ylabel("true, relative")
        legend_above(axes, 2)
        return
    errors = (
        ("displacement", series.displacement_mm - series.truth.displacement_mm, "mm", BLUE),
        ("force", series.force_n - series.truth.force_n, "N", ORANGE),
    )
    for name, error, unit, color in errors:
        error = error[np.isfinite(error)]
        low, high = np.quantile(error, [0.001, 0.999])
        axes.hist(
            error,
            bins=np.linspace(low, max(high, low + 1e-6), 80),
            histtype="step",
            density=True,
            color=color,
            label=f"{name} [{unit}], std {error.std():.3g}",
        )
    axes.set_yscale("log")
    axes.set_xlabel("error of the reading")
    axes.set_ylabel("density")
    legend_above(axes, 1)


@in_style
def draw_loop_diagram() -> Figure:
    """Return the diagram of the loop: operator, master, channel, slave, tissue, sensors."""
    figure = new_figure(3.9, width=10.5)
    figure.set_layout_engine("none")
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_xlim(0.0, 21.0)
    axes.set_ylim(0.0, 7.8)
    axes.axis("off")
    boxes = {
        "operator": (0.3, 4.4, 2.8, 1.9, "operator\nforce profile, or\nmotion + hand\nimpedance"),
        "master": (4.4, 4.4, 3.0, 1.9, "master  (10)\n$j_m, b_m, k_m$\ncontrol (16), (17)"),
        "channel": (
            8.8,
            3.3,
            2.9,
            3.0,
            "channel\ndelay, variation,\njitter, loss,\nbursts, overtaking",
        ),
        "slave": (13.1, 4.4, 3.2, 1.9, "slave  (11)\n$m_s, b_s, k_s$\ncontrol (13)-(15)"),
        "tissue": (17.7, 4.4, 3.0, 1.9, "tissue\n$F(d, v)$, layers,\nrelaxation"),
        "signal": (13.1, 1.9, 3.2, 1.1, "true, sensor,\nfiltered, estimated"),
        "sensors": (17.7, 1.7, 3.0, 1.5, "sensors\nnoise, bias, delay,\ndropouts, spikes"),
    }
    for x, y, width, height, text in boxes.values():
        patch = FancyBboxPatch(
            (x, y), width, height, boxstyle="round,pad=0.05", fc="#eef4fa", ec=BLUE, lw=LINE
        )
        axes.add_patch(patch)
        axes.text(x + width / 2, y + height / 2, text, ha="center", va="center", fontsize=9)
    arrows = [
        ((3.2, 5.7), (4.3, 5.7), "$F_h$", (3.75, 5.95)),
        ((7.5, 5.7), (8.7, 5.7), "$k_x\\theta_m$", (8.1, 5.95)),
        ((11.8, 5.7), (13.0, 5.7), "$\\bar{x}_m$", (12.4, 5.95)),
        ((16.4, 5.9), (17.6, 5.9), "$x_s, \\dot{x}_s$", (17.0, 6.15)),
        ((17.6, 4.9), (16.4, 4.9), "$F_e$", (17.0, 5.15)),
        ((19.2, 4.3), (19.2, 3.3), "$d, v, F$", (19.85, 3.8)),
        ((17.6, 2.45), (16.4, 2.45), "", (0, 0)),
        ((14.7, 3.1), (14.7, 4.3), "$x_{fs}, F_e$", (15.45, 3.7)),
        ((13.0, 2.45), (10.25, 2.45), "", (0, 0)),
        ((10.25, 2.45), (10.25, 3.2), "$f_e$", (10.65, 2.8)),
        ((8.7, 4.7), (7.5, 4.7), "$\\bar{f}_e$", (8.1, 4.95)),
        ((19.2, 1.6), (19.2, 0.75), "", (0, 0)),
    ]
    for start, end, text, where in arrows:
        axes.annotate("", end, start, arrowprops={"arrowstyle": "-|>", "color": "#333333"})
        if text:
            axes.text(*where, text, ha="center", va="center", fontsize=9)
    axes.text(20.7, 0.45, "indenter/sample, indenter/wrench", ha="right", fontsize=8.5)
    axes.text(
        0.3,
        1.35,
        "A stage scenario has the motion in the place of operator, master and channel,\n"
        "and a stage (ideal, or a servo with limits) in the place of the slave.\n"
        "Numbers: equations of paper C.",
        fontsize=8.5,
        va="center",
    )
    axes.text(
        0.3,
        7.2,
        "One sample: read sensors, exchange packets, compute controls, then integrate "
        "the plant (Runge-Kutta 4) to the next sample.",
        fontsize=9,
    )
    return figure


def main(arguments: list[str]) -> int:
    """Draw all pictures into a folder; returns the exit status."""
    if len(arguments) != 1:
        print("usage: python -m hc_sim_rig.pictures FOLDER", file=sys.stderr)  # noqa: T201
        return 2
    folder = Path(arguments[0])
    folder.mkdir(parents=True, exist_ok=True)
    save(draw_loop_diagram(), folder / "rig_loop.png")
    save(draw_set_up(), folder / "set_up.png")
    for name in available_scenarios():
        save(draw_scenario(load_scenario(name)), folder / f"rig_{name}.png")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
