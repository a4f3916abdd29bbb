"""The Kelvin-Voigt law F = K d + B v: a linear spring and damper side by side.

Its force jumps where contact begins or ends at a velocity, which real tissue does not do; it is
here because it is what many robots are still controlled with.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hc_estimator.compilation import compiled
from hc_estimator.contact.law import ESTIMATED, ContactLaw


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


@compiled
def force(
    displacement: float, velocity: float, stiffness: float, damping: float, n: float, p: float
) -> float:
    """Force with the arguments that every law has; n and p do nothing here."""
    return kelvin_voigt_force(displacement, velocity, stiffness, damping)


@compiled
def gradient(
    displacement: float,
    velocity: float,
    stiffness: float,
    damping: float,
    n: float,
    p: float,
    gradient: NDArray[np.float64],
) -> float:
    """Derivatives with respect to d, v, K and B; returns the force [N]."""
    if displacement > 0.0:
        gradient[0] = stiffness
        gradient[1] = damping
        gradient[2] = displacement
        gradient[3] = velocity
    return kelvin_voigt_force(displacement, velocity, stiffness, damping)


LAW = ContactLaw(force, "F = K d + B v", gradient, fixed=(ESTIMATED, ESTIMATED, 1.0, 1.0))
