"""The normal of a surface from the forces of an approach, and how well it is known.

A tissue without friction pushes along its normal: the direction of what a press adds to the force
in free motion. Noise, a weight that was not compensated while the tool turned, and a tool that
slides make the direction wander, so the deviation comes of parts of the press compared with each
other, not of single readings: what lasts for some of them does not average out.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hc_estimator.stream.contact_frame import Vector, unit_vector

FREE_DEVIATIONS = 3.0
STRONG_SHARE = 0.7
"""Forces within so many deviations of the free one are free, forces above this share of the largest
one are of the press."""
MOST_READINGS = 50_000
"""Kept while a press is waited for: the newest."""
PARTS = 8
"""Of the free forces, and of those of the press, that are compared."""
FAIR_DEG = 3.0
"""A normal that is known worse is told to be poor: a slide of 10 mm would be 0.5 mm of depth."""
POOR_DEG = 10.0
"""One that is known worse than this is none: the depth would be wrong by a sixth of any slide."""


class Normal(NamedTuple):
    """The normal of a surface.

    Attributes:
        direction: out of the tissue, in the base frame, of length 1.
        deviation_deg: root mean square of the angle by which it may be off [degrees]; friction,
            which leans it to one side throughout, is not in it.
        free_n: force along it free of contact [N].
    """

    direction: Vector
    deviation_deg: float
    free_n: float

    @property
    def is_poor(self) -> bool:
        """Whether it had better not be used."""
        return not self.deviation_deg <= POOR_DEG


class NormalFinder:
    """Finds the normal of a surface from the forces of an approach."""

    def __init__(self) -> None:
        self._forces: deque[Vector] = deque(maxlen=MOST_READINGS)
        self._along: deque[float] = deque(maxlen=MOST_READINGS)
        self._tips: deque[tuple[float, Vector]] = deque(maxlen=MOST_READINGS)

    def add(self, force: Vector, along: float) -> None:
        """Take in a force in the base frame, and its part along the present normal [N]."""
        if math.isfinite(along) and all(map(math.isfinite, force)):
            self._forces.append(force)
            self._along.append(along)

    def add_tip(self, depth_mm: float, tip: Vector) -> None:
        """Take in where the tip is in the base frame [m], and its depth along the present normal.

        Depth and force are in readings with the present zeros taken off.
        """
        if math.isfinite(depth_mm):
            self._tips.append((depth_mm, tip))

    def tip_at(self, depth_mm: float) -> Vector | None:
        """Return where the tip was when it last came through a depth; None if it never did.

        On its own way: a tool need not move along a normal that is only guessed.
        """
        tips = list(self._tips)
        for (before, first), (after, second) in zip(tips[-2::-1], tips[:0:-1], strict=True):
            if before <= depth_mm < after:
                share = (depth_mm - before) / (after - before)
                x, y, z = (a + share * (b - a) for a, b in zip(first, second, strict=True))
                return x, y, z
        return None

    def normal(self, free: float, free_std: float) -> Normal | None:
        """Return the direction in which the tissue pushes the tool; None if nothing pushes.

        The force in free motion, a wrong weight say, is taken off.

        Args:
            free: the force along the present normal free of contact [N].
            free_std: its standard deviation [N].
        """
        forces, more = np.array(self._forces).reshape(-1, 3), np.array(self._along) - free
        limit = FREE_DEVIATIONS * free_std
        rest = forces[np.abs(more) <= limit]
        most = float(more.max(initial=0.0))
        if not len(rest) or most <= limit:
            return None
        strong = forces[more >= STRONG_SHARE * most]
        unloaded = rest.mean(axis=0)
        push = strong.mean(axis=0) - unloaded
        size = float(np.linalg.norm(push))
        if size == 0.0:
            return None
        direction = unit_vector(push.tolist())
        across = np.eye(3) - np.outer(direction, direction)
        # Of the press the directions are compared: the stronger of its forces lean no more.
        pressed = strong - unloaded
        leant = pressed @ across / (pressed @ np.array(direction))[:, None]
        free_across = rest @ across
        offset = _of_mean(free_across) + _wander(free_across)  # the second lasts into the press
        variance = _of_mean(leant) + offset / size**2
        deviation_deg = math.degrees(math.sqrt(variance))
        return Normal(direction, deviation_deg, float(unloaded @ np.array(direction)))


def _wander(values: NDArray[np.float64]) -> float:
    """Return by how much means of parts in order vary beyond their noise, as a variance.

    Args:
        values: shape (readings, components).
    """
    parts = np.array_split(values, min(PARTS, len(values)))
    if len(parts[-1]) < 2:
        return 0.0
    noise = np.mean([part.var(axis=0, ddof=1).sum() / len(part) for part in parts])
    between = np.var([part.mean(axis=0) for part in parts], axis=0, ddof=1).sum()
    return max(float(between - noise), 0.0)


def _of_mean(values: NDArray[np.float64]) -> float:
    """Return the variance of a mean, summed over components, from means of parts in order.

    Args:
        values: shape (readings, components).

    Returns:
        Infinity of a single reading.
    """
    parts = [part.mean(axis=0) for part in np.array_split(values, min(PARTS, len(values)))]
    if len(parts) < 2:
        return math.inf
    return float(np.var(parts, axis=0, ddof=1).sum()) / len(parts)
