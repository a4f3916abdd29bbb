"""Shows in a picture where gaps were cut out of its time axis (cut_time.py).

A gap is a grey stripe with its length above it; the ticks tell the recording's own time on both
sides of it.
"""

from __future__ import annotations

import itertools
from typing import Any, Final

from matplotlib.ticker import FixedFormatter, FixedLocator, MaxNLocator

from hc_bringup.cut_time import CutTime
from hc_sim_rig.picture_style import MEASURED

_TICKS: Final = 8
_USUAL_DIGITS: Final = 6
"""Of a tick's name, with which there is room for so many."""
_DIGIT: Final = 0.01
"""Of the width, that one takes."""
_MOST_NAMED: Final = 4


def show_cuts(columns: Any, cut: CutTime) -> None:
    """Mark what was cut in panels that share the time axis, and tell the recorded time there.

    Args:
        columns: panels, shape (rows, columns).
        cut: of `cut_gaps`.
    """
    pieces = cut.pieces
    if len(pieces) < 2:
        return
    whole_s = sum(piece.end_s - piece.start_s for piece in pieces)
    at: list[float] = []
    names: list[str] = []
    for piece, following in itertools.zip_longest(pieces, pieces[1:]):
        share = (piece.end_s - piece.start_s) / whole_s
        room = _TICKS * share * min(1.0, _USUAL_DIGITS / len(f"{piece.end_s:.0f}"))
        ticks = MaxNLocator(max(1, round(room))).tick_values(piece.start_s, piece.end_s)
        end_s = piece.end_s
        if following is not None:  # whose first tick's name needs room to its left as well
            end_s -= _DIGIT * whole_s * len(f"{following.start_s:.0f}")
        inside = [t for t in ticks if piece.start_s <= t <= end_s]
        at += [t - piece.start_s + piece.drawn_s for t in inside]
        names += [f"{t:.12g}" for t in inside]
    for axes in columns.flat:
        axes.xaxis.set_major_locator(FixedLocator(at))
        axes.xaxis.set_major_formatter(FixedFormatter(names))
    for before, after in itertools.pairwise(pieces):
        left = before.drawn_s + before.end_s - before.start_s
        for axes in columns.flat:
            axes.axvspan(left, after.drawn_s, color=MEASURED, alpha=0.3, linewidth=0.0)
        if len(pieces) - 1 <= _MOST_NAMED:
            for axes in columns[0]:
                axes.text(
                    0.5 * (left + after.drawn_s),
                    1.02,
                    f"{after.start_s - before.end_s:.4g} s",
                    transform=axes.get_xaxis_transform(),
                    horizontalalignment="center",
                    fontsize="small",
                )
    for axes in columns[-1]:
        axes.set_xlabel("time [s]; grey: gaps that are cut out")
