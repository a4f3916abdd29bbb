"""How a run ends on the command line: a picture of what was felt, and sentences about it.

Along a scan the picture is the tissue itself, coloured by its stiffness, above its profile;
elsewhere it is the force over the depth. Map and sentences are those of `hc report`, so that both
say the same.
"""

from __future__ import annotations

from itertools import groupby
from typing import Final

import numpy as np
from numpy.typing import NDArray
from rich.text import Text

from hc_bringup.dashboard.columns import INDEX
from hc_bringup.report.contacts import WORTH_A_ROW, find_contacts
from hc_bringup.report.palpation_map import StiffnessMap, usual_map
from hc_bringup.report.rows import page_rows
from hc_bringup.report.verdict import Level, stiffness_found
from hc_bringup.run_data import RunData

Array = NDArray[np.float64]

HEIGHT: Final = 7
WIDEST: Final = 76
LEAST_PLACES: Final = 8
EIGHTHS: Final = " ▁▂▃▄▅▆▇█"


def ending(data: RunData, width: int) -> list[Text]:
    """Return the picture and the sentences.

    Args:
        data: the run, with samples in contact that were used.
        width: columns of the terminal.
    """
    width = max(30, min(width - 4, WIDEST))
    found = usual_map(data, find_contacts(data, WORTH_A_ROW))
    if found is not None and is_scan(found):
        return [*draw_profile(found, width), Text(""), *_sentences(data, found)]
    lines = draw_depth(page_rows(data), width)
    return [*lines, Text(""), *_sentences(data, found)] if lines else []


def is_scan(found: StiffnessMap) -> bool:
    """Whether a map is one along a line, of more than a few places, and says something."""
    enough = len(found.places.log_stiffness) >= LEAST_PLACES
    return found.is_line and enough and bool(found.known.any())


def draw_profile(found: StiffnessMap, width: int) -> list[Text]:
    """Return the tissue from above, its profile and an axis; empty where it is not known."""
    at = np.linspace(found.x_mm[0], found.x_mm[-1], width)
    values = np.interp(at, found.x_mm, found.stiffness[0])
    known = np.interp(at, found.x_mm, found.known[0].astype(np.float64)) > 0.5
    values = np.where(known, values, 0.0)
    shown = found.stiffness[found.known]
    high = float(shown.max())
    softest, stiffest = found.colour_range
    share = (values - softest) / (stiffest - softest)
    colours = [_hex(one) for one in np.clip(share, 0.0, 1.0)]
    top = f"stiffness at {found.places.depth_mm:g} mm, up to {high:.2f} N/mm"
    lines = [Text(top, style="dim")]
    eighths = np.rint(values / high * HEIGHT * 8).astype(int)
    for row in range(HEIGHT - 1, -1, -1):
        line = Text("  ")
        blocks = [EIGHTHS[filled] for filled in np.clip(eighths - 8 * row, 0, 8)]
        for colour, columns in groupby(range(width), key=colours.__getitem__):
            line.append("".join(blocks[column] for column in columns), style=colour)
        lines.append(line)
    first, last = (round(float(end)) for end in (at[0], at[-1]))  # no "-0"
    axis = f"{first} mm".ljust(width // 2) + f"{last} mm".rjust(width - width // 2)
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


def _sentences(data: RunData, found: StiffnessMap | None) -> list[Text]:
    """Return those of a report about what was felt, each a line, and what helps where they fail."""
    said = stiffness_found(data, found)
    lines = [one.text for one in said]
    if said[-1].level is not Level.GOOD:
        lines[-1] += " hc doctor says why it is not known better."
    if found is not None and is_scan(found):
        if found.lump is None:
            stiffness = found.stiffness[found.known]
            spread = (
                100.0 * float(np.std(stiffness) / np.mean(stiffness)) if len(stiffness) else 0.0
            )
            lines.insert(0, f"No hard spot along the way: the stiffness varies by {spread:.0f} %.")
        elif not found.lump.passed:
            lines[0] += " Go further to find the hard spot."
    return [Text(line) for line in lines]


def _hex(share: float) -> str:
    from matplotlib import colormaps  # takes most of a second, and few runs moved along a surface

    red, green, blue = (round(255 * c) for c in colormaps["viridis"](float(share))[:3])
    return f"#{red:02x}{green:02x}{blue:02x}"
