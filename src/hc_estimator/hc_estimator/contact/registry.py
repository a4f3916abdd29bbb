"""The contact models by name, and the functions through which the kernels reach them.

To add a model: write its force and a `ContactLaw` in a new file, and its line in `LAWS`. Laws of
other packages come by entry points (group `hc.contact_laws`, each a `ContactLaw`) and stand behind
those here; they are compiled into the kernels like these.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hc_estimator.compilation import compiled
from hc_estimator.contact import (
    elastic_power_law,
    hunt_crossley,
    kelvin_boltzmann,
    kelvin_voigt,
)
from hc_estimator.contact.law import ContactLaw
from hc_estimator.laws_of_others import ENTRY_POINTS
from hc_estimator.specification import ParameterSpecification
from hc_msgs_py.compilation import by_code
from hc_msgs_py.entry_points import add_those_of_others

LAWS: dict[str, ContactLaw] = {  # position = code
    "hunt_crossley": hunt_crossley.LAW,
    "kelvin_voigt": kelvin_voigt.LAW,
    "kelvin_boltzmann": kelvin_boltzmann.LAW,
    "elastic_power_law": elastic_power_law.LAW,
    "adhesive": hunt_crossley.ADHESIVE_LAW,
}
PROBLEMS = add_those_of_others(LAWS, ENTRY_POINTS, ContactLaw, "a contact law")
"""Contact laws of other packages that cannot be used, and why."""

CONTACT_MODELS = tuple(LAWS)
HUNT_CROSSLEY = CONTACT_MODELS.index("hunt_crossley")
KELVIN_VOIGT = CONTACT_MODELS.index("kelvin_voigt")
KELVIN_BOLTZMANN = CONTACT_MODELS.index("kelvin_boltzmann")
ELASTIC_POWER_LAW = CONTACT_MODELS.index("elastic_power_law")
ADHESIVE = CONTACT_MODELS.index("adhesive")

# Parameters that only one model has.
SPECIFICATIONS: dict[str, tuple[ParameterSpecification, ...]] = {
    name: law.specifications for name, law in LAWS.items() if law.specifications
}

# The physical range of the exponents.
SMALLEST_DISPLACEMENT_EXPONENT = 0.5
LARGEST_DISPLACEMENT_EXPONENT = 4.0
SMALLEST_VELOCITY_EXPONENT = 0.25
LARGEST_VELOCITY_EXPONENT = 3.0

STEP = 1e-6
"""Of the central differences, relative to the argument and to 1 [mm, mm/s, ...]."""


@compiled
def _no_gradient(
    displacement: float,
    velocity: float,
    stiffness: float,
    damping: float,
    n: float,
    p: float,
    gradient: NDArray[np.float64],
) -> float:
    """Stands for the gradient of a law that gives none."""
    return 0.0


# What the kernels read of the laws, by code.
_force = by_code([law.force for law in LAWS.values()])
_gradient = by_code([law.gradient or _no_gradient for law in LAWS.values()])
_HAS_GRADIENT = np.array([law.gradient is not None for law in LAWS.values()])
_FIXED = np.array([law.fixed for law in LAWS.values()])
_MAY_PULL = np.array([law.may_pull for law in LAWS.values()])
_LAGGED = np.array([law.lagged_velocity for law in LAWS.values()])


@compiled
def has_lagged_velocity(model: int) -> bool:
    """True if the last state is not p but the lagged velocity of the model."""
    return bool(_LAGGED[model])


@compiled
def end_of_parameters(model: int) -> int:
    """Index after the last parameter in the state; a lagged velocity belongs to the motion."""
    return 6 if has_lagged_velocity(model) else 7


@compiled
def fixed_value(model: int, parameter: int) -> float:
    """What is reported for a parameter (0 to 3: K, B, n, p) that the model lacks; NaN if it has it.

    Such a parameter is not estimated: its variance is zero from the start.
    """
    return float(_FIXED[model, parameter])


@compiled
def limited_n(n: float) -> float:
    """Give the exponent of the depth, brought into its physical range."""
    return min(max(n, SMALLEST_DISPLACEMENT_EXPONENT), LARGEST_DISPLACEMENT_EXPONENT)


@compiled
def limited_p(p: float) -> float:
    """The same of the velocity's."""
    return min(max(p, SMALLEST_VELOCITY_EXPONENT), LARGEST_VELOCITY_EXPONENT)


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

    Unilateral but for a law that may pull. The exponents are limited to their physical range here:
    an estimate may leave it for a while, a force computed from it must not explode.
    """
    n = limited_n(displacement_exponent)
    p = velocity_exponent
    if not _LAGGED[model]:
        p = limited_p(p)
    force: float = _force(model, displacement, velocity, stiffness, damping, n, p)
    return force if _MAY_PULL[model] else max(force, 0.0)


@compiled
def _differences(
    model: int, at: tuple[float, float, float, float, float, float], gradient: NDArray[np.float64]
) -> None:
    """Write the central differences of `contact_force` at six arguments."""
    arguments = np.array(at)
    for i in range(6):
        step = STEP * (1.0 + abs(at[i]))
        arguments[i] = at[i] + step
        d, v, k, b, n, p = arguments
        above = contact_force(model, d, v, k, b, n, p)
        arguments[i] = at[i] - step
        d, v, k, b, n, p = arguments
        below = contact_force(model, d, v, k, b, n, p)
        arguments[i] = at[i]
        gradient[i] = (above - below) / (2.0 * step)


@compiled
def _without_tension(
    model: int, force: float, n_limited: bool, p_limited: bool, gradient: NDArray[np.float64]
) -> float:
    """Force [N], 0 in separation as its derivatives; those after a limited exponent are 0."""
    if force <= 0.0 and not _MAY_PULL[model]:
        for i in range(6):
            gradient[i] = 0.0
        return 0.0
    if n_limited:
        gradient[4] = 0.0
    if p_limited:
        gradient[5] = 0.0
    return force


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
    for i in range(6):
        gradient[i] = 0.0
    if not _HAS_GRADIENT[model]:
        force = contact_force(
            model,
            displacement,
            velocity,
            stiffness,
            damping,
            displacement_exponent,
            velocity_exponent,
        )
        if force > 0.0 or _MAY_PULL[model]:
            _differences(
                model,
                (
                    displacement,
                    velocity,
                    stiffness,
                    damping,
                    displacement_exponent,
                    velocity_exponent,
                ),
                gradient,
            )
        return force
    n = limited_n(displacement_exponent)
    p = velocity_exponent
    if not _LAGGED[model]:
        p = limited_p(p)
    found: float = _gradient(model, displacement, velocity, stiffness, damping, n, p, gradient)
    return _without_tension(
        model, found, n != displacement_exponent, p != velocity_exponent, gradient
    )


@compiled
def is_plain(model: int) -> bool:
    """True for the Hunt-Crossley law itself, with tension or without."""
    return model in (HUNT_CROSSLEY, ADHESIVE)


@compiled
def displacement_power(displacement: float, displacement_exponent: float) -> tuple[float, float]:
    """Give ln d and d^n as `plain_gradient` wants them; any numbers for d <= 0."""
    if displacement <= hunt_crossley.TINY:
        return 0.0, 0.0
    n = limited_n(displacement_exponent)
    log_displacement = math.log(displacement)
    return log_displacement, math.exp(min(n * log_displacement, hunt_crossley.LARGEST_EXPONENT))


@compiled
def plain_gradient(
    model: int,
    displacement: float,
    power: tuple[float, float],
    velocity: float,
    stiffness: float,
    damping: float,
    displacement_exponent: float,
    velocity_exponent: float,
    gradient: NDArray[np.float64],
) -> float:
    """`contact_gradient` of a model that `is_plain`, for several velocities at one displacement.

    The arguments are those of `contact_gradient`, and power what `displacement_power` gives.
    """
    for i in range(6):
        gradient[i] = 0.0
    if displacement <= hunt_crossley.TINY:
        return 0.0
    n = limited_n(displacement_exponent)
    p = limited_p(velocity_exponent)
    force: float = hunt_crossley.gradient_at_velocity(
        displacement, power[0], power[1], velocity, stiffness, damping, n, p, gradient
    )
    return _without_tension(
        model, force, n != displacement_exponent, p != velocity_exponent, gradient
    )
