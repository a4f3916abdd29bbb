"""A delay between the channels that grows: their stamps are of two clocks.

A crystal is off by up to 100 us in a second, which are 0.36 s after an hour. One offset that is
right at the end of a recording is then wrong at its beginning.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from hc_evaluation.channels import CLEAR, diagnose_channels

Array = NDArray[np.float64]

LEAST_GROWTH_S: Final = 0.002
"""A delay that changes by less changes B by less than anybody tells."""
LEAST_SHIFT_S: Final = 20.0
"""Between the middles of the two parts that are compared."""


def delay_that_grows(
    even: tuple[Array, Array, Array], longest: int, delay_s: float, delay_std_s: float
) -> str:
    """Return a sentence about a delay that is not the same at the beginning; empty if it is.

    Args:
        even: evenly spaced stamps [s], penetration [mm] and force [N], each of shape (n,).
        longest: samples that a comparison of the channels gets.
        delay_s: by which the force is late in the last of them.
        delay_std_s: standard deviation of that.
    """
    rows = len(even[0])
    part = min(longest, rows)
    first, last = slice(0, min(longest, rows // 2)), slice(rows - part, rows)
    apart_s = float(np.mean(even[0][last]) - np.mean(even[0][first]))
    if apart_s < LEAST_SHIFT_S:
        return ""
    try:
        early = diagnose_channels(*(column[first] for column in even))
    except ValueError:
        return ""  # too little was felt at first, and nothing can be said of it
    growth_s = delay_s - early.delay_s
    if abs(growth_s) < max(LEAST_GROWTH_S, CLEAR * float(np.hypot(delay_std_s, early.delay_std_s))):
        return ""
    behind, before = ("force", "position") if growth_s > 0.0 else ("position", "force")
    at_first, at_last = (1e3 * np.sign(growth_s) * delay for delay in (early.delay_s, delay_s))
    return (
        f"the {behind} falls behind the {before} by {1e6 * abs(growth_s) / apart_s:.0f} us a "
        f"second ({at_first:.1f} ms late at first, {at_last:.1f} ms at last): their stamps are of "
        "two clocks, and no one offset serves; stamp both by one clock (PTP, chrony), or where "
        "they arrive"
    )
