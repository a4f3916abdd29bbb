"""The Hunt-Crossley law F = K d^n + B d^n sign(v) |v|^p with its physical guards.

Units: d in mm, v in mm/s, F in N, so that K is the elastic force at 1 mm and B the damping force
at 1 mm and 1 mm/s.
"""

from __future__ import annotations

import math

from hc_estimator.compilation import compiled

# exp() of more than this would come near the largest double; forces saturate at about 1e260 N,
# far enough below it that sums and squares of a handful of terms in a filter can be checked.
LARGEST_EXPONENT = 600.0
# Below this a number counts as zero, so that its logarithm stays finite.
TINY = 1e-300


@compiled
def hunt_crossley_force(
    displacement: float,
    velocity: float,
    stiffness: float,
    damping: float,
    displacement_exponent: float,
    velocity_exponent: float,
) -> float:
    """Contact force of the Hunt-Crossley law (paper A, Eq. 1; paper B, Eq. 1; paper C, Eq. 12).

    Outside the formula's domain the physics decide: no force without penetration (no adhesion),
    and the damping force takes the sign of the velocity. Finite input gives finite output: a force
    that would overflow saturates.

    Args:
        displacement: penetration d [mm], positive into the tissue.
        velocity: its derivative v [mm/s].
        stiffness: K [N/mm^n].
        damping: B [N (s/mm)^p / mm^n].
        displacement_exponent: n [1].
        velocity_exponent: p [1].

    Returns:
        Force [N], compression positive; 0 for d <= 0.
    """
    if displacement <= TINY:
        return 0.0
    log_power = displacement_exponent * math.log(displacement)
    force = stiffness * math.exp(min(log_power, LARGEST_EXPONENT))
    speed = abs(velocity)
    if speed > TINY:
        log_power += velocity_exponent * math.log(speed)
        drag = damping * math.exp(min(log_power, LARGEST_EXPONENT))
        force += drag if velocity > 0.0 else -drag
    return force
