"""The Kelvin-Voigt law F = K d + B v: a linear spring and damper side by side.

Its force jumps where contact begins or ends at a velocity, which real tissue does not do; it is
here because it is what many robots are still controlled with.
"""

from __future__ import annotations

from hc_estimator.compilation import compiled


@compiled
def kelvin_voigt_force(
    displacement: float, velocity: float, stiffness: float, damping: float
) -> float:
    """Contact force of the Kelvin-Voigt law (named in the introductions of papers A and B).

    Args:
        displacement: penetration d [mm].
        velocity: its derivative v [mm/s].
        stiffness: K [N/mm].
        damping: B [N s/mm].

    Returns:
        Force [N]; 0 for d <= 0.
    """
    if displacement <= 0.0:
        return 0.0
    return stiffness * displacement + damping * velocity
