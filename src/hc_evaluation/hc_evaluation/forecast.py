"""Which motion would show a parameter that the motion so far does not show.

The Fisher information of a stroke to come, at the parameters that are known now, adds to the
information that the estimate has; its inverse is the bound on what any estimator will know after
the stroke. Coordinates are ln K, ln B, n, p, so that the deviations of K and B are relative ones.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hc_estimator.contact.arrays import force_gradient

FloatArray = NDArray[np.float64]

SPEEDS_MM_S = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)
"""What a robot or a hand may be asked for."""
STROKES = (1, 3, 10)
NAMES = ("K", "B", "n", "p")
WANTED = (0.05, 0.10, 0.05, 0.10)
"""Deviations that are good enough: K and B relative, n and p absolute."""
MOST_POINTS = 20_000
"""Of a stroke: a rate that stamps of nanoseconds apart seem to have must not fill the memory."""


class Forecast(NamedTuple):
    """The least motion that gives a parameter as well as wanted.

    Attributes:
        parameter: K, B, n or p.
        strokes: number of strokes in and out.
        depth_mm: how deep.
        speeds_mm_s: at which speeds; with two of them half the strokes at each.
        std: what is then known: relative for K and B, absolute for n and p.
    """

    parameter: str
    strokes: int
    depth_mm: float
    speeds_mm_s: tuple[float, ...]
    std: float

    @property
    def sentence(self) -> str:
        """The forecast in words."""
        speeds = " and ".join(f"{speed:g}" for speed in self.speeds_mm_s)
        strokes = "one stroke" if self.strokes == 1 else f"{self.strokes} strokes"
        if self.parameter in "KB":
            known = f"to {100 * self.std:.0f} %" if self.std >= 0.01 else "to better than 1 %"
        else:
            known = f"to {self.std:.2g}" if self.std >= 0.01 else "to better than 0.01"
        return (
            f"{strokes} of {self.depth_mm:.2g} mm at {speeds} mm/s "
            f"{'gives' if self.strokes == 1 else 'give'} {self.parameter} {known}"
        )


def stroke(depth_mm: float, speed_mm_s: float, rate_hz: float) -> tuple[FloatArray, FloatArray]:
    """Return depth and speed of one stroke in and out at constant speed, shape (N,) each."""
    half = np.arange(1, max(2, round(depth_mm / speed_mm_s * rate_hz))) * speed_mm_s / rate_hz
    speeds = np.full(half.size, speed_mm_s)
    return np.concatenate((half, half[::-1])), np.concatenate((speeds, -speeds))


def forecast(
    parameters: FloatArray,
    covariance: FloatArray,
    *,
    force_noise_std: float,
    depth_mm: float,
    rate_hz: float,
    fastest_mm_s: float = 50.0,
) -> list[Forecast]:
    """Find, for every parameter that is not known well enough, the least motion that shows it.

    Args:
        parameters: K, B, n, p as they are known, shape (4,).
        covariance: of them, shape (4, 4).
        force_noise_std: deviation of the force readings from the law [N], model error included.
        depth_mm: how deep the tool may press.
        rate_hz: samples a second.
        fastest_mm_s: how fast it may move.

    Returns:
        One forecast for each of those parameters for which a motion was found; empty if all are
        known well enough, or if there is nothing to start from.
    """
    if not (np.isfinite(parameters).all() and np.isfinite(covariance).all() and depth_mm > 0.0):
        return []
    if not 0.0 < rate_hz < np.inf:
        return []
    scale = np.array([max(parameters[0], 1e-12), max(parameters[1], 1e-12), 1.0, 1.0])
    known = covariance / np.outer(scale, scale)
    deviations = np.sqrt(np.diagonal(known))
    # A parameter that the data said nothing about may have any deviation: a wide prior instead.
    prior = _inverse(known + 1e-12 * np.eye(4))
    if prior is None:
        return []
    speeds = [speed for speed in SPEEDS_MM_S if speed <= fastest_mm_s]
    plans: list[tuple[float, ...]] = [(speed,) for speed in speeds]
    plans += [(slow, fast) for fast in speeds for slow in speeds if 4.0 * slow <= fast]
    information = {}
    for speed in speeds:
        taken_hz = min(rate_hz, 0.5 * MOST_POINTS * speed / depth_mm)
        strokes_in_and_out = stroke(depth_mm, speed, taken_hz)
        rows = force_gradient(*strokes_in_and_out, parameters)[:, 2:] / force_noise_std
        information[speed] = rate_hz / taken_hz * (rows.T @ rows)
    result = []
    for index, wanted in enumerate(WANTED):
        if deviations[index] <= wanted:
            continue
        found = _least(index, wanted, prior, information, plans, depth_mm)
        if found is not None:
            result.append(found)
    return result


def _least(
    index: int,
    wanted: float,
    prior: FloatArray,
    information: dict[float, FloatArray],
    plans: list[tuple[float, ...]],
    depth_mm: float,
) -> Forecast | None:
    """Return the plan with the fewest strokes that is good enough, of these the slowest."""
    for strokes in STROKES:
        for plan in sorted(plans, key=lambda speeds: (max(speeds), len(speeds))):
            if len(plan) > strokes:
                continue
            added = sum((information[speed] for speed in plan), np.zeros((4, 4)))
            bound = _inverse(prior + strokes / len(plan) * added)
            if bound is None:
                continue
            deviation = float(np.sqrt(bound[index, index]))
            if deviation <= wanted:
                return Forecast(NAMES[index], strokes, depth_mm, plan, deviation)
    return None


def _inverse(matrix: FloatArray) -> FloatArray | None:
    """Return the inverse; None if the numbers are so far apart that there is none."""
    try:
        return np.asarray(np.linalg.inv(matrix), np.float64)
    except np.linalg.LinAlgError:
        return None
