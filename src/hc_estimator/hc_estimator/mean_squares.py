"""How large may a mean square be of noise alone?

Its cube root is next to normal (Wilson and Hilferty, PNAS 17, 1931).
"""

from __future__ import annotations

import math

from hc_estimator.compilation import compiled


@compiled
def largest_by_noise(freedom: float, deviations: float) -> float:
    """Mean square that noise alone makes at most, over its variance.

    Args:
        freedom: number of independent squares; less than one counts as one.
        deviations: of the cube root.
    """
    spread = 2.0 / (9.0 * max(freedom, 1.0))
    return (1.0 - spread + deviations * math.sqrt(spread)) ** 3
