"""How a run ends on the command line: a picture of what was felt, and a sentence about it.

Along a scan the picture is the tissue itself, coloured by its stiffness, above its profile;
elsewhere it is the force over the depth.
"""

from __future__ import annotations

import math
from itertools import groupby
from typing import Final, NamedTuple

import numpy as np
from matplotlib import colormaps
from numpy.typing import NDArray
from rich.text import Text

from hc_bringup.dashboard.columns import INDEX
from hc_bringup.dashboard.palpation import MAP_COLUMNS
from hc_bringup.report.rows import map_cells, page_rows
from hc_bringup.run_data import RunData
from hc_bringup.terminal.numbers import decimals_of, engineering

Array = NDArray[np.float64]

DEPTH_MM: Final = 2.0
LARGEST_SPREAD: Final = 0.5  # of the force, up to which it is an answer
HEIGHT: Final = 7
WIDEST: Final = 76
LEAST_CELLS: Final = 8
LEAST_FACTOR: Final = 1.3
AROUND: Final = 0.25
"""Quantile of the stiffness that counts as what is around a lump: the lump itself is not in it."""
EIGHTHS: Final = " ▁▂▃▄▅▆▇█"
_COLUMN: Final = {name: place for place, name in enumerate(MAP_COLUMNS)}


class Profile(NamedTuple):
    """Stiffness along a scan: places [mm], stiffness [N/mm], its relative deviation."""

    x_mm: Array
    stiffness: Array
    relative_std: Array


class Lump(NamedTuple):
    """A hard spot: place [mm], how many times as stiff as around it, relative deviation.

    It is not passed where the way begins or ends at its stiffest: it may lie further on.
    """

    x_mm: float
    factor: float
    relative_std: float
    passed: bool


def ending(data: RunData, width: int) -> list[Text]:
    """Return the picture and the sentence.

    Args:
        data: the run.
        width: columns of the terminal.
    """
    width = max(30, min(width - 4, WIDEST))
    rows = page_rows(data)
    profile = scan_profile(data, rows)
    if profile is not None:
        lines = draw_profile(profile, width)
        return [*lines, Text(""), Text(_sentence_of_scan(profile))]
    lines = draw_depth(rows, width)
    return [*lines, Text(""), Text(_sentence_of_press(data))] if lines else []


def scan_profile(data: RunData, rows: Array) -> Profile | None:
    """Return the stiffness along a scan; None where there was none."""
    if data.tip is None:
        return None
    _, cells = map_cells(data, rows)
    if len(cells) < LEAST_CELLS or np.ptp(cells[:, _COLUMN["y"]]) > 0.0:
        return None
    cells = cells[np.argsort(cells[:, _COLUMN["x"]])]
    exponent = cells[:, _COLUMN["n"]]
    log_depth = math.log(DEPTH_MM)
    slope = 1.0 / exponent + log_depth
    stiffness = np.exp(cells[:, _COLUMN["ln_K"]] + (exponent - 1.0) * log_depth) * exponent
    variance = (
        cells[:, _COLUMN["var_ln_K"]]
        + slope**2 * cells[:, _COLUMN["var_n"]]
        + 2.0 * slope * cells[:, _COLUMN["cov"]]
    )
    return Profile(cells[:, _COLUMN["x"]], stiffness, np.sqrt(np.maximum(variance, 0.0)))


def find_lump(profile: Profile) -> Lump | None:
    """Return the stiffest place if it stands out by more than its uncertainty allows."""
    usual = float(np.quantile(profile.stiffness, AROUND))
    trusted = np.flatnonzero(profile.relative_std < 0.2)
    if not len(trusted):
        return None
    peak = int(trusted[np.argmax(profile.stiffness[trusted])])
    factor = float(profile.stiffness[peak]) / usual
    relative = float(profile.relative_std[peak])
    # One estimate that went astray is no lump: a neighbour must feel it too.
    beside = [i for i in (peak - 1, peak + 1) if 0 <= i < len(profile.stiffness)]
    stiffer_beside = max(float(profile.stiffness[i]) for i in beside) > 1.15 * usual
    if factor < LEAST_FACTOR or factor - 1.0 < 4.0 * relative * factor or not stiffer_beside:
        return None
    passed = 1 < peak < len(profile.stiffness) - 2
    return Lump(float(profile.x_mm[peak]), factor, relative, passed)


