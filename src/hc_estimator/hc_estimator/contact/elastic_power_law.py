"""The elastic power law F = K d^n: Hunt-Crossley without damping (n = 1.5: Hertz).

For recordings at a constant, slow speed, where damping cannot be seen anyway.
"""

from __future__ import annotations

import math

from hc_estimator.compilation import compiled
from hc_estimator.contact.hunt_crossley import LARGEST_EXPONENT, TINY


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
