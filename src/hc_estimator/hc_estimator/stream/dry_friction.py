"""Dry friction between the force sensor and the tissue, taken off the force.

Where the sensor sits outside and the tool goes in through a cannula (a trocar's seal, a bearing, a
cable), it feels what holds the tool back: more force on the way in, less on the way out, and K, B,
n and p are bent to explain it. Prandtl's elasto-plastic element (Popov and Gray, "Prandtl-Tomlinson
model", ZAMM 92 (2012) 683) describes it by the way alone, without a velocity, which a position's
noise would make chatter: after a turn the friction follows the way like a spring, until it slides.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from hc_estimator.stream.readings import FloatArray
from hc_msgs_py.specification import setting

DRY_FRICTION = setting(
    "input.force.dry_friction",
    0.0,
    "What holds the tool back on its way from the force sensor to the tissue (a cannula's seal, a "
    "bearing): taken off the force on the way in, added to it on the way out. `hc doctor` finds it "
    "where the tool moves free of contact. Not of source effort, which has its own.",
    minimum=0.0,
    maximum=1000.0,
    unit="N",
)
PRESLIDING = setting(
    "input.force.presliding",
    0.02,
    "Of dry_friction: how far the tool moves from rest until it slides; twice as far after a turn.",
    minimum=1e-4,
    maximum=100.0,
    unit="mm",
)
SETTINGS = (DRY_FRICTION, PRESLIDING)
TAKEN_OFF_ALREADY = f"{DRY_FRICTION.name}.taken_off"
"""In a configuration: of samples that are recorded less it."""


class DryFriction:
    """Says what friction does to the force at each sample of a stream.

    Attributes:
        newtons: friction of the tool that slides [N]; while it is 0 no displacement is kept.
        presliding_mm: displacement from rest at which the tool begins to slide [mm].
    """

    def __init__(self, newtons: float = 0.0, presliding_mm: float = 0.02) -> None:
        self.newtons, self.presliding_mm = newtons, presliding_mm
        self._middle_mm: float | None = None  # where the tool would be free of friction
        self._strain = 0.0

    def configure(self, values: Mapping[str, Any]) -> None:
        """Take other settings, by their names of the node; what is left out is its default."""
        self.newtons = values.get(DRY_FRICTION.name, DRY_FRICTION.default)
        self.presliding_mm = values.get(PRESLIDING.name, PRESLIDING.default)

    def at(self, displacement_mm: float) -> float:
        """Take in a sample; return what friction adds to its force [N], negative on the way out.

        Args:
            displacement_mm: penetration [mm]; NaN without a reading: the last one counts.
        """
        if self.newtons == 0.0:
            return 0.0
        if math.isfinite(displacement_mm):
            middle, way = self._middle_mm, self.presliding_mm
            if middle is None:  # it may be strained either way
                middle = displacement_mm
            strain = (displacement_mm - middle) / way
            if abs(strain) > 1.0:  # it slides
                strain = math.copysign(1.0, strain)
                middle = displacement_mm - strain * way
            self._middle_mm, self._strain = middle, strain
        return self.newtons * self._strain

    def of_many(self, displacements_mm: FloatArray) -> FloatArray:
        """As `at` for each of many samples, shape (n,)."""
        if self.newtons == 0.0:
            return np.zeros(len(displacements_mm))
        return np.array([self.at(one) for one in displacements_mm.tolist()])