def draw_profile(profile: Profile, width: int) -> list[Text]:
    """Return the tissue from above, its profile and an axis."""
    at = np.linspace(profile.x_mm[0], profile.x_mm[-1], width)
    values = np.interp(at, profile.x_mm, profile.stiffness)
    low, high = float(values.min()), float(values.max())
    share = (values - low) / (high - low) if high > low else np.full(width, 0.5)
    colours = [_hex(one) for one in share]
    top = f"stiffness at {DEPTH_MM:g} mm, up to {high:.2f} N/mm"
    lines = [Text(top, style="dim")]
    eighths = np.rint(values / high * HEIGHT * 8).astype(int)
    for row in range(HEIGHT - 1, -1, -1):
        line = Text("  ")
        blocks = [EIGHTHS[filled] for filled in np.clip(eighths - 8 * row, 0, 8)]
        for colour, columns in groupby(range(width), key=colours.__getitem__):
            line.append("".join(blocks[column] for column in columns), style=colour)
        lines.append(line)
    axis = f"{at[0]:.0f} mm".ljust(width // 2) + f"{at[-1]:.0f} mm".rjust(width - width // 2)
    return [*lines, Text("  " + axis, style="dim")]


def draw_depth(rows: Array, width: int) -> list[Text]:
    """Return the force over the depth as dots; nothing where nothing was touched."""
    depth, force = rows[:, INDEX["displacement"]], rows[:, INDEX["force"]]
    usable = np.isfinite(depth) & np.isfinite(force) & (rows[:, INDEX["contact"]] == 1.0)
    if np.count_nonzero(usable) < 20:
        return []
    depth, force = depth[usable], force[usable]
    # A character of Braille holds two by four dots.
    dots = np.zeros((4 * HEIGHT, 2 * width), bool)
    highest, deepest = max(float(force.max()), 1e-9), max(float(depth.max()), 1e-9)
    column = np.clip((depth / deepest * (2 * width - 1)).astype(int), 0, 2 * width - 1)
    row = np.clip((force / highest * (4 * HEIGHT - 1)).astype(int), 0, 4 * HEIGHT - 1)
    dots[4 * HEIGHT - 1 - row, column] = True
    lines = [Text(f"force over depth, up to {highest:.2f} N", style="dim")]
    bits = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]])
    for line in range(HEIGHT):
        blocks = dots[4 * line : 4 * line + 4].reshape(4, width, 2)
        codes = (blocks * bits[:, None, :]).sum(axis=(0, 2))
        lines.append(Text("  " + "".join(chr(0x2800 + int(code)) for code in codes), style="cyan"))
    axis = "0 mm".ljust(width // 2) + f"{deepest:.1f} mm".rjust(width - width // 2)
    return [*lines, Text("  " + axis, style="dim")]


def _sentence_of_scan(profile: Profile) -> str:
    lump = find_lump(profile)
    if lump is None:
        spread = 100.0 * float(np.std(profile.stiffness) / np.mean(profile.stiffness))
        return f"No lump along the way: the stiffness varies by {spread:.0f} %."
    if not lump.passed:
        return (
            f"The tissue grows harder up to {lump.x_mm:.1f} mm, where the way ends: "
            f"{lump.factor:.1f} times as stiff so far. Go further to find the lump."
        )
    return (
        f"There is a lump: {lump.x_mm:.1f} mm along the way the tissue is {lump.factor:.1f} times "
        f"as stiff as around it, known to {max(1.0, 200.0 * lump.relative_std):.0f} %."
    )


def _sentence_of_press(data: RunData) -> str:
    last = int(np.flatnonzero(data.contact & data.used)[-1])
    stiffness, _, exponent, _ = data.parameters[last]
    relative = np.array([1.0 / stiffness, math.log(DEPTH_MM)])
    covariance = data.covariance[last][np.ix_([0, 2], [0, 2])]
    force = float(stiffness * DEPTH_MM**exponent)
    spread = 2.0 * force * math.sqrt(max(float(relative @ covariance @ relative), 0.0))
    if not spread < LARGEST_SPREAD * force:
        return "How the tissue answers is not known from this run; hc doctor says why."
    places = decimals_of(force, spread)
    error = (data.force_n - data.force_predicted_n)[data.contact & data.used]
    usual = float(np.nanmedian(np.abs(error))) if np.isfinite(error).any() else math.nan
    return (
        f"{DEPTH_MM:g} mm deep this tissue answers with {force:.{places}f} ± {spread:.{places}f} "
        "N; every force was foretold before it came, half of them within "
        f"{engineering(usual, 'N')}."
    )


def _hex(share: float) -> str:
    red, green, blue = (round(255 * c) for c in colormaps["viridis"](float(share))[:3])
    return f"#{red:02x}{green:02x}{blue:02x}"
