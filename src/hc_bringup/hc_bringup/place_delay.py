"""The delay between force and position where several places were pressed one after another.

It is the robot's and the same at all places. One law over all of them fits none and says nothing
of it, and a few presses of one place leave it open; all places together tell it.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hc_bringup.tip_path import TipPath
from hc_estimator.stream.readings import noise
from hc_estimator.stream.surface import find_surface
from hc_estimator.stream.together import together

Array = NDArray[np.float64]

APART_MM: Final = 2.0
"""Sideways: two touches further apart are of two places."""
PAUSE_S: Final = 1.0
"""In the air, where nobody tells how far the tip went sideways: longer, and it is another place."""
TOUCHED: Final = 25.0
"""Noises by which the force must stand out somewhere for a place to have been pressed."""
MOST_NOISES: Final = 1.5
"""A fit that leaves more than so many times the noise says nothing sure of what it fitted."""
MOST_PLACES: Final = 8
"""So many are compared, of more the first: each takes half a second."""


class Delay(NamedTuple):
    """A delay that is the same at several places.

    Attributes:
        seconds: by which the force is late; negative: the position.
        deviation_s: standard deviation of that.
        places: that say so.
    """

    seconds: float
    deviation_s: float
    places: int

    @property
    def late(self) -> str:
        """Which channel is late, by how much, in words."""
        late, early = ("force", "position") if self.seconds > 0.0 else ("position", "force")
        return (
            f"the {late} is {1e3 * abs(self.seconds):.1f} ± {1e3 * self.deviation_s:.2g} ms late "
            f"against the {early}"
        )


def delay_setting(setting: Any) -> float | str:
    """Return a setting `channel_delay` as a number [s], which clients also write as a text."""
    try:
        return float(setting)
    except ValueError:
        return "auto"


def between_places(time_s: Array, pressed: NDArray[np.intp], tip: TipPath | None) -> list[int]:
    """Return rows between two places: in the middle of the time between two touches.

    Args:
        time_s: of all rows, shape (n,).
        pressed: rows in which the force stands out of its noise, ascending.
        tip: where the tip was, if that is known.
    """
    before, after = time_s[pressed[:-1]], time_s[pressed[1:]]
    steps = np.diff(time_s[np.isfinite(time_s)])
    usual = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0
    apart = after - before > 3.0 * usual
    if tip is None:
        apart &= after - before > PAUSE_S
    else:
        moved = [
            np.interp(after - time_s[0], tip.time_s, axis)
            - np.interp(before - time_s[0], tip.time_s, axis)
            for axis in tip.position_mm.T
        ]
        apart &= np.hypot(*moved) > APART_MM
    middle = 0.5 * (before[apart] + after[apart])
    return [int(row) for row in np.searchsorted(time_s, middle)]


def delay_at(places: Iterable[tuple[Array, Array, Array]]) -> Delay | None:
    """Return the delay that places say together, None if none of them says anything sure.

    Args:
        places: stamps [s], penetration [mm] from the surface on and contact force [N] of each; NaN
            where there is no reading.
    """
    # Two seconds of scipy, which the end of a run does without.
    from hc_evaluation.channels import diagnose_channels, evenly_spaced, unbroken

    sure = []
    for place in itertools.islice(places, MOST_PLACES):
        try:
            found = diagnose_channels(*evenly_spaced(*unbroken(*place)))
        except ValueError:
            continue  # too little of this place to compare, and there are others
        if found.residual_rms_n < MOST_NOISES * found.noise_n:
            sure.append((found.delay_s, found.delay_std_s))
    if not sure:
        return None
    delays, deviations = np.array(sure).T
    weights = deviations**-2.0
    mean = float(np.average(delays, weights=weights))
    deviation = float(weights.sum() ** -0.5)
    if len(sure) > 1:  # places that say different things know it less well than each believes
        spread = float(np.sum(weights * (delays - mean) ** 2)) / (len(sure) - 1)
        deviation *= max(1.0, spread) ** 0.5
    return Delay(mean, deviation, len(sure))


def delay_between_places(time_s: Array, displacement_mm: Array, force_n: Array) -> Delay | None:
    """Return the delay where pauses in the air part several places, None if they do not.

    Args:
        time_s: stamps [s], shape (n,).
        displacement_mm: penetration [mm], shape (n,); NaN where there is no reading.
        force_n: contact force [N], zero in the air, shape (n,); NaN where there is no reading.
    """
    there = np.flatnonzero(np.isfinite(force_n))
    stands_out = force_n[there] > TOUCHED * max(noise(force_n[there]), 1e-12)
    cuts = [0, *between_places(time_s, there[stands_out], None), len(time_s)]
    if len(cuts) < 3:
        return None

    def places() -> Iterator[tuple[Array, Array, Array]]:
        for begin, end in itertools.pairwise(cuts):
            part = (time_s[begin:end], displacement_mm[begin:end], force_n[begin:end])
            surface = find_surface(*together(*part)[1:])
            begins_mm = 0.0 if surface is None else surface.displacement_mm
            yield part[0], part[1] - begins_mm, part[2]

    return delay_at(places())
