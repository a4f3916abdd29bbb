"""A tissue that relaxes under a tool: quasi-linear viscoelasticity that lets go and recovers.

What the contact law says is the elastic response; of it, shares are let go with time constants of
their own (Fung, Biomechanics: Mechanical Properties of Living Tissues, 1993, 7.6). Where the tool
leaves faster than the tissue follows, the force is zero, and the tissue recovers by itself.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]

SHORTEST_S, LONGEST_S = 0.05, 5.0  # time constants of soft tissue, as far as ten seconds show them
PROCESSES = 3
SHARES = (0.05, 0.2)  # of the force, for each


@dataclass(frozen=True)
class Relaxation:
    """Shares of the elastic response that are let go, and their time constants [s], (M,) each."""

    shares: FloatArray
    times: FloatArray


def draw_relaxation(draw: np.random.Generator) -> Relaxation:
    """Three processes over two decades of time, which take 15 to 60 % of the force in all."""
    times = np.exp(draw.uniform(np.log(SHORTEST_S), np.log(LONGEST_S), PROCESSES))
    return Relaxation(draw.uniform(*SHARES, PROCESSES), times)


def relaxing_force(elastic: ArrayLike, step_s: float, relaxation: Relaxation) -> FloatArray:
    """Force [N] of a tissue that relaxes, shape (N,).

    Args:
        elastic: what the contact law says [N], shape (N,).
        step_s: time between two of them [s].
        relaxation: what is let go.
    """
    shares = -np.expm1(-step_s / relaxation.times)
    remembered = np.zeros(relaxation.times.size)
    response = np.asarray(elastic, np.float64)
    force = np.zeros(response.size)
    for k in range(response.size):
        released = float(relaxation.shares @ remembered)
        force[k] = max(response[k] - released, 0.0)
        # A surface that the tool has left is where nothing pushes it.
        now = response[k] if force[k] > 0.0 else released
        remembered += shares * (now - remembered)
    return force
