"""The picture of a run: force, the four parameters with their uncertainty, consistency."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.lib.recfunctions import repack_fields

from hc_bringup.cut_time import cut_gaps
from hc_bringup.picture_cuts import show_cuts
from hc_bringup.run_data import Array, RunData
from hc_estimator import PARAMETER_NAMES
from hc_evaluation.gaps import GAP_STEPS
from hc_sim_rig.picture_style import (
    ALARM,
    BAND,
    ESTIMATED,
    LINE,
    MEASURED,
    THICK,
    THIN,
    TRUE,
    in_style,
    legend_below,
    new_figure,
    say_cut,
)

_LABELS = ("K  [N/mmⁿ]", "B  [N (s/mm)ᵖ/mmⁿ]", "n", "p")
_MOST_POINTS = 4000
_SETTLED_SHARE = 0.2
_LARGEST = 1e100
"""Beyond it a number is left out of the picture as NaN is: matplotlib cannot scale its axes."""
_DRAWN = (
    *PARAMETER_NAMES,
    *(f"{name}_std" for name in PARAMETER_NAMES),
    "force_predicted",
    "nis",
    "innovation_displacement",
    "innovation_force",
    "change_detected",
    "model_mismatch",
    "rejected",
)
"""Of the estimates, what the picture shows."""


@in_style
def draw(data: RunData) -> Figure:
    """Return the picture of a run: displacement, force, error, NIS on the left, K B n p right.

    Whatever the numbers are, NaN, infinite or absurd, there is a picture.
    """
    data = _drawable(data)
    cut = cut_gaps(data.time_s)
    data = dataclasses.replace(data, time_s=cut.drawn_s)
    figure = new_figure(7.4, width=11.0)
    # The name of a file may hold any bytes, and a $ in it begins no formula.
    title = data.title.encode("utf-8", "replace").decode()
    figure.suptitle(title, parse_math=False)
    grid = figure.subplots(4, 2, sharex=True)
    step = max(1, len(data.time_s) // _MOST_POINTS)
    part = slice(None, None, step)
    time = data.time_s[part]
    _displacement(grid[0, 0], data)
    _force(grid[1, 0], data, part)
    _error(grid[2, 0], data)
    _consistency(grid[3, 0], data)
    for index in range(4):
        _parameter(grid[index, 1], data, part, index)
    for axes in grid.flat:
        say_cut(axes)
        axes.margins(x=0.0)
        for at in data.time_s[data.change_detected]:
            axes.axvline(at, color=ALARM, linewidth=THIN)
    for axes in grid[3]:
        axes.set_xlabel("time [s]")
    show_cuts(grid, cut)
    if data.model_mismatch.any():
        for axes in grid.flat:
            axes.fill_between(
                time,
                0.0,
                1.0,
                where=data.model_mismatch[part],
                transform=axes.get_xaxis_transform(),
                color=ALARM,
                alpha=0.08,
                linewidth=0.0,
            )
    _explain_colours(figure, data)
    return figure


def _drawable(data: RunData) -> RunData:
    """Return the run with NaN for every number that cannot be drawn."""

    def plain(values: Array) -> Array:
        return np.where(np.abs(values) < _LARGEST, values, np.nan)

    estimates = repack_fields(data.estimates[list(_DRAWN)])
    for name in _DRAWN:
        if estimates[name].dtype.kind == "f":
            estimates[name] = plain(estimates[name])
    return dataclasses.replace(
        data,
        time_s=plain(data.time_s),
        displacement_mm=plain(data.displacement_mm),
        force_n=plain(data.force_n),
        truth=None if data.truth is None else plain(data.truth),
        estimates=estimates,
    )


def _scale(axes: Any, low: float, high: float) -> None:
    """Set the limits of the vertical axis, if there are any."""
    if math.isfinite(low) and math.isfinite(high) and low < high:
        axes.set_ylim(low, high)


def _lowest(values: Array) -> float:
    known = values[np.isfinite(values)]
    return float(known.min()) if len(known) else math.nan


def _highest(values: Array) -> float:
    return -_lowest(-values)


def _explain_colours(figure: Figure, data: RunData) -> None:
    """Put one legend below all panels, where it covers nothing."""
    handles = [
        Line2D([], [], color=MEASURED, linewidth=THICK, label="measured"),
        Line2D([], [], color=ESTIMATED, label="estimate; force: one step ahead"),
        Patch(color=ESTIMATED, alpha=BAND, label="± 2 standard deviations"),
        Line2D(
            [],
            [],
            color=TRUE,
            linestyle="--",
            label="ideal NIS" if data.truth is None else "true; NIS: ideal",
        ),
    ]
    if data.change_detected.any():
        handles.append(Line2D([], [], color=ALARM, label="change of the tissue detected"))
    if data.model_mismatch.any():
        handles.append(Patch(color=ALARM, alpha=0.08, label="contact law does not fit"))
    legend_below(figure, handles, [str(handle.get_label()) for handle in handles], ncols=4)


def _broken(time: Array, *curves: Array) -> tuple[Array, ...]:
    """Return times and curves with a NaN in every gap: no line is drawn where nothing was read."""
    steps = np.diff(time)
    usual = float(np.median(steps)) if len(steps) else math.nan
    after = np.flatnonzero(steps > GAP_STEPS * usual) + 1
    return np.insert(time, after, time[after]), *(
        np.insert(curve, after, math.nan) for curve in curves
    )


def _curve(axes: Any, time: Array, values: Array, colour: str, width: float) -> None:
    """Draw readings as a line through those that are there."""
    known = np.flatnonzero(np.isfinite(values))
    known = known[:: max(1, len(known) // _MOST_POINTS)]
    axes.plot(*_broken(time[known], values[known]), color=colour, linewidth=width)


def _displacement(axes: Any, data: RunData) -> None:
    _curve(axes, data.time_s, data.displacement_mm, MEASURED, LINE)
    axes.set_ylabel("displacement [mm]")


def _force(axes: Any, data: RunData, part: slice) -> None:
    time = data.time_s[part]
    _curve(axes, data.time_s, data.force_n, MEASURED, THICK)
    axes.plot(*_broken(time, data.force_predicted_n[part]), color=ESTIMATED, linewidth=THIN)
    low, high = _lowest(data.force_n), _highest(data.force_n)
    margin = 0.1 * max(high - low, 1e-6)
    _scale(axes, low - margin, high + margin)
    axes.set_ylabel("force [N]")


def _error(axes: Any, data: RunData) -> None:
    # As in the figures: what a saturated sensor says is no error of the filter.
    error = np.where(data.used, data.force_n - data.force_predicted_n, np.nan)
    settled = error[int(_SETTLED_SHARE * len(error)) :]
    _curve(axes, data.time_s, 1e3 * error, ESTIMATED, THIN)
    settled = settled[np.isfinite(settled)]
    limit = 1e3 * float(np.percentile(np.abs(settled), 99.5)) if len(settled) else 1.0
    _scale(axes, -1.5 * limit, 1.5 * limit)
    axes.set_ylabel("force error\none step ahead [mN]")


def _consistency(axes: Any, data: RunData) -> None:
    """NIS averaged over a hundredth of the run, against its ideal."""
    width = max(1, len(data.nis) // 100)
    count = len(data.nis) // width * width
    blocks = data.nis[:count].reshape(-1, width)
    known = np.isfinite(blocks)
    mean = np.where(known, blocks, 0.0).sum(axis=1) / np.maximum(known.sum(axis=1), 1)
    axes.plot(*_broken(data.time_s[:count:width], mean), color=ESTIMATED, linewidth=LINE)
    axes.axhline(2.0, color=TRUE, linewidth=LINE, linestyle="--")
    _scale(axes, 0.0, max(5.0, 1.2 * float(np.percentile(mean, 90))) if len(mean) else 5.0)
    axes.set_ylabel("NIS, averaged")


def _parameter(axes: Any, data: RunData, part: slice, index: int) -> None:
    time, value, deviation = _broken(
        data.time_s[part], data.parameters[part, index], data.parameters_std[part, index]
    )
    axes.fill_between(
        time,
        value - 2.0 * deviation,
        value + 2.0 * deviation,
        color=ESTIMATED,
        alpha=BAND,
        linewidth=0.0,
    )
    axes.plot(time, value, color=ESTIMATED, linewidth=LINE)
    settled = data.parameters[int(_SETTLED_SHARE * len(data.parameters)) :, index]
    spread = data.parameters_std[int(_SETTLED_SHARE * len(data.parameters_std)) :, index]
    low, high = _lowest(settled - 3 * spread), _highest(settled + 3 * spread)
    if data.truth is not None:
        axes.plot(*_broken(data.time_s[part], data.truth[part, index]), color=TRUE, linestyle="--")
        low = min(low, _lowest(data.truth[:, index]))
        high = max(high, _highest(data.truth[:, index]))
    margin = 0.15 * max(high - low, 1e-3 * abs(high), 1e-12)
    _scale(axes, max(0.0, low - margin), high + margin)  # none of the four can be negative
    axes.set_ylabel(_LABELS[index])
