"""A time axis without the long gaps of a recording: two touches an hour apart are two touches.

Drawn to scale they would be two hairlines at the edges of an empty panel.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hc_evaluation.gaps import GAP_STEPS

Array = NDArray[np.float64]

_LONG: Final = 0.05
"""Of the time with readings: shorter gaps are drawn as long as they are."""
_STRIPE: Final = 0.06
_STRIPES: Final = 0.4
"""The same, of what is drawn of a gap, and of all gaps together."""


class Piece(NamedTuple):
    """A stretch between two gaps that are cut: its ends as recorded, and where it is drawn."""

    start_s: float
    end_s: float
    drawn_s: float


class CutTime(NamedTuple):
    """Times as they are drawn.

    Attributes:
        drawn_s: for each time, where it is drawn.
        pieces: between the gaps that are cut, in order; one if none is.
    """

    drawn_s: Array
    pieces: tuple[Piece, ...]


def cut_gaps(time_s: Array) -> CutTime:
    """Take the long gaps out of times, where there is more gap than recording.

    Args:
        time_s: in the order of the recording; need not be finite, and may jump back.
    """
    with np.errstate(invalid="ignore", over="ignore"):
        steps = np.nan_to_num(np.diff(time_s), nan=0.0, posinf=0.0, neginf=0.0)
    usual = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0
    is_gap = steps > GAP_STEPS * usual
    recorded_s = float(steps[~is_gap & (steps > 0.0)].sum())
    is_gap &= steps > _LONG * recorded_s
    if (steps < 0.0).any() or not steps[is_gap].sum() > recorded_s > 0.0:
        known = time_s[np.isfinite(time_s)]
        ends = (float(known[0]), float(known[-1])) if len(known) else (0.0, 0.0)
        return CutTime(time_s, (Piece(*ends, ends[0]),))
    stripe_s = recorded_s * min(_STRIPE, _STRIPES / np.count_nonzero(is_gap))
    stripe_s = max(stripe_s, (GAP_STEPS + 1.0) * usual)
    left_out = np.where(is_gap & (steps > stripe_s), steps - stripe_s, 0.0)
    drawn_s = time_s - np.concatenate(([0.0], np.cumsum(left_out)))
    after = np.flatnonzero(left_out) + 1
    pieces = [
        Piece(float(time_s[begin]), float(time_s[end]), float(drawn_s[begin]))
        for begin, end in zip((0, *after), (*(after - 1), len(time_s) - 1), strict=True)
    ]
    return CutTime(drawn_s, tuple(pieces))
