"""The palpation map as a picture, as a table and as a mesh for other programs."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any, Final

import numpy as np
from matplotlib import colormaps
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from hc_bringup.report.palpation_map import StiffnessMap
from hc_sim_rig.picture_style import (
    BAND,
    DPI,
    ESTIMATED,
    GREY,
    THIN,
    in_style,
    legend_below,
    new_figure,
)

PICTURES: Final = (".png", ".svg", ".pdf")
SUFFIXES: Final = (*PICTURES, ".csv", ".ply")
COLUMNS: Final = ("x [mm]", "y [mm]", "stiffness [N/mm]", "low [N/mm]", "high [N/mm]", "known")
COLOURS: Final = "viridis"


def encode(found: StiffnessMap, path: Path, title: str, axes: str = "xy") -> bytes:
    """Return the content of a file of the map; its name says the format.

    Args:
        found: the map.
        path: the file.
        title: of a picture.
        axes: components of the tip's position that are sideways: a picture names them. In a table
            and a mesh the first is x and the second is y, whatever they are.
    """
    suffix = path.suffix.lower()
    if suffix == ".csv":
        return _csv(found)
    if suffix == ".ply":
        return _ply(found)
    buffer = io.BytesIO()
    draw(found, title, axes).savefig(buffer, format=suffix.removeprefix("."), dpi=DPI)
    return buffer.getvalue()


@in_style
def draw(found: StiffnessMap, title: str, axes: str = "xy") -> Figure:
    """Return the picture: along a line a profile, over a plane the map and its uncertainty."""
    figure = new_figure(4.4)
    figure.suptitle(title, parse_math=False)  # a $ in a name begins no formula
    if found.is_line:
        _profile(figure, found, axes)
    else:
        _plane(figure, found, axes)
    return figure


def _profile(figure: Figure, found: StiffnessMap, names: str) -> None:
    strip, axes = figure.subplots(2, 1, sharex=True, height_ratios=(1, 5))
    stiffness = np.where(found.known[0], found.stiffness[0], np.nan)
    factor = np.exp(2.0 * found.log_std[0])
    axes.fill_between(
        found.x_mm,
        np.where(found.known[0], stiffness / factor, np.nan),
        np.where(found.known[0], stiffness * factor, np.nan),
        color=ESTIMATED,
        alpha=BAND,
        linewidth=0.0,
        label="± 2 standard deviations",
    )
    axes.plot(found.x_mm, stiffness, color=ESTIMATED, label="map")
    at = found.places
    axes.errorbar(
        at.position_mm[:, 0],
        np.exp(at.log_stiffness),
        2.0 * np.exp(at.log_stiffness) * np.sqrt(at.variance),
        fmt=".",
        color=GREY,
        elinewidth=THIN,
        markersize=3,
        label="measured there",
        zorder=0,
    )
    axes.set_ylim(0.0, 1.15 * float(np.nanmax(np.append(stiffness, np.exp(at.log_stiffness)))))
    axes.set_xlabel(f"sideways: {names[0]} [mm]")
    axes.set_ylabel(f"stiffness at {at.depth_mm:g} mm [N/mm]")
    image: Any = strip.imshow(
        stiffness[None],
        extent=(found.x_mm[0], found.x_mm[-1], 0.0, 1.0),
        aspect="auto",
        cmap=COLOURS,
        norm=Normalize(*found.colour_range),
    )
    strip.set_yticks([])
    strip.grid(visible=False)
    figure.colorbar(image, ax=(strip, axes), label="colour: stiffness [N/mm]", fraction=0.03)
    if found.lump is not None:
        x, what = found.lump.x_mm, "hard spot at" if found.lump.passed else "harder up to"
        axes.annotate(
            f"{what} {x:.1f} mm:\n{found.lump.times()} as stiff",
            (x, float(np.interp(x, found.x_mm, found.stiffness[0]))),
            (x, 0.04),  # at the foot, where nothing is drawn
            textcoords=axes.get_xaxis_transform(),
            horizontalalignment="center" if found.lump.passed else _inwards(found, x),
            verticalalignment="bottom",
            arrowprops={"arrowstyle": "-", "color": GREY},
            bbox={"boxstyle": "round", "facecolor": "white", "edgecolor": "none", "alpha": 0.85},
        )
    legend_below(figure, ncols=3)


def _inwards(found: StiffnessMap, x_mm: float) -> str:
    """Return how to align what stands at an end of the map, so that it stands within."""
    return "right" if 2.0 * x_mm > found.x_mm[0] + found.x_mm[-1] else "left"


def _plane(figure: Figure, found: StiffnessMap, names: str) -> None:
    left, right = figure.subplots(1, 2, sharex=True, sharey=True)
    extent = (found.x_mm[0], found.x_mm[-1], found.y_mm[0], found.y_mm[-1])
    stiffness = f"stiffness at {found.places.depth_mm:g} mm [N/mm]"
    for axes, values, colours, ends, label in (
        (left, found.stiffness, COLOURS, found.colour_range, stiffness),
        (right, 100.0 * found.log_std, "cividis_r", (None, None), "standard deviation [%]"),
    ):
        image: Any = axes.imshow(
            np.where(found.known, values, np.nan),
            origin="lower",
            extent=extent,
            cmap=colours,
            norm=Normalize(*ends),
            aspect="equal",
        )
        figure.colorbar(image, ax=axes, label=label, shrink=0.8)
        position = found.places.position_mm
        axes.plot(position[:, 0], position[:, 1], ".", color="white", markersize=2.5, alpha=0.8)
        axes.set_xlabel(f"{names[0]} [mm]")
        axes.grid(visible=False)
        axes.set_facecolor("0.85")
    left.set_ylabel(f"{names[1]} [mm]")
    left.set_title("dots: measured there; grey: not known")
    if found.lump is not None:
        x, y = found.lump.x_mm, found.lump.y_mm
        left.plot(x, y, "o", markersize=14, markerfacecolor="none", color="white")
        left.annotate(
            found.lump.times() + ("" if found.lump.passed else " so far"),
            (x, y),
            (0.0, 12.0),
            textcoords="offset points",
            horizontalalignment="center",
            color="white",
            fontweight="bold",
            # On a narrow map it is wider than that, and white on white.
            bbox={"boxstyle": "round", "facecolor": "black", "edgecolor": "none", "alpha": 0.6},
        )


def _csv(found: StiffnessMap) -> bytes:
    lines = [",".join(COLUMNS)]
    factor = np.exp(2.0 * found.log_std)
    for row, y in enumerate(found.y_mm):
        for column, x in enumerate(found.x_mm):
            value, spread = found.stiffness[row, column], factor[row, column]
            known = int(found.known[row, column])
            lines.append(
                f"{x:.6g},{y:.6g},{value:.6g},{value / spread:.6g},{value * spread:.6g},{known}"
            )
    return ("\n".join(lines) + "\n").encode()


def _ply(found: StiffnessMap) -> bytes:
    """Return a mesh (Stanford PLY): places coloured by stiffness, which is a property too."""
    rows, columns = found.stiffness.shape
    scale = Normalize(*found.colour_range, clip=True)
    colours = (255.0 * colormaps[COLOURS](scale(found.stiffness))[..., :3]).astype(int)
    faces = [
        (
            row * columns + column,
            row * columns + column + 1,
            (row + 1) * columns + column + 1,
            (row + 1) * columns + column,
        )
        for row in range(rows - 1)
        for column in range(columns - 1)
        if found.known[row : row + 2, column : column + 2].all()
    ]
    lines = [
        "ply",
        "format ascii 1.0",
        "comment palpation map, lengths in mm, stiffness in N/mm",
        f"element vertex {rows * columns}",
        *(f"property float {name}" for name in ("x", "y", "z")),
        *(f"property uchar {name}" for name in ("red", "green", "blue")),
        "property float stiffness",
        "property float log_std",
        f"element face {len(faces)}",
        "property list uchar int vertex_indices",
        "end_header",
    ]
    for row, y in enumerate(found.y_mm):
        for column, x in enumerate(found.x_mm):
            red, green, blue = colours[row, column]
            lines.append(
                f"{x:.6g} {y:.6g} 0 {red} {green} {blue} "
                f"{found.stiffness[row, column]:.6g} {found.log_std[row, column]:.6g}"
            )
    lines += ["4 " + " ".join(map(str, face)) for face in faces]
    return ("\n".join(lines) + "\n").encode()
