"""The elastic power law F = K d^n: Hunt-Crossley without damping (n = 1.5: Hertz).

For recordings at a constant, slow speed, where damping cannot be seen anyway.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hc_estimator.compilation import compiled
from hc_estimator.contact.hunt_crossley import LARGEST_EXPONENT, TINY, adhesive_gradient
from hc_estimator.contact.law import ESTIMATED, ContactLaw


@compiled
def elastic_power_law_force(
    displacement: float, stiffness: float, displacement_exponent: float
) -> float:
    """Contact force of the elastic power law.

    Args:
        displacement: penetration d [mm].
        stiffness: K [N/mm^n].
        displacement_exponent: n [1].

    Returns:
        Force [N]; 0 for d <= 0; saturates instead of overflowing.
    """
    if displacement <= TINY:
        return 0.0
    log_power = displacement_exponent * math.log(displacement)
    return stiffness * math.exp(min(log_power, LARGEST_EXPONENT))


@compiled
def force(
    displacement: float, velocity: float, stiffness: float, damping: float, n: float, p: float
) -> float:
    """Force with the arguments that every law has; v, B and p do nothing here."""
    return elastic_power_law_force(displacement, stiffness, n)


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
    """Derivatives with respect to d, K and n, and the force [N]: Hunt-Crossley without damping."""
    force = adhesive_gradient(displacement, velocity, stiffness, 0.0, n, p, gradient)
    gradient[3] = 0.0
    return force


LAW = ContactLaw(force, "F = K d^n", gradient, fixed=(ESTIMATED, 0.0, ESTIMATED, 1.0))
