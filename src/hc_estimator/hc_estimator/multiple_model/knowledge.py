"""What the bank of hypotheses knows as state and covariance, and how it begins from another's.

For a change of filter (hc_estimator.stream.handover), over the memory as plain data; no kernels.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hc_estimator.multiple_model.hypotheses import (
    ACCELERATION,
    DEPTH,
    FIRST_PARAMETER,
    FRESH,
    LAST_PARAMETER,
    VELOCITY,
)

_ROW = [DEPTH, VELOCITY, ACCELERATION, *range(FIRST_PARAMETER, LAST_PARAMETER)]
"""Where a row of the bank has the states of a plain filter, in their order."""
_FIRST_OF_TISSUE = 3


def tell(memory: Mapping[str, Any]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return state (7,) and covariance (7, 7) of the row that is given out.

    With what is given out beside it: tissue that varied may vary again, and zeros that were found
    or are doubted leave something open (`report`). The displacement is the reading, for nobody
    else knows of a zero that was found.
    """
    judge = memory["judge"]
    place = FRESH if memory["change"]["leads"] else judge["chosen"]
    row = memory["rows"][place]
    covariance = np.array(row["covariance"])[np.ix_(_ROW, _ROW)]
    by_delay = np.array(row["by_delay"])[_ROW]
    by_delay[:_FIRST_OF_TISSUE] = 0.0
    covariance += memory["delay"]["doubt"] * np.outer(by_delay, by_delay)
    if place == judge["chosen"]:
        covariance[_FIRST_OF_TISSUE:, _FIRST_OF_TISSUE:] += judge["spread"]
    for open_of in (memory["zeros"]["doubt"], memory["place"]["open"]):
        covariance[_FIRST_OF_TISSUE:, _FIRST_OF_TISSUE:] += open_of
    state = np.array(row["state"])[_ROW]
    state[0] += memory["onset"]["zero"][0]
    return state, covariance


def take(
    memory: dict[str, Any], state: NDArray[np.float64], covariance: NDArray[np.float64]
) -> None:
    """Begin every row with what is known; the motion, which is found at once, begins anew.

    Args:
        memory: of a fresh bank; changed. What a row holds fixed (variance 0) stays.
        state: (7,) in the state space `kinematic`.
        covariance: (7, 7) of it.
    """
    memory["guessed"] = memory["motion_anew"] = 1
    for row in memory["rows"]:
        given, spread = state.copy(), covariance.copy()
        for i, place in enumerate(_ROW[_FIRST_OF_TISSUE:], start=_FIRST_OF_TISSUE):
            if row["covariance"][place][place] == 0.0:
                keep(given, spread, i, row["state"][place], 0.0)
        for i, place in enumerate(_ROW):
            row["state"][place] = float(given[i])
            for j, other in enumerate(_ROW):
                row["covariance"][place][other] = float(spread[i, j])


def keep(
    state: NDArray[np.float64],
    covariance: NDArray[np.float64],
    i: int,
    value: float,
    variance: float,
) -> None:
    """Let state i be a value of its own, without ties to the others."""
    state[i] = value
    covariance[i, :] = covariance[:, i] = 0.0
    covariance[i, i] = variance
