"""Contact force without a force sensor: from a tool's position and its motor's effort.

A disturbance observer after De Luca and Mattone (2003): what the motor pushes and the motion does
not show is the contact. m v' = u - b v - f(v) - F, so F = u - b v - f(v) - m v', brought through a
low-pass because the differences of the position's readings are noise. The displacement that goes
with the force passes the same low-pass: what is late by the same does not look like damping.
"""

from __future__ import annotations

import math

from hc_estimator.stream.force_filter import ForceFilter

SETTLING_PERIODS = 5.0
"""Of the low-pass after a gap: of what a pole did not know, e^-5 (0.7 %) is left."""


class DisturbanceObserver(ForceFilter):
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
        super().__init__()
        self._position = 0.0
        # Two stages of the low-pass for middle position, velocity, effort and dry friction; the
        # friction is that of the velocity after the first stage, without which noise would chatter.
        self._first = [0.0, 0.0, 0.0]
        self._second = [0.0, 0.0, 0.0, 0.0]

    def _begin(self, position_mm: float) -> tuple[float, float]:
        self._first = [position_mm, 0.0, self._effort]
        self._second = [*self._first, 0.0]
        self._position = position_mm
        return position_mm, self._effort

    def _resume(self, elapsed: float, position_mm: float, velocity_mm_s: float) -> None:
        self._first = [position_mm - 0.5 * elapsed * velocity_mm_s, velocity_mm_s, self._effort]
        dry = self._friction * math.tanh(velocity_mm_s / self._friction_velocity)
        self._second = [*self._first, dry]
        self._position = position_mm

    def _is_known(self, since_s: float) -> bool:
        return self._rate * since_s >= SETTLING_PERIODS

    def _follow(self, elapsed: float, position_mm: float, effort_n: float) -> tuple[float, float]:
        velocity = (position_mm - self._position) / elapsed
        # The velocity is that of the middle between two readings, and so is everything else.
        now = (0.5 * (position_mm + self._position), velocity, effort_n)
        weight = 1.0 - math.exp(-self._rate * elapsed)
        before = list(self._second)
        for i in range(3):
            self._first[i] += weight * (now[i] - self._first[i])
            self._second[i] += weight * (self._first[i] - self._second[i])
        dry = self._friction * math.tanh(self._first[1] / self._friction_velocity)
        self._second[3] += weight * (dry - self._second[3])
        self._position = position_mm
        # A difference of two middles belongs to the reading between them: so do these means.
        place, speed, push, dry = (0.5 * (a + b) for a, b in zip(before, self._second, strict=True))
        acceleration = (self._second[1] - before[1]) / elapsed
        held = self._damping * speed + self._spring * place + dry
        return place, push - held - self._mass * acceleration
