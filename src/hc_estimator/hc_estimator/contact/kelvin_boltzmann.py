"""The Kelvin-Boltzmann (standard linear solid) law: a spring beside a spring and damper in series.

F = K d + B w, where w follows the velocity with the relaxation time tau: dw/dt = (v - w) / tau.
K is the stiffness that remains after relaxation, B the damping in slow motion, B / tau the extra
stiffness in fast motion. It is the simplest law in which the force relaxes during a hold. The
lagged velocity w is a state of its own; it takes the place of p, which this law does not have.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hc_estimator.compilation import compiled
from hc_estimator.contact.law import ESTIMATED, ContactLaw
from hc_estimator.specification import ParameterSpecification

RELAXATION_TIME = ParameterSpecification(
    "relaxation_time",
    "float",
    1.0,
    "Time constant with which the force relaxes during a hold; given, not estimated.",
    minimum=1e-3,
    maximum=1e4,
    unit="s",
)


@compiled
def kelvin_boltzmann_force(
    displacement: float, lagged_velocity: float, stiffness: float, damping: float
) -> float:
    """Contact force of the Kelvin-Boltzmann law.

    Args:
        displacement: penetration d [mm].
        lagged_velocity: w [mm/s].
        stiffness: K [N/mm] after relaxation.
        damping: B [N s/mm] in slow motion.

    Returns:
        Force [N]; 0 for d <= 0.
    """
    if displacement <= 0.0:
        return 0.0
    return stiffness * displacement + damping * lagged_velocity


@compiled
def lag_share(elapsed: float, relaxation_time: float) -> float:
    """Share of v - w that w makes good in the elapsed time [s]: 1 - exp(-elapsed / tau)."""
    return -math.expm1(-elapsed / relaxation_time)


@compiled
def force(
    displacement: float,
    velocity: float,
    stiffness: float,
    damping: float,
    n: float,
    lagged_velocity: float,
) -> float:
    """Force with the arguments that every law has; v and n do nothing here."""
    return kelvin_boltzmann_force(displacement, lagged_velocity, stiffness, damping)


@compiled
def gradient(
    displacement: float,
    velocity: float,
    stiffness: float,
    damping: float,
    n: float,
    lagged_velocity: float,
    gradient: NDArray[np.float64],
) -> float:
    """Derivatives with respect to d, K, B and w; returns the force [N]."""
    if displacement > 0.0:
        gradient[0] = stiffness
        gradient[2] = displacement
        gradient[3] = lagged_velocity
        gradient[5] = damping
    return kelvin_boltzmann_force(displacement, lagged_velocity, stiffness, damping)


LAW = ContactLaw(
    force,
    "F = K d + B w, w the velocity that lags with relaxation_time",
    gradient,
    fixed=(ESTIMATED, ESTIMATED, 1.0, 1.0),
    lagged_velocity=True,
    specifications=(RELAXATION_TIME,),
)
