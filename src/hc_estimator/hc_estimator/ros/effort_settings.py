"""Settings of the node for `input.source: effort`: a joint's position and motor effort."""

from __future__ import annotations

from typing import Any

from hc_estimator.stream.effort_filters import METHODS, EffortSettings
from hc_msgs_py.specification import ParameterSpecification, setting


def _settings() -> tuple[ParameterSpecification, ...]:
    """Return what source effort has: the filter, the slave, the noise, paper C's tissue."""
    default = EffortSettings()

    def one(
        name: str, value: Any, text: str, unit: str = "", **more: Any
    ) -> ParameterSpecification:
        if isinstance(value, float):
            more = {"minimum": 0.0, "maximum": 1e6, **more}
        return setting(f"input.effort.{name}", value, text, unit=unit, **more)

    return (
        one(
            "method",
            default.method,
            "observer: disturbance observer; extended, unscented: Kalman filters with the contact "
            "force as a state; sir_pf: paper C's particles, equation 26 as printed.",
            choices=METHODS,
        ),
        one(
            "scale",
            1.0,
            "Newtons per unit of effort; the sign of the position turns it as well: negative for a "
            "driver that tells effort and position with opposite signs.",
            minimum=-1e6,
        ),
        one("mass", default.mass_kg, "What the motor moves.", "kg"),
        one("damping", default.damping, "Viscous friction of the joint.", "N s/mm"),
        one("spring", default.spring, "Spring of the joint about position zero.", "N/mm"),
        one("dry_friction", default.dry_friction_n, "Dry friction, F tanh(v / v_0).", "N"),
        one("friction_velocity", default.friction_velocity_mm_s, "v_0 of dry friction.", "mm/s"),
        one("bandwidth", default.bandwidth_hz, "Of the observer's low-pass.", "Hz"),
        one(
            "position_noise",
            default.position_noise_mm,
            "Standard deviation of a position reading, for all but the observer.",
            "mm",
        ),
        one(
            "effort_noise",
            default.effort_noise_n,
            "Standard deviation of an effort reading and of what is not modelled, for extended "
            "and unscented.",
            "N",
        ),
        one(
            "force_jerk",
            default.force_jerk,
            "Density of the noise that drives the force's rate, for extended and unscented.",
            "N^2/s^3",
            maximum=1e12,
        ),
        one(
            "tissue",
            list(default.tissue),
            "K, B, n that sir_pf knows (p = 1, surface at input.position.zero).",
        ),
        one("particles", default.particles, "Of sir_pf.", minimum=2, maximum=10000),
        one("sigma", list(default.sigma), "Noise per step of sir_pf [mm, mm/s, N]."),
        one("seed", default.seed, "Of sir_pf's noise.", minimum=0, maximum=2**31),
    )


EFFORT_SETTINGS = _settings()
