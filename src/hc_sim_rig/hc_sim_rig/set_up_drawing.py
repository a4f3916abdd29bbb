"""Drawing of the set-up: robot, force sensor, tool and tissue, with coordinates and signs."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Polygon, Rectangle

from hc_sim_rig.picture_style import BLACK, BLUE, GREEN, GREY, LINE, ORANGE, in_style, new_figure

SURFACE = 3.0  # height of the undeformed tissue, in units of the drawing
DEPTH = 1.1
TIP_RADIUS = 0.35


@in_style
def draw_set_up() -> Figure:
    """Return the drawing: left free of contact (d <= 0), right in contact (d > 0)."""
    figure = new_figure(4.3)
    figure.set_layout_engine("none")
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_xlim(0.0, 16.0)
    axes.set_ylim(0.0, 8.6)
    axes.axis("off")
    _draw_side(axes, 4.0, SURFACE + 0.9)
    _draw_side(axes, 11.6, SURFACE - DEPTH)
    _label_free(axes, 4.0)
    _label_contact(axes, 11.6)
    return figure


def _draw_side(axes: Any, centre: float, tip: float) -> None:
    """Tissue with the tool's dent, tool, sensor and the robot's last link."""
    x = np.linspace(centre - 3.4, centre + 3.4, 200)
    away = np.maximum(np.abs(x - centre) - TIP_RADIUS, 0.0)
    surface = SURFACE - max(SURFACE - tip, 0.0) * np.exp(-away / 0.8)
    outline = np.column_stack([np.r_[x, x[-1], x[0]], np.r_[surface, 0.4, 0.4]])
    axes.add_patch(Polygon(outline, fc="#f6dcd0", ec=ORANGE, lw=LINE))
    axes.text(centre - 3.2, 0.6, "tissue", va="bottom")
    box: Any = {"ec": BLACK, "lw": LINE}
    axes.add_patch(Rectangle((centre - TIP_RADIUS, tip), 2 * TIP_RADIUS, 1.9, fc="#dddddd", **box))
    axes.add_patch(Rectangle((centre - 0.7, tip + 1.9), 1.4, 0.7, fc="#cfe3f3", **box))
    axes.add_patch(Rectangle((centre - 0.95, tip + 2.6), 1.9, 0.9, fc="#eeeeee", **box))
    for height, name in ((1.5, "tool"), (2.25, "force sensor"), (3.05, "robot")):
        axes.text(centre + 1.15, tip + height, name, va="center")


def _arrow(axes: Any, start: tuple[float, float], end: tuple[float, float], colour: str) -> None:
    arrow = {"arrowstyle": "-|>", "color": colour, "lw": 1.6, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", end, start, arrowprops=arrow)


def _label_free(axes: Any, centre: float) -> None:
    axes.text(centre, 8.1, "free motion: d ≤ 0, F = 0", ha="center", fontweight="bold")
    left = centre - 2.9
    _arrow(axes, (left, SURFACE + 2.3), (left, SURFACE - 1.5), BLUE)
    axes.text(left + 0.2, SURFACE - 1.5, "d [mm], into the tissue", color=BLUE, va="center")
    axes.plot([left - 0.2, left + 0.2], [SURFACE, SURFACE], color=BLUE, lw=LINE)
    axes.text(left - 0.3, SURFACE + 0.1, "0", color=BLUE, ha="right")
    axes.text(left + 0.2, SURFACE + 0.12, "surface", color=GREEN, va="bottom")
    _arrow(axes, (centre + 1.1, SURFACE + 0.5), (centre + 2.5, SURFACE + 0.5), BLUE)
    axes.text(centre + 1.1, SURFACE + 0.7, "sideways [mm]", color=BLUE)


def _label_contact(axes: Any, centre: float) -> None:
    axes.text(
        centre, 8.1, "contact: d > 0, F = K dⁿ + B dⁿ sign(v)|v|ᵖ", ha="center", fontweight="bold"
    )
    tip = SURFACE - DEPTH
    axes.plot([centre - 3.4, centre + 3.4], [SURFACE, SURFACE], color=GREY, lw=LINE, ls=":")
    left = centre - 1.35
    _arrow(axes, (left, SURFACE), (left, tip), BLUE)
    axes.plot([left - 0.15, centre - TIP_RADIUS], [tip, tip], color=BLUE, lw=0.7)
    axes.text(left - 0.15, 0.5 * (SURFACE + tip), "d", color=BLUE, ha="right", va="center")
    _arrow(axes, (centre - 1.35, tip + 3.3), (centre - 1.35, tip + 2.2), BLUE)
    axes.text(centre - 1.5, tip + 2.75, "v > 0\npressing", color=BLUE, ha="right", va="center")
    _arrow(axes, (centre, tip - 1.35), (centre, tip - 0.05), GREEN)
    axes.text(
        centre + 0.2, tip - 0.75, "F > 0: the tissue\npushes the tool back",
        color=GREEN, va="center",
    )  # fmt: skip
