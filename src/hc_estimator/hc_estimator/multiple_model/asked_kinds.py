"""Which kinds of tissue and surface need not be asked again: what they left was far beyond noise.

Searches ask once a second which of them explains the points, of which nine tenths are the same each
time. As long as one does, those that left several times the noise are asked every few seconds only:
they take most steps, and whatever is found waits for them. Where none does, all are asked.
(Ours; steps in `docs/default_filter.md`.)
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled

FAR = 3.0  # squares left, in those of the noise
ASKED_EVERY = 4.0  # time in contact after which a kind is asked all the same [s]


@compiled
def forget(asked: Any) -> None:
    """Nothing was asked."""
    asked.version = -1


@compiled
def begin(asked: Any, version: int) -> None:
    """Forget what was asked of another tissue.

    Args:
        asked: record of the kinds.
        version: of the history.
    """
    if asked.version == version:
        return
    asked.version = version
    for k in range(asked.left.size):
        asked.left[k] = math.inf
        asked.at[k] = -math.inf


@compiled
def note(asked: Any, k: int, left: float, clock: float) -> None:
    """Note what a kind has left.

    Args:
        asked: changed.
        k: number of the kind.
        left: squares, in those of the noise.
        clock: time in contact [s].
    """
    asked.left[k] = left if math.isfinite(left) else math.inf
    asked.at[k] = clock


@compiled
def is_ruled_out(asked: Any, k: int, clock: float) -> bool:
    """True if a kind left far more than noise, not long ago."""
    return bool(clock - asked.at[k] < ASKED_EVERY and asked.left[k] > FAR)
