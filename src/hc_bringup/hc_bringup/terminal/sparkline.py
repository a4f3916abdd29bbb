"""A curve in one line of text."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

STEPS: Final = "▁▂▃▄▅▆▇█"


def sparkline(values: Sequence[float], width: int) -> str:
    """Return the last values as blocks, one a column; what is not finite is a gap.

    Args:
        values: oldest first.
        width: columns; the text is exactly as wide.
    """
    if width <= 0:
        return ""
    shown = list(values)[-width:]
    finite = [value for value in shown if math.isfinite(value)]
    low, high = (min(finite), max(finite)) if finite else (0.0, 0.0)
    span = 0.5 * high - 0.5 * low  # half of it: the whole can be beyond the largest number
    blocks = []
    for value in shown:
        if not math.isfinite(value):
            blocks.append(" ")
        elif span <= 1e-12 * max(abs(low), abs(high), 1e-300):
            blocks.append(STEPS[0])
        else:
            share = (0.5 * value - 0.5 * low) / span
            blocks.append(STEPS[min(len(STEPS) - 1, int(share * len(STEPS)))])
    return "".join(blocks).rjust(width)
