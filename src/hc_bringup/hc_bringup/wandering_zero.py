"""A force zero that wanders from press to press: a sensor that warms up, a tool that is turned.

Between presses the tool is in the air, and there a force sensor reads its zero. What changes from
one time in the air to the next, bit by bit, is no tissue. A step is told elsewhere
(hc_estimator.stream.zero_steps).
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hc_estimator.stream.readings import noise, robust_range
from hc_estimator.stream.together import together

Array = NDArray[np.float64]

LOWEST: Final = 0.2
"""Of the readings, those with the least depth: in the air, if the tool leaves the tissue at all."""
AWAY: Final = 0.35
"""From this share on the tool has left the air, and comes back for another visit."""
FEWEST_VISITS: Final = 5
FEWEST_READINGS: Final = 20
LEAST_SHARE: Final = 0.02
"""Of the force's range, by which a zero has to wander for anybody to mind."""
CLEAR: Final = 6.0
"""Times what the visits' own spread leaves open."""
OF_A_STEP: Final = 0.5
"""Of all that it wanders by: more at once is a step."""
OF_THE_PLACE: Final = 0.3
"""Of all that it wanders by: what depends on the place more than that is no air."""
EVEN: Final = 0.98
"""Squared correlation with the time, from which on it is a drift."""


class Wander(NamedTuple):
    """A force zero that is not the same throughout.

    Attributes:
        words: a sentence.
        zero_n: the zero at each of the stamps that were given [N].
    """

    words: str
    zero_n: Array


def wandering_zero(time_s: Array, displacement_mm: Array, force_n: Array) -> Wander | None:
    """Return how the force's zero wanders; None where it stays, or nobody can tell.

    Args:
        time_s: stamps [s], shape (n,).
        displacement_mm: penetration [mm], shape (n,); NaN where there is no reading.
        force_n: contact force [N], shape (n,); NaN where there is no reading.
    """
    stamps, depth, newtons = together(time_s, displacement_mm, force_n)
    if len(stamps) < FEWEST_VISITS * FEWEST_READINGS:
        return None
    low, away = np.quantile(depth, (LOWEST, AWAY))
    visits = _visits(depth, float(low), float(away))
    if len(visits) < FEWEST_VISITS:
        return None
    at_s = np.array([stamps[rows].mean() for rows in visits])
    zero_n = np.array([np.median(newtons[rows]) for rows in visits])
    rest = np.concatenate([newtons[r] - z for r, z in zip(visits, zero_n, strict=True)])
    places = np.concatenate([depth[r] - depth[r].mean() for r in visits])
    wander_n = float(np.ptp(zero_n))
    least, most = robust_range(newtons)
    fewest = min(map(len, visits))
    spread_n = max(float(np.std(rest)), noise(newtons)) / np.sqrt(fewest)
    slope = float(places @ rest) / max(float(places @ places), 1e-12)
    if (
        wander_n < max(LEAST_SHARE * (most - least), CLEAR * spread_n)
        or np.max(np.abs(np.diff(zero_n))) > OF_A_STEP * wander_n
        or abs(slope) * float(np.ptp(places)) > OF_THE_PLACE * wander_n
    ):
        return None
    if np.corrcoef(at_s, zero_n)[0, 1] ** 2 > EVEN:
        rate, offset = np.polyfit(at_s, zero_n, 1)
        words = f"the force's zero drifts by {rate:.2g} N/s, by {wander_n:.2g} N in all"
        zeros = offset + rate * time_s
    else:
        words = f"the force's zero wanders between {zero_n.min():.2g} and {zero_n.max():.2g} N"
        zeros = np.interp(time_s, at_s, zero_n)
    words += (
        " from one time free of contact to the next: a sensor that warms up, a tool that is turned "
        "(its weight), a cable that pulls; let it warm up, and tare before each press (hc tare)"
    )
    return Wander(words, zeros)


def _visits(depth: Array, low: float, away: float) -> list[NDArray[np.int64]]:
    """Return the rows of each time in the air, those with readings enough."""
    state = np.where(depth <= low, 1, np.where(depth > away, 0, -1))
    known = np.flatnonzero(state >= 0)
    if not len(known):
        return []
    last = known[np.maximum(np.searchsorted(known, np.arange(len(state)), "right") - 1, 0)]
    inside = state[last] == 1
    edges = np.flatnonzero(np.diff(inside.astype(int))) + 1
    parts = np.split(np.arange(len(depth)), edges)
    rows = [part[depth[part] <= low] for part in parts if inside[part[0]]]
    return [row for row in rows if len(row) >= FEWEST_READINGS]
