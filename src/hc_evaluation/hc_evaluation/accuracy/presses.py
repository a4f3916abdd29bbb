"""Presses as a hand or an arm makes them: down, a rest, up or a little up, again from the air.

Every move has a limited acceleration (minimum jerk, a trapezoid of the velocity, or a half cosine)
and begins and ends at rest. Such a tool is at rest when it sets off, which a motion model has to
follow, and it shows damping only on its way.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

RAMP = 0.25  # share of a trapezoid's time in which it gains its speed, and loses it again


def _minimum_jerk(u: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    return (
        u**3 * (10.0 + u * (6.0 * u - 15.0)),
        30.0 * u**2 * (1.0 - u) ** 2,
        60.0 * u * (1.0 - u) * (1.0 - 2.0 * u),
    )


def _trapezoid(u: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    top = 1.0 / (1.0 - RAMP)
    begins, ends = u < RAMP, u > 1.0 - RAMP
    way = np.where(begins, 0.5 * top * u**2 / RAMP, top * (u - 0.5 * RAMP))
    way = np.where(ends, 1.0 - 0.5 * top * (1.0 - u) ** 2 / RAMP, way)
    speed = np.where(begins, top * u / RAMP, np.where(ends, top * (1.0 - u) / RAMP, top))
    return way, speed, top / RAMP * (begins.astype(float) - ends.astype(float))


def _half_cosine(u: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    angle = np.pi * u
    return (
        0.5 * (1.0 - np.cos(angle)),
        0.5 * np.pi * np.sin(angle),
        0.5 * np.pi**2 * np.cos(angle),
    )


MOVES: dict[str, Callable[[FloatArray], tuple[FloatArray, FloatArray, FloatArray]]] = {
    "minimum jerk": _minimum_jerk,
    "trapezoid": _trapezoid,
    "half cosine": _half_cosine,
}
"""Way, its first and its second derivative over the share of the time, from 0 to 1."""


@dataclass(frozen=True)
class Presses:
    """Moves one after another, at rest in between.

    Attributes:
        start_mm: displacement at first.
        kind: one of MOVES.
        moves: of each its start [s], its time [s] and its way [mm], in order and apart.
    """

    start_mm: float
    kind: str
    moves: tuple[tuple[float, float, float], ...]

    def evaluate(self, time_s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return displacement [mm], velocity [mm/s], acceleration [mm/s^2], each shape (N,)."""
        displacement = np.full_like(time_s, self.start_mm)
        velocity, acceleration = np.zeros_like(time_s), np.zeros_like(time_s)
        for start, takes, way in self.moves:
            share = (time_s - start) / takes
            moves = (share > 0.0) & (share < 1.0)
            gone, speed, bend = MOVES[self.kind](np.clip(share, 0.0, 1.0))
            displacement += way * gone
            velocity += np.where(moves, way / takes * speed, 0.0)
            acceleration += np.where(moves, way / takes**2 * bend, 0.0)
        return displacement, velocity, acceleration

    @property
    def fastest_mm_s(self) -> float:
        """Largest speed."""
        u = np.linspace(0.0, 1.0, 101)
        top = float(np.max(MOVES[self.kind](u)[1]))
        return max(abs(way) / takes for _, takes, way in self.moves) * top


def random_presses(draw: np.random.Generator, duration_s: float) -> Presses:
    """Presses of 1 to 5 mm in 0.3 to 1.5 s, rests of 0.3 to 1.5 s, from 0.5 mm above the tissue.

    Args:
        draw: where everything is drawn from.
        duration_s: within which they are over.
    """
    kind = str(draw.choice(sorted(MOVES)))
    start, deepest = -0.5, float(draw.uniform(2.0, 5.0))
    takes = float(draw.uniform(0.3, 1.5))
    moves: list[tuple[float, float, float]] = []
    now, place = 1.0, start
    while now < duration_s - 3.0 * takes - 2.0:
        depth = deepest * float(draw.uniform(0.6, 1.0))
        places = [depth, start]
        if draw.uniform() < 0.4:  # a little up, and a rest there
            places.insert(1, depth * float(draw.uniform(0.3, 0.7)))
        for goal in places:
            moves.append((now, takes, goal - place))
            now += takes + float(draw.uniform(0.3, 1.5))
            place = goal
    return Presses(start, kind, tuple(moves))
