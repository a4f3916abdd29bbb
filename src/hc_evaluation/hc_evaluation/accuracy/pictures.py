"""Pictures of the accuracy experiments for the documents."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from hc_evaluation.accuracy import catalogue
from hc_evaluation.accuracy.measure import Setup
from hc_evaluation.accuracy.recordings import (
    RECORDINGS,
    batch_fit,
    contact_start,
    data_folder,
    load,
    smoothed,
)
from hc_evaluation.accuracy.scenarios import simulate
from hc_evaluation.hold_forward import Frozen, hold_forward_errors
from hc_sim_rig.picture_style import (
    ALARM,
    BAND,
    BLUE,
    GREEN,
    GREY,
    MEASURED,
    ORANGE,
    PURPLE,
    THIN,
    TRUE,
    in_style,
    legend_above,
    legend_below,
    new_figure,
    save,
    say_cut,
)

LABELS = ("K [N/mmⁿ]", "B\n[N(s/mm)ᵖ/mmⁿ]", "n", "p")


def _dots(axis: Axes, values: Any, places: Any, limits: tuple[float, float], **look: Any) -> None:
    """Draw dots; one beyond the limits is an arrow at the edge, with its value beside it."""
    low, high = limits
    for value, place in zip(np.asarray(values, dtype=np.float64), places, strict=True):
        if low <= value <= high:
            continue
        right = value > high
        axis.plot(high if right else low, place, ">" if right else "<", clip_on=False, **look)
        axis.annotate(
            f"{value:.3g}",
            (high if right else low, place),
            xytext=(-6 if right else 6, 0),
            textcoords="offset points",
            ha="right" if right else "left",
            va="center",
            fontsize=7.5,
        )
    inside = np.clip(values, low, high) == values
    axis.plot(np.where(inside, values, np.nan), places, "o", **look)
    axis.set_xlim(low, high)


@in_style
def picture_consistency(result: Mapping[str, Any], folder: Path) -> Path:
    """Errors over the bound, NEES and NIS of every simulated tissue, with the ranges asked for."""
    rows = result["experiments"]["tissues"]["rows"]
    names = [row["scenario"] for row in rows]
    places = np.arange(len(names))
    figure = new_figure(4.6)
    axes = figure.subplots(1, 3, sharey=True, width_ratios=(1.6, 1, 1))
    for i, (letter, colour) in enumerate(
        zip(("K", "B", "n", "p"), (BLUE, ORANGE, GREEN, PURPLE), strict=True)
    ):
        values = [row["ratio"][i] for row in rows]
        axes[0].plot([], [], "o", color=colour, label=letter)
        _dots(axes[0], values, places + 0.16 * (i - 1.5), (0.0, 2.0), color=colour)
    axes[0].axvspan(0.0, 1.5, color=GREEN, alpha=0.1)
    axes[0].axvline(1.0, color=GREY, lw=THIN)
    axes[0].set(xlabel="RMS error / Cramér-Rao bound", yticks=places)
    axes[0].set_yticklabels(names)
    axes[0].invert_yaxis()
    legend_above(axes[0], 4)
    for axis, key, low, ideal, high, limits in (
        (axes[1], "nees", 2.5, 4.0, 6.0, (0.0, 8.0)),
        (axes[2], "nis", 1.6, 2.0, 2.4, (1.2, 2.8)),
    ):
        axis.axvspan(low, high, color=GREEN, alpha=0.1)
        axis.axvline(ideal, color=GREY, lw=THIN)
        _dots(axis, [row[key] for row in rows], places, limits, color=BLUE)
        axis.set(xlabel=f"mean {key.upper()}")
    return save(figure, folder / "accuracy_consistency.png")


def _band(axis: Axes, time: Any, value: Any, deviation: Any, true: Any) -> None:
    axis.fill_between(
        time, value - 2.0 * deviation, value + 2.0 * deviation, color=BLUE, alpha=BAND, lw=0
    )
    axis.plot(time, value, color=BLUE, label="estimate ± 2 std")
    axis.plot(time, true, color=TRUE, ls="--", label="truth")


def _say_beyond(axis: Axes, time: Any, value: Any, limit: float) -> None:
    """Say how far a curve leaves its frame, which would show a part of it only."""
    beyond = value > limit
    if np.any(beyond):
        first, last = (f"{instant:.1f} s" for instant in time[beyond][[0, -1]])
        when = f"at {first}" if first == last else f"between {first} and {last}"
        axis.text(
            1.0,
            1.03,  # above the frame, which curves may fill
            f"up to {np.max(value):.3g} {when}",
            transform=axis.transAxes,
            ha="right",
            va="bottom",
        )


@in_style
def picture_change(setup: Setup, folder: Path) -> Path:
    """Parameters and NIS while the force noise jumps fourfold, and later the tissue changes."""
    scenario = replace(
        catalogue.CHANGES[0],
        changes=((8.0, catalogue.CHANGES[0].changes[0][1]),),
        noise_jumps=((4.0, 1.0, 4.0),),
        duration_s=12.0,
    )
    contact = simulate(scenario, 100_000)
    series = setup.create().run(contact.time_s, contact.displacement_mm, contact.force_n)
    time = contact.time_s
    figure = new_figure(7.6)
    axes = figure.subplots(6, 1, sharex=True)
    axes[0].plot(time, contact.force_n, color=MEASURED, lw=THIN)
    axes[0].set_ylabel("force [N]")
    limits = ((0.0, 0.8), (0.0, 0.12), (1.2, 2.2), (0.85, 1.25))
    for i in range(4):
        _band(
            axes[1 + i],
            time,
            series.parameters[:, i],
            series.parameters_std[:, i],
            contact.parameters[:, i],
        )
        axes[1 + i].set(ylabel=LABELS[i], ylim=limits[i])
        say_cut(axes[1 + i])
    legend_above(axes[1], 2)
    kernel = np.ones(200) / 200.0
    axes[5].plot(time, np.convolve(series.nis, kernel, "same"), color=BLUE)
    axes[5].axhspan(1.6, 2.4, color=GREEN, alpha=0.15)
    axes[5].set(ylabel="NIS, 0.2 s mean", ylim=(0, 6), xlabel="time [s]")
    for axis in axes:
        axis.axvline(4.0, color=GREY, ls=":")
        axis.axvline(8.0, color=GREY, ls=":")
        for instant in time[series.change_detected]:
            axis.axvline(instant, color=ALARM, lw=THIN)
    axes[0].set_title("force noise x 4 at 4 s; other tissue at 8 s (purple line: change called)")
    return save(figure, folder / "accuracy_change.png")


@in_style
def picture_recordings(setup: Setup, folder: Path) -> Path | None:
    """Held-forward force error over time on the palpation recordings; None without them."""
    data = data_folder()
    if data is None:
        return None
    chosen = [r for r in RECORDINGS if r.palpation and r.model_fits]
    figure = new_figure(8.0)
    axes = figure.subplots(len(chosen), 2, sharex="col")
    for (left, right), recording in zip(axes, chosen, strict=True):
        time, displacement, force = load(data, recording)
        smooth, velocity = smoothed(time, displacement)
        fit = batch_fit(smooth, velocity, force)
        series = setup.create().run(time, displacement, force)
        start = 1.5 + contact_start(time, force)
        origins, errors = hold_forward_errors(
            time, smooth, velocity, force, Frozen.of(series), start_s=start
        )
        _, floor = hold_forward_errors(time, smooth, velocity, force, fit.parameters, start_s=start)
        left.plot(origins, errors, color=BLUE, label="estimate held")
        left.plot(origins, floor, color=ORANGE, ls="--", label="least squares over all")
        left.plot(time, series.force_noise_std, color=GREY, lw=THIN, label="noise and model error")
        left.set(yscale="log", ylabel="error [N]")
        left.set_title(recording.name)
        _band(
            right,
            time,
            series.parameters[:, 0],
            series.parameters_std[:, 0],
            np.full(time.size, fit.parameters[0]),
        )
        right.set(ylabel=LABELS[0], ylim=(0, 2.0 * fit.parameters[0]))
        _say_beyond(right, time, series.parameters[:, 0], 2.0 * fit.parameters[0])
        say_cut(right)
    legend_below(figure, *axes[0][0].get_legend_handles_labels(), ncols=3)
    axes[-1][0].set_xlabel("time [s], error over the next 0.5 s")
    axes[-1][1].set_xlabel("time [s]")
    return save(figure, folder / "accuracy_recordings.png")


def write_pictures(result: Mapping[str, Any], folder: Path) -> list[Path]:
    """Write all pictures that the result and the recordings allow.

    Args:
        result: what `run.run_accuracy` returned.
        folder: folder for the PNG files; must exist.

    Returns:
        Files written.
    """
    setup = Setup(result["filter"], result["parameters"])
    written = []
    if result["experiments"].get("tissues", {}).get("rows"):
        written.append(picture_consistency(result, folder))
    written.append(picture_change(setup, folder))
    recordings = picture_recordings(setup, folder)
    if recordings is not None:
        written.append(recordings)
    return written
