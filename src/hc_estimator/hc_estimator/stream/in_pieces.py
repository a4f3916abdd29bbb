"""Long recordings through an estimator piece by piece: the same numbers, and others get a word in.

A kernel keeps Python from everything else until it is done: from Ctrl-C, and from the threads that
say how far it is. Of an hour at 1 kHz that would be minutes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import ArrayLike

from hc_estimator.estimate import COLUMNS, EstimateSeries
from hc_msgs_py.free_memory import require_memory_for

if TYPE_CHECKING:
    from hc_estimator.estimator import Estimator

PIECE: Final = 2_000
"""Samples; the default filter takes a tenth of a second for them."""


def run_in_pieces(
    estimator: Estimator,
    time_s: ArrayLike,
    displacement_mm: ArrayLike,
    force_n: ArrayLike,
) -> EstimateSeries:
    """Do what `Estimator.run` does, in several calls.

    Args:
        estimator: goes on from where it is.
        time_s: stamps [s], shape (samples,).
        displacement_mm: penetration [mm], shape (samples,).
        force_n: contact force [N], shape (samples,).

    Returns:
        The estimates after each sample, equal to those of one call to the last bit.

    Raises:
        ValueError: as `Estimator.run`.
        NotEnoughMemoryError: if there is no room for the estimates.
    """
    columns = [np.asarray(column, np.float64) for column in (time_s, displacement_mm, force_n)]
    if len({column.shape for column in columns}) != 1:
        return estimator.run(*columns)  # which says what is wrong
    require_memory_for(len(columns[0]))
    rows = np.empty((len(columns[0]), COLUMNS))
    for begin in range(0, len(rows), PIECE):
        piece = slice(begin, begin + PIECE)
        rows[piece] = estimator.run(*(column[piece] for column in columns)).values
    return EstimateSeries(rows)
