"""The contact models by name, and the one function through which the kernels reach them.

To add a model: write its force function in a new file, then add its name and a branch here.
"""

from __future__ import annotations

from hc_estimator.compilation import compiled
from hc_estimator.contact.hunt_crossley import hunt_crossley_force

# Numba compiles these names in as constants.
HUNT_CROSSLEY = 0

# The physical range of the exponents.
SMALLEST_DISPLACEMENT_EXPONENT = 0.5
LARGEST_DISPLACEMENT_EXPONENT = 4.0
SMALLEST_VELOCITY_EXPONENT = 0.25
LARGEST_VELOCITY_EXPONENT = 3.0

CONTACT_MODELS = ("hunt_crossley",)  # position = code


@compiled
def contact_force(
    model: int,
    displacement: float,
    velocity: float,
    stiffness: float,
    damping: float,
    displacement_exponent: float,
    velocity_exponent: float,
) -> float:
    """Force [N] of the contact model with the given code; see the models for the arguments.

    The exponents are limited to their physical range here: an estimate may leave it for a while,
    a force computed from it must not explode.
    """
    displacement_exponent = min(
        max(displacement_exponent, SMALLEST_DISPLACEMENT_EXPONENT), LARGEST_DISPLACEMENT_EXPONENT
    )
    velocity_exponent = min(
        max(velocity_exponent, SMALLEST_VELOCITY_EXPONENT), LARGEST_VELOCITY_EXPONENT
    )
    return hunt_crossley_force(
        displacement,
        velocity,
        stiffness,
        damping,
        displacement_exponent,
        velocity_exponent,
    )
