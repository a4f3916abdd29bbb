"""Pictures of the teleoperation benchmark for docs/teleoperation.md."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from hc_estimator.kinds import DEFAULT_FILTER
from hc_evaluation.teleoperation.bench import run_case
from hc_evaluation.teleoperation.impedance import CONTROLLERS, run_controller
from hc_evaluation.teleoperation.scores import force_at_the_hand
from hc_sim_rig.bilateral import METHODS, layout

BLUE, ORANGE, GREEN, GREY = "#0072b2", "#d55e00", "#009e73", "0.4"
COLOURS = dict(zip(METHODS, ("#cc3311", "#ee9933", "#33998f", "#0072b2"), strict=True))
LABELS = {method: method.replace("_", " ") for method in METHODS}
SHOWN_ROUND_TRIP_MS = 300
PLAIN = {"Software": None}  # no version inside: the same picture, the same bytes


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
        figure.savefig(folder / f"{name}.png", dpi=90, metadata=PLAIN)


def _figure(width: float, height: float) -> Figure:
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def draw_methods(round_trip_ms: float = SHOWN_ROUND_TRIP_MS, seed: int = 0) -> Figure:
    """Position and force of all four methods at one delay."""
    figure = _figure(11.0, 9.5)
    axes = figure.subplots(len(METHODS), 2, sharex=True)
    for (left, right), method in zip(axes, METHODS, strict=True):
        filter = DEFAULT_FILTER if method == "model_mediated" else None
        series, scores = run_case(method, round_trip_ms, filter, seed)
        time = series.time_s
        left.plot(time, series.master_mm, color=ORANGE, lw=0.9, label="hand")
        left.plot(time, series.slave_mm, color=BLUE, lw=0.9, label="tool")
        left.axhline(series.settings.tissue.surface_mm, color=GREEN, lw=0.8, label="surface")
        word = "stable" if scores.stable else "UNSTABLE"
        left.set_title(f"{LABELS[method]}: {word}", fontsize=10, loc="left")
        left.set_ylabel("position [mm]")
        true = force_at_the_hand(series)
        right.plot(time, true, color=GREY, lw=1.6, label="what the tissue would answer the hand")
        right.plot(time, series.hand_force_n, color=ORANGE, lw=0.7, label="hand")
        right.set_ylabel("force [N]")
        right.set_title(
            f"error {scores.force_error_n:.2f} N, transparency {scores.transparency:.2f}, "
            f"peak in the tissue {scores.peak_force_n:.1f} N",
            fontsize=9,
            loc="left",
        )
        lump = series.task.presses[2]
        right.axvspan(series.task.first_presses[2].begin, lump.end, color=GREEN, alpha=0.12, lw=0)
        for axis in (left, right):
            axis.grid(alpha=0.3, linewidth=0.5)
            axis.tick_params(labelsize=8)
    handles = [line for axis in axes[0] for line in axis.get_legend_handles_labels()[0]]
    handles = [handle for handle in handles if handle is not axes[0, 0].lines[0]]
    names = [str(handle.get_label()) for handle in handles]
    figure.legend(handles, names, loc="outside lower center", ncols=4, fontsize=9)
    for axis in axes[-1]:
        axis.set_xlabel("time [s]")
    figure.suptitle(
        f"Round trip {round_trip_ms:g} ms, jitter, 10 % loss; the lump is under the green band",
        fontsize=11,
    )
    return figure


def draw_delays(result: Mapping[str, Any]) -> Figure:
    """Four scores over the delay; an open marker is an unstable loop."""
    figure = _figure(11.0, 6.2)
    axes = figure.subplots(2, 2, sharex=True)
    scores = (
        ("force_error_n", "force error at the hand [N]"),
        ("transparency", "transparency (1: the tissue itself)"),
        ("peak_force_n", "peak force in the tissue [N]"),
        ("lump_contrast", "lump's contrast at the hand (1: all)"),
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
            axis.plot(places, values, color=COLOURS[method], lw=1.2, label=LABELS[method])
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
        axis.set_ylabel(label, fontsize=9)
        axis.grid(alpha=0.3, linewidth=0.5)
        axis.tick_params(labelsize=8)
    axes[0, 0].legend(fontsize=8)
    for axis in axes[-1]:
        axis.set_xlabel("round trip [ms]")
    figure.suptitle("Filled: stable; open: unstable", fontsize=10)
    return figure


def draw_first_contact(round_trip_ms: float = SHOWN_ROUND_TRIP_MS, seed: int = 0) -> Figure:
    """First contact with model mediation: what the hand feels, the surface, the tank."""
    series, _ = run_case("model_mediated", round_trip_ms, DEFAULT_FILTER, seed)
    mask = (series.time_s > 1.5) & (series.time_s < 6.0)
    time = series.time_s[mask]
    figure = _figure(10.0, 7.0)
    position, force, tank = figure.subplots(3, 1, sharex=True)
    position.plot(time, series.master_mm[mask], color=ORANGE, label="hand")
    position.plot(time, series.slave_mm[mask], color=BLUE, label="tool")
    position.plot(time, series.model[mask, 4], color=GREY, ls="--", label="surface as rendered")
    position.axhline(series.settings.tissue.surface_mm, color=GREEN, lw=0.8, label="true surface")
    position.set_ylabel("position [mm]")
    force.plot(time, force_at_the_hand(series)[mask], color=GREY, label="what the tissue answers")
    force.plot(time, series.hand_force_n[mask], color=ORANGE, label="at the hand")
    force.plot(time, series.tissue_force_n[mask], color=BLUE, lw=0.8, label="at the tool")
    force.set_ylabel("force [N]")
    tank.plot(time, series.column(layout.OUT_TANK)[mask], color=GREEN, label="tank [mJ]")
    rate = series.column(layout.OUT_UPDATE_CHANGE)[mask] * series.settings.rate_hz
    tank.plot(time, 0.1 * rate, color=ORANGE, lw=0.6, label="change by updates [10 N/s]")
    tank.set_ylabel("energy budget, updates")
    tank.set_xlabel("time [s]")
    for axis in (position, force, tank):
        axis.grid(alpha=0.3, linewidth=0.5)
        axis.margins(y=0.2)
        axis.legend(fontsize=8, loc="upper right", ncols=4)
    figure.suptitle(f"First contact, model mediated, round trip {round_trip_ms:g} ms", fontsize=11)
    return figure


def draw_impedance(round_trip_ms: float = SHOWN_ROUND_TRIP_MS, seed: int = 0) -> Figure:
    """The slave's controller fixed and adaptive: force in the tissue, stiffness, stretch."""
    figure = _figure(11.0, 7.5)
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
        force.plot(time, series.tissue_force_n, color=colour, lw=0.9, label=label)
        stiffness.plot(time, series.column(layout.OUT_SLAVE_STIFFNESS), color=colour, lw=1.1)
        stretch.plot(
            time[late:], series.master_mm[: len(tool) - late] - tool[late:], color=colour, lw=0.8
        )
    force.set_ylabel("force in the tissue [N]")
    stiffness.set_ylabel("stiffness [N/mm]")
    stiffness.set_yscale("log")
    stretch.set_ylabel("command less tool [mm]")
    stretch.set_xlabel("time [s]")
    force.legend(fontsize=8, loc="upper right")
    for axis in (force, stiffness, stretch):
        axis.grid(alpha=0.3, linewidth=0.5)
    figure.suptitle(
        f"The slave's controller, model mediated, round trip {round_trip_ms:g} ms", fontsize=11
    )
    return figure
