"""What moving the tool takes, off the force: the mass that moves with it, and a drag.

Between force sensor and tissue there is a tool with a mass, and perhaps a grease, a seal or a fluid
that it drags through. The sensor feels m a + c v of it, in the tissue as in the air, and K, B, n
and p are bent to explain that. Velocity and acceleration are taken from the positions around a
reading, before it and after: those of the past alone would be late, and K with a late acceleration
is as wrong as with none. So a reading is handed on when the positions after it are there.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hc_estimator.stream.local_cubic import LONGEST_NS, LocalCubic
from hc_estimator.stream.readings import BEYOND_ANY_SENSOR, FloatArray
from hc_msgs_py.specification import setting

MOVING_MASS = setting(
    "input.force.moving_mass",
    0.0,
    "What the tool between force sensor and tissue weighs: what its acceleration takes is taken "
    "off the force, which is handed on 20 ms later for it. `hc doctor` finds it where the tool "
    "moves free of contact. Of source sensors.",
    minimum=0.0,
    maximum=100.0,
    unit="kg",
)
DAMPING = setting(
    "input.force.damping",
    0.0,
    "Of what drags on the tool between force sensor and tissue, by its speed (a seal, a guide): "
    "taken off the force as moving_mass is, and found as it is. Of source sensors.",
    minimum=0.0,
    maximum=1000.0,
    unit="N s/mm",
)
SETTINGS = (MOVING_MASS, DAMPING)
TONNES = 1e-3
"""In a kilogram: N s^2/mm."""
_BEFORE_ALL_NS = -(2**62)


class Reading(NamedTuple):
    """A sample on its way.

    Attributes:
        stamp_ns: of the sample.
        sequence: its number.
        displacement_mm: penetration [mm]; NaN without a reading.
        force_n: force [N]; NaN without a reading.
        nothing: whether nothing is left of what was read.
    """

    stamp_ns: int
    sequence: int
    displacement_mm: float
    force_n: float
    nothing: bool = False


class ToolMotion:
    """Holds readings back until the motion at their stamps is known, and takes off what it took.

    Attributes:
        mass_kg: what moves with the tool.
        damping: of what drags on it [N s/mm]. While both are 0 all is handed on at once.
        unknown: forces that were given on as NaN.
    """

    def __init__(self, mass_kg: float = 0.0, damping: float = 0.0) -> None:
        self.mass_kg, self.damping = mass_kg, damping
        self.unknown = 0
        self._held: deque[Reading] = deque()
        self._cubic = LocalCubic()
        self._newest_ns = _BEFORE_ALL_NS

    def configure(self, values: Mapping[str, Any]) -> None:
        """Take other settings, by their names of the node; what is left out is its default."""
        self.mass_kg = values.get(MOVING_MASS.name, MOVING_MASS.default)
        self.damping = values.get(DAMPING.name, DAMPING.default)

    def take(self, reading: Reading) -> list[Reading]:
        """Take in a reading; return those that are complete, in their order.

        A force of which the motion is not known (at the beginning, in a gap of the positions) is
        NaN.
        """
        if not (self.mass_kg or self.damping):
            return [*self.rest(), reading] if self._held else [reading]
        stamp_ns = reading.stamp_ns
        given = self.rest() if stamp_ns < self._newest_ns - LONGEST_NS else []
        self._newest_ns = max(self._newest_ns, stamp_ns)
        self._held.append(reading)
        if abs(reading.displacement_mm) < BEYOND_ANY_SENSOR:  # which NaN is not
            self._cubic.add(stamp_ns, reading.displacement_mm)
        while self._held and self._is_due(self._held[0]):
            oldest = self._held.popleft()
            if not math.isnan(oldest.force_n):
                velocity, acceleration = self._cubic.motion_at(oldest.stamp_ns)
                taken_n = self.damping * velocity + TONNES * self.mass_kg * acceleration
                oldest = self._with_force(oldest, oldest.force_n - taken_n)
            given.append(oldest)
        return given

    def rest(self) -> list[Reading]:
        """Return what is still held, without forces, and begin anew."""
        given = [
            reading if math.isnan(reading.force_n) else self._with_force(reading, math.nan)
            for reading in self._held
        ]
        self.forget()
        return given

    def forget(self) -> None:
        """Begin anew, without what is held."""
        self._held.clear()
        self._cubic.clear()
        self._newest_ns = _BEFORE_ALL_NS

    def _is_due(self, oldest: Reading) -> bool:
        """Whether a reading need not wait, or waited in vain."""
        return (
            math.isnan(oldest.force_n)
            or self._cubic.reaches(oldest.stamp_ns)
            or self._newest_ns - oldest.stamp_ns > LONGEST_NS
        )

    def _with_force(self, reading: Reading, force_n: float) -> Reading:
        """Return a reading with another force [N]."""
        unknown = math.isnan(force_n)
        self.unknown += unknown
        nothing = unknown and math.isnan(reading.displacement_mm)
        return reading._replace(force_n=force_n, nothing=nothing)

    def of_many(
        self, stamps_ns: NDArray[np.int64], displacements_mm: FloatArray, forces_n: FloatArray
    ) -> FloatArray:
        """Return the forces [N] of a whole recording less what the motion took, shape (n,)."""
        if not (self.mass_kg or self.damping):
            return forces_n
        given: list[Reading] = []
        rows = zip(stamps_ns.tolist(), displacements_mm.tolist(), forces_n.tolist(), strict=True)
        for sequence, (stamp_ns, displacement_mm, force_n) in enumerate(rows):
            given += self.take(Reading(stamp_ns, sequence, displacement_mm, force_n))
        given += self.rest()
        return np.array([reading.force_n for reading in given], np.float64)
