"""Contact force without a force sensor: from a tool's position and its motor's effort.

A disturbance observer after De Luca and Mattone (2003): what the motor pushes and the motion does
not show is the contact. m v' = u - b v - f(v) - F, so F = u - b v - f(v) - m v', brought through a
low-pass because the differences of the position's readings are noise. The displacement that goes
with the force passes the same low-pass: what is late by the same does not look like damping.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

LONGEST_GAP_S = 0.1
"""After a longer gap in the readings the observer begins anew."""


class DisturbanceObserver:
    """Takes readings of position and effort, gives displacement and force of the same instant.

    Both are late by the low-pass, two poles at `bandwidth_hz`, and one sample. Whatever of mass,
    damping and friction is not as told appears in the force.
    """

    def __init__(
        self,
        *,
        mass_kg: float,
        damping: float = 0.0,
        spring: float = 0.0,
        dry_friction_n: float = 0.0,
        friction_velocity_mm_s: float = 0.5,
        bandwidth_hz: float = 15.0,
    ) -> None:
        """Tell it the tool.

        Args:
            mass_kg: what the motor moves [kg].
            damping: viscous friction [N s/mm].
            spring: of the tool's drive about position zero [N/mm].
            dry_friction_n: dry friction [N], f(v) = dry_friction tanh(v / friction_velocity).
            friction_velocity_mm_s: see there [mm/s].
            bandwidth_hz: of the low-pass [Hz].

        Raises:
            ValueError: a value is not finite, negative, or zero where it must not be.
        """
        given = {
            "mass_kg": mass_kg,
            "damping": damping,
            "spring": spring,
            "dry_friction_n": dry_friction_n,
            "friction_velocity_mm_s": friction_velocity_mm_s,
            "bandwidth_hz": bandwidth_hz,
        }
        for name, value in given.items():
            if not (math.isfinite(value) and value >= 0.0):
                raise ValueError(f"{name} is {value!r}, must be a finite number, not negative")
            if value == 0.0 and name in ("friction_velocity_mm_s", "bandwidth_hz"):
                raise ValueError(f"{name} is 0, must be above it")
        self._mass = 1e-3 * mass_kg  # N s^2/mm
        self._damping = damping
        self._spring = spring
        self._friction = dry_friction_n
        self._friction_velocity = friction_velocity_mm_s
        self._rate = 2.0 * math.pi * bandwidth_hz
        self.reset()

    def reset(self) -> None:
        """Forget all readings."""
        self._time = -math.inf
        self._position = 0.0
        self._effort = 0.0
        # Two stages of the low-pass for middle position, velocity, effort and dry friction; the
        # friction is that of the velocity after the first stage, without which noise would chatter.
        self._first = [0.0, 0.0, 0.0]
        self._second = [0.0, 0.0, 0.0, 0.0]

    def step(self, time_s: float, position_mm: float, effort_n: float) -> tuple[float, float]:
        """Use one reading.

        Args:
            time_s: stamp [s].
            position_mm: of the tool, positive into the tissue [mm].
            effort_n: force of the motor from this stamp on, positive into the tissue [N].

        Returns:
            Displacement [mm] and force [N] of the same instant. NaN, NaN for a reading that is not
            finite or not later than the last one: it is not used.
        """
        elapsed = time_s - self._time
        if not (math.isfinite(time_s + position_mm + effort_n) and elapsed > 0.0):
            return math.nan, math.nan
        if elapsed > LONGEST_GAP_S:
            self._first = [position_mm, 0.0, effort_n]
            self._second = [*self._first, 0.0]
            self._time, self._position, self._effort = time_s, position_mm, effort_n
            return position_mm, effort_n
        velocity = (position_mm - self._position) / elapsed
        # The velocity is that of the middle between two readings, and so is everything else.
        now = (0.5 * (position_mm + self._position), velocity, self._effort)
        weight = 1.0 - math.exp(-self._rate * elapsed)
        before = list(self._second)
        for i in range(3):
            self._first[i] += weight * (now[i] - self._first[i])
            self._second[i] += weight * (self._first[i] - self._second[i])
        dry = self._friction * math.tanh(self._first[1] / self._friction_velocity)
        self._second[3] += weight * (dry - self._second[3])
        self._time, self._position, self._effort = time_s, position_mm, effort_n
        # A difference of two middles belongs to the reading between them: so do these means.
        place, speed, push, dry = (0.5 * (a + b) for a, b in zip(before, self._second, strict=True))
        acceleration = (self._second[1] - before[1]) / elapsed
        held = self._damping * speed + self._spring * place + dry
        return place, push - held - self._mass * acceleration

    def run(
        self, time_s: FloatArray, position_mm: FloatArray, effort_n: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Use many readings; the same as `step` for each.

        Args:
            time_s: stamps [s], shape (samples,).
            position_mm: positions [mm], the same shape.
            effort_n: efforts [N], the same shape.

        Returns:
            Displacements and forces, shape (samples,) each.
        """
        found = np.empty((len(time_s), 2))
        readings = zip(time_s.tolist(), position_mm.tolist(), effort_n.tolist(), strict=True)
        for k, reading in enumerate(readings):
            found[k] = self.step(*reading)
        return found[:, 0], found[:, 1]
