"""What varies under the tool: tissue along a sideways way, and a surface that moves.

The same bells as the rig's inclusion (1 + (factor - 1) exp(-(y - y0)^2 / 2 w^2)), softer or harder,
edges between two layers, damping and exponents that follow or go their own way; a surface that
breathes and drifts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Way:
    """Sideways there and back, again and again, each leg with minimum jerk.

    Attributes:
        length_mm: how far it goes.
        there_s: time of one leg.
    """

    length_mm: float
    there_s: float

    def position(self, time_s: FloatArray) -> FloatArray:
        """Sideways position [mm] at each instant, shape (N,)."""
        leg = np.mod(time_s / self.there_s, 2.0)
        u = np.where(leg < 1.0, leg, 2.0 - leg)
        way: FloatArray = self.length_mm * u**3 * (10.0 + u * (6.0 * u - 15.0))
        return way


@dataclass(frozen=True)
class Inclusion:
    """Something under the surface that is felt along the way.

    Attributes:
        centre_mm: where, sideways.
        width_mm: standard deviation of the bell, or half the width of the edge.
        stiffness_factor: of K at the centre, or behind the edge.
        damping_factor: of B there.
        exponent_difference: added to n there.
        edge: whether the tissue stays different behind it (a layer begins) instead of coming back.
    """

    centre_mm: float
    width_mm: float
    stiffness_factor: float
    damping_factor: float = 1.0
    exponent_difference: float = 0.0
    edge: bool = False

    def share(self, way_mm: FloatArray) -> FloatArray:
        """How much of it is felt at each place, 0 to 1, shape (N,)."""
        distance = (way_mm - self.centre_mm) / self.width_mm
        if self.edge:
            return np.asarray(0.5 * (1.0 + np.tanh(distance)), dtype=np.float64)
        return np.asarray(np.exp(-0.5 * distance * distance), dtype=np.float64)


def along_the_way(
    parameters: FloatArray, way_mm: FloatArray, inclusions: tuple[Inclusion, ...]
) -> FloatArray:
    """K, B, n, p at each place, shape (N, 4), from those of the tissue around, shape (N, 4)."""
    varied = parameters.copy()
    for inclusion in inclusions:
        share = inclusion.share(way_mm)
        varied[:, 0] *= 1.0 + (inclusion.stiffness_factor - 1.0) * share
        varied[:, 1] *= 1.0 + (inclusion.damping_factor - 1.0) * share
        varied[:, 2] += inclusion.exponent_difference * share
    return varied


@dataclass(frozen=True)
class Surface:
    """The displacement reading at which the tissue begins, over time.

    Attributes:
        breathing_mm: amplitude of its breathing.
        breathing_hz: frequency.
        phase_rad: phase.
        drift_mm_s: steady drift, positive away from the tool.
    """

    breathing_mm: float = 0.0
    breathing_hz: float = 0.25
    phase_rad: float = 0.0
    drift_mm_s: float = 0.0

    def evaluate(self, time_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Position [mm], 0 at the time 0, and velocity [mm/s], each shape (N,)."""
        rate = 2.0 * np.pi * self.breathing_hz
        angle = rate * time_s + self.phase_rad
        position = self.breathing_mm * (np.sin(angle) - np.sin(self.phase_rad))
        velocity = self.breathing_mm * rate * np.cos(angle) + self.drift_mm_s
        return position + self.drift_mm_s * time_s, velocity
