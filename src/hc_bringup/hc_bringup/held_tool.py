"""Tissue that relaxes, seen without a law: the force falls while the depth stays the same.

The Hunt-Crossley law has no memory. A filter that knows little at a hold takes the fall for what it
does not know yet, and finds nothing wrong; so it is looked for in the readings themselves.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from hc_estimator.stream.readings import noise, robust_range

Array = NDArray[np.float64]

BIN_S: Final = 0.1
"""Of which means are taken, or the time between readings where that is longer."""
LEAST_HOLD_S: Final = 1.0
FEWEST_BINS: Final = 8
STILL_SHARE: Final = 0.004
"""Of the way that the tool goes: a depth that changes by less stays the same."""
SETTLING_BINS: Final = 2
"""At the beginning of a hold, left out: filters of sensors, and damping that ends."""
LEAST_FALL: Final = 0.08
"""Share of the force."""
STEEPEST: Final = 3.0
"""Power of the depth with which a force grows at the most."""
CLEAR: Final = 6.0
"""Deviations of a mean, by which it has to fall."""
LEAST_PUSH: Final = 0.1
"""Share of the largest force from which on a hold counts."""


def relaxing_line(time_s: Array, displacement_mm: Array, force_n: Array) -> str:
    """Say where the force falls while the depth stays the same; empty if it does nowhere.

    Of several holds the one with the largest share is told.

    Args:
        time_s: stamps [s], shape (n,).
        displacement_mm: penetration [mm], shape (n,); NaN where there is no reading.
        force_n: contact force [N], shape (n,); NaN where there is no reading.
    """
    at_depth = np.isfinite(displacement_mm) & np.isfinite(time_s)
    at_force = np.isfinite(force_n) & np.isfinite(time_s)
    if min(np.count_nonzero(at_depth), np.count_nonzero(at_force)) < FEWEST_BINS:
        return ""
    low, high = robust_range(displacement_mm[at_depth])
    noise_mm, noise_n = noise(displacement_mm[at_depth]), noise(force_n[at_force])
    depth_s, depth, count = _means(time_s[at_depth], displacement_mm[at_depth])
    force_s, force, _ = _means(time_s[at_force], force_n[at_force])
    common, of_depth, of_force = np.intersect1d(depth_s, force_s, return_indices=True)
    depth, force, count = depth[of_depth], force[of_force], count[of_depth]
    most_n = robust_range(force_n[at_force])[1]
    band_mm = max(STILL_SHARE * (high - low), CLEAR * noise_mm / float(np.sqrt(np.median(count))))
    found, share = "", 0.0
    for start, end in _holds(common, depth, band_mm):
        places, forces = depth[start:end], force[start:end]
        third = len(forces) // 3
        first, middle, last = (
            float(np.mean(part)) for part in (forces[:third], forces[third:-third], forces[-third:])
        )
        deviation_n = noise_n / np.sqrt(third * float(np.median(count[start:end])))
        begin_n, end_n = forces[0], forces[-1]
        fall = (begin_n - end_n) / begin_n if begin_n > 0.0 else 0.0
        moved_mm = float(np.ptp(places)) / max(abs(float(np.mean(places))), band_mm)
        slows = first - middle > middle - last > -CLEAR * deviation_n
        if (
            first > max(LEAST_PUSH * most_n, CLEAR * noise_n)
            and first - last > CLEAR * deviation_n
            and slows
            and fall > max(LEAST_FALL, 2.0 * STEEPEST * moved_mm, share)
        ):
            share = fall
            found = (
                f"the force falls from {begin_n:.3g} to {end_n:.3g} N while the depth stays at "
                f"{np.mean(places):.3g} mm for {common[end - 1] - common[start]:.3g} s: tissue "
                "that relaxes (or a tool that slides, a force that drifts); the contact law has no "
                "memory, so K, B, n and p are those of one pace: press at the one that matters"
            )
    return found


def _means(time_s: Array, values: Array) -> tuple[Array, Array, Array]:
    """Return times of bins [s], the means of the values in each, and how many these are."""
    steps = np.diff(time_s)
    forward = steps[steps > 0.0]
    width_s = max(BIN_S, float(np.median(forward)) if len(forward) else BIN_S)
    at = np.floor(time_s / width_s + 1e-6).astype(np.int64)
    bins, place = np.unique(at, return_inverse=True)
    count = np.bincount(place).astype(np.float64)
    return (bins * width_s).astype(np.float64), np.bincount(place, weights=values) / count, count


def _holds(time_s: Array, depth_mm: Array, band_mm: float) -> list[tuple[int, int]]:
    """Return where the depth stays within a band, as begin and end of bins, settling left out."""
    found = []
    start, least, most = 0, np.inf, -np.inf
    for i in range(len(depth_mm) + 1):
        if i < len(depth_mm):
            least, most = min(least, depth_mm[i]), max(most, depth_mm[i])
            pause = i > start and time_s[i] - time_s[i - 1] > LEAST_HOLD_S
            if most - least <= band_mm and not pause:
                continue
        begin = start + SETTLING_BINS
        if i - begin >= FEWEST_BINS and time_s[i - 1] - time_s[begin] >= LEAST_HOLD_S:
            found.append((begin, i))
        if i < len(depth_mm):
            start, least, most = i, depth_mm[i], depth_mm[i]
    return found
