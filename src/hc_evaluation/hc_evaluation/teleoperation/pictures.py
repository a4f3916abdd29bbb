"""Pictures of the teleoperation benchmark for docs/teleoperation.md."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from hc_estimator.kinds import DEFAULT_FILTER
from hc_evaluation.teleoperation.bench import run_case
from hc_evaluation.teleoperation.impedance import CONTROLLERS, run_controller
from hc_evaluation.teleoperation.scores import force_at_the_hand
from hc_sim_rig.bilateral import METHODS, layout
from hc_sim_rig.picture_style import (
    BLUE,
    GREEN,
    GREY,
    LINE,
    ORANGE,
    THICK,
    THIN,
    YELLOW,
    in_style,
    legend_above,
    legend_below,
    new_figure,
    save,
)

COLOURS = dict(zip(METHODS, (ORANGE, YELLOW, GREEN, BLUE), strict=True))
LABELS = {method: method.replace("_", " ") for method in METHODS}
SHOWN_ROUND_TRIP_MS = 300


def write_pictures(result: Mapping[str, Any], folder: Path) -> None:
    """Draw all pictures into a folder.

    Args:
        result: of `run_teleoperation`.
        folder: exists.
    """
    figures = {
        "teleoperation_methods": draw_methods(),
        "teleoperation_delays": draw_delays(result),
        "teleoperation_contact": draw_first_contact(),
        "teleoperation_impedance": draw_impedance(),
    }
    for name, figure in figures.items():
        save(figure, folder / f"{name}.png")


@in_style
def draw_methods(round_trip_ms: float = SHOWN_ROUND_TRIP_MS, seed: int = 0) -> Figure:
    """Position and force of all four methods at one delay."""
    figure = new_figure(8.0)
    axes = figure.subplots(len(METHODS), 2, sharex=True)
    for (left, right), method in zip(axes, METHODS, strict=True):
        filter = DEFAULT_FILTER if method == "model_mediated" else None
        series, scores = run_case(method, round_trip_ms, filter, seed)
        time = series.time_s
        left.plot(time, series.master_mm, color=ORANGE, label="hand")
        left.plot(time, series.slave_mm, color=BLUE, label="tool")
        left.axhline(series.settings.tissue.surface_mm, color=GREEN, lw=THIN, label="surface")
        word = "stable" if scores.stable else "UNSTABLE"
        left.set_title(f"{LABELS[method]}: {word}")
        left.set_ylabel("position [mm]")
        true = force_at_the_hand(series)
        right.plot(time, true, color=GREY, lw=THICK, label="what the tissue would answer the hand")
        right.plot(time, series.hand_force_n, color=ORANGE, lw=THIN, label="hand")
        right.set_ylabel("force [N]")
        right.set_title(
            f"error {scores.force_error_n:.2f} N, transparency {scores.transparency:.2f}, "
            f"peak {scores.peak_force_n:.1f} N",
        )
        lump = series.task.presses[2]
        right.axvspan(series.task.first_presses[2].begin, lump.end, color=GREEN, alpha=0.12, lw=0)
    handles = [line for axis in axes[0] for line in axis.get_legend_handles_labels()[0]]
    handles = [handle for handle in handles if handle is not axes[0, 0].lines[0]]
    names = [str(handle.get_label()) for handle in handles]
    legend_below(figure, handles, names, ncols=4)
    for axis in axes[-1]:
        axis.set_xlabel("time [s]")
    figure.suptitle(
        f"Round trip {round_trip_ms:g} ms, jitter, 10 % loss; the lump is under the green band"
    )
    return figure


@in_style
def draw_delays(result: Mapping[str, Any]) -> Figure:
    """Four scores over the delay; an open marker is an unstable loop."""
    figure = new_figure(5.4)
    axes = figure.subplots(2, 2, sharex=True)
    scores = (
        ("force_error_n", "force error at the hand [N]"),
        ("transparency", "transparency (ideal: 1)"),
        ("peak_force_n", "peak force in the tissue [N]"),
        ("lump_contrast", "contrast of the lump (ideal: 1)"),
    )
    for axis, (name, label) in zip(axes.flat, scores, strict=True):
        for method in METHODS:
            rows = [
                row
                for row in result["rows"]
                if row["method"] == method and row["filter"] in (None, DEFAULT_FILTER)
            ]
            if name == "lump_contrast":
                rows = [row for row in rows if row["stable"]]
            places = [row["round_trip_ms"] for row in rows]
            values = [row[name] for row in rows]
            axis.plot(places, values, color=COLOURS[method], label=LABELS[method])
            for row in rows:
                face = COLOURS[method] if row["stable"] else "white"
                axis.plot(
                    row["round_trip_ms"], row[name], "o", color=COLOURS[method], mfc=face, ms=6
                )
        axis.set_xscale("symlog", linthresh=20.0)
        axis.set_xticks([row["round_trip_ms"] for row in rows])
        axis.set_xticklabels([f"{row['round_trip_ms']:g}" for row in rows])
        if name in ("force_error_n", "peak_force_n"):
            axis.set_yscale("log")
        axis.set_ylabel(label)
    legend_below(figure, *axes[0, 0].get_legend_handles_labels(), ncols=4)
    for axis in axes[-1]:
        axis.set_xlabel("round trip [ms]")
    figure.suptitle("Filled: stable; open: unstable")
    return figure


@in_style
def draw_first_contact(round_trip_ms: float = SHOWN_ROUND_TRIP_MS, seed: int = 0) -> Figure:
    """First contact with model mediation: what the hand feels, the surface, the tank."""
    series, _ = run_case("model_mediated", round_trip_ms, DEFAULT_FILTER, seed)
    mask = (series.time_s > 1.5) & (series.time_s < 6.0)
    time = series.time_s[mask]
    figure = new_figure(6.0)
    position, force, tank = figure.subplots(3, 1, sharex=True)
    position.plot(time, series.master_mm[mask], color=ORANGE, label="hand")
    position.plot(time, series.slave_mm[mask], color=BLUE, label="tool")
    position.plot(time, series.model[mask, 4], color=GREY, ls="--", label="surface as rendered")
    position.axhline(series.settings.tissue.surface_mm, color=GREEN, lw=THIN, label="true surface")
    position.set_ylabel("position [mm]")
    force.plot(time, force_at_the_hand(series)[mask], color=GREY, label="what the tissue answers")
    force.plot(time, series.hand_force_n[mask], color=ORANGE, label="at the hand")
    force.plot(time, series.tissue_force_n[mask], color=BLUE, lw=THIN, label="at the tool")
    force.set_ylabel("force [N]")
    tank.plot(time, series.column(layout.OUT_TANK)[mask], color=GREEN, label="tank [mJ]")
    rate = series.column(layout.OUT_UPDATE_CHANGE)[mask] * series.settings.rate_hz
    tank.plot(time, 0.1 * rate, color=ORANGE, lw=THIN, label="change by updates [10 N/s]")
    tank.set_ylabel("energy budget, updates")
    tank.set_xlabel("time [s]")
    for axis in (position, force, tank):
        legend_above(axis, 4)
    figure.suptitle(f"First contact, model mediated, round trip {round_trip_ms:g} ms")
    return figure


@in_style
def draw_impedance(round_trip_ms: float = SHOWN_ROUND_TRIP_MS, seed: int = 0) -> Figure:
    """The slave's controller fixed and adaptive: force in the tissue, stiffness, stretch."""
    figure = new_figure(6.2)
    force, stiffness, stretch = figure.subplots(3, 1, sharex=True)
    colours = dict(zip(CONTROLLERS, (ORANGE, GREEN, BLUE), strict=True))
    late = round(0.5 * round_trip_ms)
    for name, colour in colours.items():
        series, found = run_controller(name, round_trip_ms, seed)
        time, tool = series.time_s, series.slave_mm
        label = (
            f"{name}: first contact {found['first_contact_n']:.2f} N, "
            f"tracking {found['tracking_mm']:.2f} mm"
        )
        force.plot(time, series.tissue_force_n, color=colour, lw=THIN, label=label)
        stiffness.plot(time, series.column(layout.OUT_SLAVE_STIFFNESS), color=colour, lw=LINE)
        stretch.plot(
            time[late:], series.master_mm[: len(tool) - late] - tool[late:], color=colour, lw=THIN
        )
    force.set_ylabel("force in the tissue [N]")
    stiffness.set_ylabel("stiffness [N/mm]")
    stiffness.set_yscale("log")
    stretch.set_ylabel("command less tool [mm]")
    stretch.set_xlabel("time [s]")
    legend_below(figure, *force.get_legend_handles_labels(), ncols=1)
    figure.suptitle(f"The slave's controller, model mediated, round trip {round_trip_ms:g} ms")
    return figure
