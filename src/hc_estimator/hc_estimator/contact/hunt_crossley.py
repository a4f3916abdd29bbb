"""The Hunt-Crossley law F = K d^n + B d^n sign(v) |v|^p, unilateral and with tension.

`hunt_crossley_force` is unilateral: F = max(0, ...), because a tissue that does not stick cannot
pull. `adhesive_force` is the bare formula of the papers, which turns negative when the tool
withdraws quickly.

Units: d in mm, v in mm/s, F in N, so that K is the elastic force at 1 mm and B the damping force
at 1 mm and 1 mm/s.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hc_estimator.compilation import compiled
from hc_estimator.contact.law import ContactLaw

# exp() of more than this would come near the largest double; forces saturate at about 1e260 N,
# far enough below it that sums and squares of a handful of terms in a filter can be checked.
LARGEST_EXPONENT = 600.0
# Below this a number counts as zero, so that its logarithm stays finite.
TINY = 1e-300
# Derivatives with respect to the velocity are taken no nearer to rest than this [mm/s].
SMALLEST_SPEED = 1e-6


@compiled
def adhesive_force(
    displacement: float,
    velocity: float,
    stiffness: float,
    damping: float,
    displacement_exponent: float,
    velocity_exponent: float,
) -> float:
    """Hunt-Crossley force with tension (paper A, Eq. 1; paper B, Eq. 1; paper C, Eq. 12).

    Outside the formula's domain the physics decide: no force without penetration, and the damping
    force takes the sign of the velocity. Finite input gives finite output: a force that would
    overflow saturates.

    Args:
        displacement: penetration d [mm], positive into the tissue.
        velocity: its derivative v [mm/s].
        stiffness: K [N/mm^n].
        damping: B [N (s/mm)^p / mm^n].
        displacement_exponent: n [1].
        velocity_exponent: p [1].

    Returns:
        Force [N], compression positive, tension negative; 0 for d <= 0.
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


@compiled
def hunt_crossley_force(
    displacement: float,
    velocity: float,
    stiffness: float,
    damping: float,
    displacement_exponent: float,
    velocity_exponent: float,
) -> float:
    """Unilateral Hunt-Crossley force, max(0, K d^n + B d^n sign(v) |v|^p) [N].

    A tool that withdraws faster than the tissue follows has left it: the force is 0 at d > 0. The
    arguments are those of `adhesive_force`.
    """
    force = adhesive_force(
        displacement, velocity, stiffness, damping, displacement_exponent, velocity_exponent
    )
    return max(force, 0.0)


@compiled
def adhesive_gradient(
    displacement: float,
    velocity: float,
    stiffness: float,
    damping: float,
    displacement_exponent: float,
    velocity_exponent: float,
    gradient: NDArray[np.float64],
) -> float:
    """Derivatives of `adhesive_force` with respect to d, v, K, B, n and p.

    They are those of `hunt_crossley_force` where that force is positive; in separation its
    derivatives are zero.

    Where the law has an infinite slope (v = 0 with p < 1) the slope at `SMALLEST_SPEED` stands
    for it; at v = 0 the derivatives with respect to B and p are 0.

    Args:
        displacement: as in `adhesive_force`, like all arguments up to `velocity_exponent`.
        velocity: v.
        stiffness: K.
        damping: B.
        displacement_exponent: n.
        velocity_exponent: p.
        gradient: takes the six derivatives, shape (6,); zeros for d <= 0.

    Returns:
        The force [N]; below `SMALLEST_SPEED` with the damping of that speed.
    """
    for i in range(6):
        gradient[i] = 0.0
    if displacement <= TINY:
        return 0.0
    log_displacement = math.log(displacement)
    power = math.exp(min(displacement_exponent * log_displacement, LARGEST_EXPONENT))
    return gradient_at_velocity(
        displacement,
        log_displacement,
        power,
        velocity,
        stiffness,
        damping,
        displacement_exponent,
        velocity_exponent,
        gradient,
    )


@compiled
def gradient_at_velocity(
    displacement: float,
    log_displacement: float,
    power: float,
    velocity: float,
    stiffness: float,
    damping: float,
    displacement_exponent: float,
    velocity_exponent: float,
    gradient: NDArray[np.float64],
) -> float:
    """`adhesive_gradient` where d > 0, ln d and d^n are known."""
    log_power = displacement_exponent * log_displacement
    speed = max(abs(velocity), SMALLEST_SPEED)
    log_speed = math.log(speed)
    drag = math.exp(min(log_power + velocity_exponent * log_speed, LARGEST_EXPONENT))
    gradient[1] = damping * velocity_exponent * drag / speed
    if velocity == 0.0:
        drag = 0.0
    elif velocity < 0.0:
        drag = -drag
    force = stiffness * power + damping * drag
    gradient[0] = displacement_exponent * force / displacement
    gradient[2] = power
    gradient[3] = drag
    gradient[4] = force * log_displacement
    gradient[5] = damping * drag * log_speed
    return force


LAW = ContactLaw(adhesive_force, "F = max(0, K d^n + B d^n sign(v) |v|^p)", adhesive_gradient)
ADHESIVE_LAW = ContactLaw(
    adhesive_force, "F = K d^n + B d^n sign(v) |v|^p", adhesive_gradient, may_pull=True
)
