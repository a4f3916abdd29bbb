"""The contact models by name, and the functions through which the kernels reach them.

To add a model: write its force function in a new file, then add its name and a branch in each
function here. A model need not use all four parameters K, B, n, p: `fixed_value` says which of
them it lacks and what is reported in their place.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hc_estimator.compilation import compiled
from hc_estimator.contact.elastic_power_law import elastic_power_law_force
from hc_estimator.contact.hunt_crossley import adhesive_force, adhesive_gradient
from hc_estimator.contact.kelvin_boltzmann import kelvin_boltzmann_force
from hc_estimator.contact.kelvin_voigt import kelvin_voigt_force
from hc_estimator.specification import ParameterSpecification

HUNT_CROSSLEY = 0
KELVIN_VOIGT = 1
KELVIN_BOLTZMANN = 2
ELASTIC_POWER_LAW = 3
ADHESIVE = 4

CONTACT_MODELS = (  # position = code
    "hunt_crossley",
    "kelvin_voigt",
    "kelvin_boltzmann",
    "elastic_power_law",
    "adhesive",
)

# Parameters that only one model has.
SPECIFICATIONS: dict[str, tuple[ParameterSpecification, ...]] = {
    "kelvin_boltzmann": (
        ParameterSpecification(
            "relaxation_time",
            "float",
            1.0,
            "Time constant with which the force relaxes during a hold; given, not estimated.",
            minimum=1e-3,
            maximum=1e4,
            unit="s",
        ),
    ),
}

# The physical range of the exponents.
SMALLEST_DISPLACEMENT_EXPONENT = 0.5
LARGEST_DISPLACEMENT_EXPONENT = 4.0
SMALLEST_VELOCITY_EXPONENT = 0.25
LARGEST_VELOCITY_EXPONENT = 3.0


@compiled
def has_lagged_velocity(model: int) -> bool:
    """True if the last state is not p but the lagged velocity of the model."""
    return model == KELVIN_BOLTZMANN


@compiled
def end_of_parameters(model: int) -> int:
    """Index after the last parameter in the state; a lagged velocity belongs to the motion."""
    return 6 if has_lagged_velocity(model) else 7


@compiled
def fixed_value(model: int, parameter: int) -> float:
    """What is reported for a parameter (0 to 3: K, B, n, p) that the model lacks; NaN if it has it.

    Such a parameter is not estimated: its variance is zero from the start.
    """
    if model in (KELVIN_VOIGT, KELVIN_BOLTZMANN) and parameter >= 2:
        return 1.0
    if model == ELASTIC_POWER_LAW and parameter == 1:
        return 0.0
    if model == ELASTIC_POWER_LAW and parameter == 3:
        return 1.0
    return math.nan


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

    Unilateral but for `adhesive`. The exponents are limited to their physical range here: an
    estimate may leave it for a while, a force computed from it must not explode.
    """
    n = min(
        max(displacement_exponent, SMALLEST_DISPLACEMENT_EXPONENT), LARGEST_DISPLACEMENT_EXPONENT
    )
    p = min(max(velocity_exponent, SMALLEST_VELOCITY_EXPONENT), LARGEST_VELOCITY_EXPONENT)
    if model == KELVIN_VOIGT:
        force = kelvin_voigt_force(displacement, velocity, stiffness, damping)
    elif model == KELVIN_BOLTZMANN:
        force = kelvin_boltzmann_force(displacement, velocity_exponent, stiffness, damping)
    elif model == ELASTIC_POWER_LAW:
        force = elastic_power_law_force(displacement, stiffness, n)
    else:
        force = adhesive_force(displacement, velocity, stiffness, damping, n, p)
    return force if model == ADHESIVE else max(force, 0.0)


@compiled
def contact_gradient(
    model: int,
    displacement: float,
    velocity: float,
    stiffness: float,
    damping: float,
    displacement_exponent: float,
    velocity_exponent: float,
    gradient: NDArray[np.float64],
) -> float:
    """Derivatives of `contact_force` with respect to its six arguments after the model.

    Args:
        model: code of the model.
        displacement: d [mm].
        velocity: v [mm/s].
        stiffness: K.
        damping: B.
        displacement_exponent: n.
        velocity_exponent: p, or the lagged velocity.
        gradient: takes the derivatives, shape (6,); zeros in separation.

    Returns:
        The force [N].
    """
    n = min(
        max(displacement_exponent, SMALLEST_DISPLACEMENT_EXPONENT), LARGEST_DISPLACEMENT_EXPONENT
    )
    p = min(max(velocity_exponent, SMALLEST_VELOCITY_EXPONENT), LARGEST_VELOCITY_EXPONENT)
    if model in (KELVIN_VOIGT, KELVIN_BOLTZMANN):
        force = contact_force(
            model, displacement, velocity, stiffness, damping, n, velocity_exponent
        )
        for i in range(6):
            gradient[i] = 0.0
        if force > 0.0:
            gradient[0] = stiffness
            gradient[2] = displacement
            if model == KELVIN_VOIGT:
                gradient[1] = damping
                gradient[3] = velocity
            else:
                gradient[5] = damping
                gradient[3] = velocity_exponent
        return force
    if model == ELASTIC_POWER_LAW:
        damping = 0.0
    force = adhesive_gradient(displacement, velocity, stiffness, damping, n, p, gradient)
    if force <= 0.0 and model != ADHESIVE:
        for i in range(6):
            gradient[i] = 0.0
        return 0.0
    if model == ELASTIC_POWER_LAW:
        gradient[3] = 0.0
    if n != displacement_exponent:
        gradient[4] = 0.0
    if p != velocity_exponent:
        gradient[5] = 0.0
    return force
