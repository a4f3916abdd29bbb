"""Where was the tool free? The flat part of force over depth shows both zeros."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hc_estimator.stream.readings import FloatArray, Parts, noise, robust_range

BINS = 40
_FLAT_BINS = 6
FLAT_SHARE = 0.005
"""Of the force's range: as flat as free motion is."""
RISE_SHARE = 0.2
"""Of the force's range: from which on a force is one of contact."""
DOWN_SHARE = 0.2
"""Of the samples: from which on there is a way down."""


def free_motion(depth: FloatArray, newtons: FloatArray) -> Parts[tuple[float, float] | None]:
    """Find the flat part of force over depth before it rises, on the way down where there is one.

    On the way up a damped tissue lets go of the tool early, and the force is zero in the tissue.

    Returns:
        In parts: the force there [N] and the depth where it ends [mm]; None if there is no such
        part.
    """
    down = going_down(depth)
    if np.mean(down) > DOWN_SHARE:
        depth, newtons = depth[down], newtons[down]
    yield
    edges, place = in_bins(depth)
    yield
    medians, counts = medians_of(place, newtons)
    if np.isnan(medians[:_FLAT_BINS]).any():
        return None
    yield
    least, most = robust_range(newtons)
    level = float(np.median(medians[:_FLAT_BINS]))
    errors = 1.25 * noise(newtons) / np.sqrt(np.maximum(counts, 1))  # standard errors of medians
    allowed = np.maximum(FLAT_SHARE * (most - least), 4.0 * errors)
    moved = np.flatnonzero(~(np.abs(medians - level) <= allowed))
    flat = int(moved[0]) if len(moved) else BINS
    last = medians[~np.isnan(medians)][-1]
    if flat < _FLAT_BINS or flat == BINS or last - level < RISE_SHARE * (most - least):
        return None
    return level, float(edges[flat])


def going_down(depth: FloatArray) -> NDArray[np.bool_]:
    """Return where the tool goes deeper, by more than its noise shows."""
    return directions(depth, max(1, len(depth) // 500)) > 0


def directions(depth: FloatArray, lag: int) -> NDArray[np.int64]:
    """Return 1 where the tool goes in, -1 where it goes out, 0 where its noise hides it.

    Args:
        depth: penetration [mm] in the order of time, shape (n,).
        lag: samples before and after, between which it goes.
    """
    advance = np.zeros(len(depth))
    advance[lag:-lag] = depth[2 * lag :] - depth[: -2 * lag]
    least = 4.0 * noise(depth)
    return (advance > least).astype(np.int64) - (advance < -least)


def in_bins(depth: FloatArray) -> tuple[FloatArray, NDArray[np.int64]]:
    """Return the edges of bins of the depth [mm], shape (BINS + 1,), and in which each lies."""
    edges = np.linspace(*robust_range(depth), BINS + 1)
    return edges, np.clip(np.searchsorted(edges, depth, "right") - 1, 0, BINS - 1)


def medians_of(
    place: NDArray[np.int64], newtons: FloatArray
) -> tuple[FloatArray, NDArray[np.int64]]:
    """Return the median force in each bin, NaN of less than three readings, and their number.

    Args:
        place: bin of each reading, shape (n,).
        newtons: forces [N], shape (n,).
    """
    counts = np.bincount(place, minlength=BINS)
    ordered = newtons[np.lexsort((newtons, place))]
    medians = np.full(len(counts), np.nan)
    enough = counts >= 3
    first, count = (np.cumsum(counts) - counts)[enough], counts[enough]
    medians[enough] = 0.5 * (ordered[first + (count - 1) // 2] + ordered[first + count // 2])
    return medians, counts
