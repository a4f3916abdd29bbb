"""How every picture of the suite looks: one set of colours, type sizes and line widths.

Here because it is the lowest package that draws. Sizes are such that a picture can be read at half
its size. Colours are those of Okabe and Ito (2008), which people who do not see all colours tell
apart. What a colour means is the same in every picture, and on the live page.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from cycler import cycler
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

BLUE, ORANGE, GREEN, PURPLE = "#0072b2", "#d55e00", "#009e73", "#aa4499"
SKY, YELLOW, GREY, BLACK = "#56b4e9", "#e69f00", "#777777", "#222222"
ESTIMATED, TRUE, MEASURED, ALARM = BLUE, ORANGE, GREY, PURPLE
SEVERAL = (BLUE, ORANGE, GREEN, PURPLE, YELLOW, SKY)
"""Of curves that are alike: methods, rates, parameters."""

THIN, LINE, THICK = 0.7, 1.2, 2.2
"""Widths of dense or secondary curves, of curves, and of those that lie below another [points]."""
BAND = 0.25
"""Opacity of two standard deviations around an estimate."""
WIDTH = 8.0
"""Of every picture [inches]."""
DPI = 140

STYLE: Any = {  # as matplotlib.rcParams
    "font.size": 9.0,
    "figure.titlesize": 10.0,
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
    "axes.labelsize": 9.0,
    "axes.linewidth": 0.7,
    "axes.grid": True,
    "axes.prop_cycle": cycler(color=SEVERAL),
    "axes.axisbelow": True,
    "grid.alpha": 0.3,
    "grid.linewidth": 0.5,
    "xtick.labelsize": 8.5,
    "ytick.labelsize": 8.5,
    "legend.fontsize": 8.5,
    "legend.frameon": False,
    "legend.handlelength": 1.6,
    "legend.columnspacing": 1.2,
    "lines.linewidth": LINE,
}
in_style = mpl.rc_context(STYLE)
"""Decorates what draws: `@in_style`."""


def new_figure(height: float, width: float = WIDTH) -> Figure:
    """An empty picture of that many inches, whose parts make room for each other."""
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def legend_above(axes: Any, ncols: int) -> None:
    """Put the legend above the frame, at its right end, where no data are."""
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=ncols, borderaxespad=0.1)


def legend_below(figure: Figure, *labelled: Any, ncols: int) -> None:
    """Put one legend below all frames; arguments as those of `Figure.legend`."""
    figure.legend(*labelled, loc="outside lower center", ncols=ncols)


def say_cut(axes: Any) -> None:
    """Say beside the frame if a curve or a band leaves it: call it when all is drawn."""
    low, high = axes.get_ylim()
    drawn = [np.asarray(line.get_ydata(), dtype=np.float64) for line in axes.get_lines()]
    drawn += [path.vertices[:, 1] for band in axes.collections for path in band.get_paths()]
    if any(np.any((values < low) | (values > high)) for values in drawn):
        axes.text(
            1.008, 0.5, "cut curves go on", transform=axes.transAxes, rotation=90,
            va="center", ha="left", fontsize=7.5, color=GREY,
        )  # fmt: skip


def save(figure: Figure, path: Path) -> Path:
    """Write a picture: the same one has the same bytes, for no version stands inside."""
    plain = {"Software": None} if path.suffix == ".png" else None
    figure.savefig(path, dpi=DPI, metadata=plain)
    return path
