"""Pictures like the papers', for the first seed: paper setting above, practical and ours below."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from hc_evaluation.reproduction.experiment import (
    FIRST_SEED,
    Column,
    Experiment,
    load_experiment,
)
from hc_evaluation.reproduction.published import unit_of
from hc_evaluation.reproduction.signals import Signal, make_signal
from hc_evaluation.reproduction.trace import Trace, run_column
from hc_sim_rig.picture_style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    LINE,
    ORANGE,
    PURPLE,
    SKY,
    THICK,
    THIN,
    YELLOW,
    in_style,
    legend_above,
    new_figure,
    save,
    say_cut,
)

FloatArray = NDArray[np.float64]
Traces = Mapping[str, Trace]

COLOURS = (GREY, ORANGE, GREEN)  # in the order of an experiment's published filters
OURS_COLOURS = (BLUE, YELLOW, SKY)
TRUTH_COLOUR = BLACK  # orange is one of several filters here
POINTS = 4000  # more are thinned out, keeping extremes
MARGIN = 1.15
NOISE_FRAME = 2.0  # of the true noise
LEAVES = 6.0  # a curve so many times larger than the calmest one is cut at the frame


def _shown(columns: list[Column], setting: str) -> list[Column]:
    return [c for c in columns if c.setting == setting]


def _colour(experiment: Experiment, column: Column) -> str:
    if column.setting == "ours":
        names = [c.name for c in experiment.columns if c.setting == "ours"]
        return OURS_COLOURS[names.index(column.name) % len(OURS_COLOURS)]
    names = list(dict.fromkeys(c.published for c in experiment.columns if c.published))
    return COLOURS[names.index(column.published) % len(COLOURS)]


def _thinned(time: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Smallest and largest value of each stretch, so that no peak is lost."""
    if time.size <= POINTS:
        return time, values
    stretch = -(-2 * time.size // POINTS)
    count = time.size // stretch
    block = values[: count * stretch].reshape(count, stretch)
    finite = np.nan_to_num(block, nan=0.0)
    rows = np.arange(count)
    pair = np.sort(np.stack([finite.argmin(axis=1), finite.argmax(axis=1)]), axis=0)
    times = np.stack([time[rows * stretch + p] for p in pair], axis=1).ravel()
    return times, np.stack([block[rows, p] for p in pair], axis=1).ravel()


def _plot(
    axes: Axes, time: FloatArray, values: FloatArray, colour: str, label: str, **style: Any
) -> None:
    with np.errstate(all="ignore"):
        limited = np.clip(values, -1e9, 1e9)
    axes.plot(*_thinned(time, limited), color=colour, label=label, **({"linewidth": THIN} | style))


def _frame(axes: Axes, curves: list[FloatArray], low_zero: bool) -> None:
    """Limit the axis to what the calmer curves need; wild ones leave the picture."""
    peaks = []
    for curve in curves:
        finite = curve[np.isfinite(curve)]
        peaks.append(float(np.max(np.abs(finite))) if finite.size else np.inf)
    calm = min(peaks)
    shown = [p for p in peaks if p <= LEAVES * calm]
    top = MARGIN * max(shown) if shown and max(shown) > 0.0 else 1.0
    axes.set_ylim(0.0 if low_zero else -top, top)


def _rows(figure: Figure, experiment: Experiment) -> list[tuple[Axes, list[Column], str]]:
    columns = list(experiment.columns)
    groups = [
        (_shown(columns, "paper"), "as printed (paper)"),
        (_shown(columns, "practical") + _shown(columns, "ours"), "practical, and our estimators"),
    ]
    axes = figure.subplots(2, 1, sharex=True)
    result = []
    for panel, (group, title) in zip(axes, groups, strict=True):
        panel.set_title(title)
        result.append((panel, group, title))
    return result


def _finish(rows: list[tuple[Axes, list[Column], str]], xlabel: str, ylabel: str) -> None:
    for panel, _, _ in rows:
        panel.set_ylabel(ylabel)
        legend_above(panel, 3)
        say_cut(panel)
    rows[-1][0].set_xlabel(xlabel)


def _size(curve: FloatArray) -> float:
    """Median size of a curve: the larger, the further behind it is drawn."""
    with np.errstate(all="ignore"):
        size = float(np.median(np.abs(curve)))
    return size if np.isfinite(size) else np.inf


def _draw_force_error(
    figure: Figure, experiment: Experiment, signal: Signal, traces: Traces, _: Mapping[str, Any]
) -> None:
    unit, scale = unit_of(experiment.published)
    rows = _rows(figure, experiment)
    for panel, group, _title in rows:
        curves = []
        for number, column in enumerate(group):
            error = scale * (traces[column.name].force - signal.true_force)
            curves.append(error)
            colour, order = _colour(experiment, column), 2.0 + 1.0 / (1.0 + _size(error))
            # As printed two filters may give one and the same curve: the first shows below.
            width = THICK if number == 0 and column.setting == "paper" else THIN
            style = {"zorder": 1.9 if width > 1.0 else order, "linewidth": width}
            _plot(panel, signal.time_s, error, colour, column.name, **style)
        _frame(panel, curves, False)
    _finish(rows, "time [s]", f"force error [{unit}]")


def _draw_noise(
    figure: Figure, experiment: Experiment, signal: Signal, traces: Traces, _: Mapping[str, Any]
) -> None:
    rows = _rows(figure, experiment)
    for panel, group, _title in rows:
        curves = [signal.force_noise_std]
        for column in group:
            noise = traces[column.name].noise_std
            curves.append(noise)
            _plot(panel, signal.time_s, noise, _colour(experiment, column), column.name)
        _plot(panel, signal.time_s, signal.force_noise_std, TRUTH_COLOUR, "truth", linestyle="--")
        _frame(panel, curves, True)
        panel.set_ylim(0.0, NOISE_FRAME * float(np.max(signal.force_noise_std)))
    _finish(rows, "time [s]", "estimated noise [N]")


def _draw_reconstructed(
    figure: Figure, experiment: Experiment, signal: Signal, traces: Traces, _: Mapping[str, Any]
) -> None:
    needle = not np.any(np.isfinite(signal.parameters))
    abscissa = signal.true_displacement if needle else signal.time_s
    rows = _rows(figure, experiment)
    for panel, group, _title in rows:
        for column in group:
            force = traces[column.name].force
            _plot(panel, abscissa, force, _colour(experiment, column), column.name)
        _plot(panel, abscissa, signal.true_force, TRUTH_COLOUR, "true force", linestyle="--")
        top = float(np.max(signal.true_force))
        panel.set_ylim(-0.25 * top, 1.4 * top)
    _finish(rows, "displacement [mm]" if needle else "time [s]", "force [N]")


def _draw_weighting(
    figure: Figure, experiment: Experiment, signal: Signal, traces: Traces, _: Mapping[str, Any]
) -> None:
    """Weights of the window and of the past (Eq. 26 and 27), with the changes that were called."""
    axes = figure.subplots(2, 1, sharex=True)
    column = next(c for c in experiment.columns if c.name == "modified weight, practical")
    standard = 1.0 / np.arange(1, signal.time_s.size + 1)
    weight = np.empty_like(standard)
    count = 0
    for k, called in enumerate(traces[column.name].changes):
        count = 1 if called else count + 1
        weight[k] = 1.0 / count
    for panel, values, title in (
        (axes[0], standard, "standard weight (Eq. 26)"),
        (axes[1], weight, "modified weight (Eq. 27), with the changes that our detector calls"),
    ):
        panel.plot(signal.time_s, values, color=TRUTH_COLOUR, label="window", linewidth=LINE)
        panel.plot(
            signal.time_s,
            1.0 - values,
            color=COLOURS[1],
            label="past",
            linewidth=LINE,
            linestyle="--",
        )
        panel.axvline(signal.jump_s, color=GREY, linewidth=THIN)
        panel.set_title(title)
        panel.set_ylabel("weight")
        legend_above(panel, 2)
    axes[1].set_xlabel("time [s]")


def _draw_environment(
    figure: Figure,
    experiment: Experiment,
    signal: Signal,
    traces: Traces,
    settings: Mapping[str, Any],
) -> None:
    """Position, velocity and force of the slave as one filter of paper C sees them."""
    axes = figure.subplots(4, 1, sharex=True)
    columns = [c for c in experiment.columns if c.published == settings["column"]]
    styles = {"paper": ORANGE, "practical": BLUE}
    quantities = (
        ("position [cm]", 0.1 * (signal.rig["slave_position"]), "displacement", 0.1, 1.5),
        ("velocity [cm/s]", 0.1 * signal.true_velocity, "velocity", 0.1, 0.0),
        ("force [N]", signal.true_force, "force", 1.0, 0.0),
    )
    for panel, (label, truth, name, scale, offset) in zip(axes, quantities, strict=False):
        for column in columns:
            values = offset + scale * getattr(traces[column.name], name)
            _plot(panel, signal.time_s, values, styles[column.setting], column.name)
        _plot(panel, signal.time_s, truth, TRUTH_COLOUR, "true", linestyle="--")
        panel.set_ylabel(label)
    legend_above(axes[0], 3)
    effort = axes[3]
    _plot(effort, signal.time_s, signal.rig["slave_effort"], GREEN, "slave")
    _plot(effort, signal.time_s, signal.rig["master_effort"], PURPLE, "master")
    effort.set_ylabel("control [N]")
    legend_above(effort, 2)
    effort.set_xlabel("time [s]")


def _draw_tracking(
    figure: Figure,
    experiment: Experiment,
    signal: Signal,
    traces: Traces,
    settings: Mapping[str, Any],
) -> None:
    """Position tracking and force reflection of the teleoperation."""
    axes = figure.subplots(2, 1, sharex=True)
    rig = signal.rig
    _plot(axes[0], signal.time_s, 0.1 * rig["master_position"], PURPLE, "master (scaled)")
    _plot(axes[0], signal.time_s, 0.1 * rig["command"], GREY, "as the slave receives it")
    _plot(axes[0], signal.time_s, 0.1 * rig["slave_position"], GREEN, "slave")
    for column in experiment.columns:
        if column.published == settings["column"] and column.setting == "practical":
            estimate = 1.5 + 0.1 * traces[column.name].displacement
            _plot(axes[0], signal.time_s, estimate, BLUE, f"slave, {column.name}", linestyle=":")
            _plot(
                axes[1],
                signal.time_s,
                traces[column.name].force,
                BLUE,
                f"force, {column.name}",
            )
    _plot(axes[1], signal.time_s, signal.true_force, GREEN, "contact force")
    _plot(axes[1], signal.time_s, rig["feedback_force"], PURPLE, "as the master receives it")
    _plot(axes[1], signal.time_s, rig["operator_force"], GREY, "operator")
    axes[0].set_ylabel("position [cm]")
    axes[1].set_ylabel("force [N]")
    axes[1].set_xlabel("time [s]")
    for panel in axes:
        legend_above(panel, 4)


Drawer = Callable[[Figure, Experiment, Signal, Traces, Mapping[str, Any]], None]

KINDS: Mapping[str, Drawer] = {
    "force_error": _draw_force_error,
    "noise": _draw_noise,
    "reconstructed": _draw_reconstructed,
    "weighting": _draw_weighting,
    "environment": _draw_environment,
    "tracking": _draw_tracking,
}


def picture_name(name: str, covers: str) -> str:
    """File name of a picture of an experiment."""
    return f"reproduction_{name[0]}_{covers.replace(' ', '_')}.png"


@in_style
def draw(name: str, folder: Path) -> list[Path]:
    """Draw all pictures of an experiment.

    Args:
        name: the experiment.
        folder: where the PNG files go.

    Returns:
        The files.
    """
    experiment = load_experiment(name)
    signal = make_signal(experiment.signal, FIRST_SEED)
    traces = {c.name: run_column(c, signal, experiment.signal) for c in experiment.columns}
    files = []
    for settings in experiment.pictures:
        figure = new_figure(5.4)
        figure.suptitle(
            f"Paper {experiment.paper}, {settings['covers']}: {experiment.title.split(' (')[0]}"
        )
        KINDS[str(settings["kind"])](figure, experiment, signal, traces, settings)
        files.append(save(figure, folder / picture_name(name, str(settings["covers"]))))
    return files
