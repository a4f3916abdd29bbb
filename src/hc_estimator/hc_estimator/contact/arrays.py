"""The contact law over arrays: one implementation for rig, signals, metrics, bounds and fits.

`hunt_crossley_force` is unilateral, F = max(0, ...), as a tissue is; `adhesive_force` is the
papers' formula (paper A, Eq. 1; paper B, Eq. 1), which turns negative on a fast retreat. Both are
those of `hunt_crossley` (a test holds them together), which are compiled for one sample and
limit what would overflow; here an estimate that diverged gives infinity or NaN, without a warning.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def adhesive_force(
    displacement: FloatArray, velocity: FloatArray, parameters: FloatArray
) -> FloatArray:
    """F = K d^n + B d^n sign(v)|v|^p for d > 0, else 0; may be negative.

    Args:
        displacement: penetration [mm], shape (N,).
        velocity: its rate [mm/s], shape (N,).
        parameters: K, B, n, p, shape (4,) or (N, 4).

    Returns:
        Force [N], shape (N,).
    """
    stiffness, damping, n, p = np.moveaxis(np.asarray(parameters, dtype=np.float64), -1, 0)
    touching = displacement > 0.0
    with np.errstate(all="ignore"):
        power = np.where(touching, displacement, 1.0) ** n
        dashpot = np.sign(velocity) * np.abs(velocity) ** p
        force: FloatArray = np.where(touching, power * (stiffness + damping * dashpot), 0.0)
    return force


def hunt_crossley_force(
    displacement: FloatArray, velocity: FloatArray, parameters: FloatArray
) -> FloatArray:
    """max(0, `adhesive_force`): 0 where the tool has left the tissue [N], shape (N,)."""
    force: FloatArray = np.maximum(adhesive_force(displacement, velocity, parameters), 0.0)
    return force


def force_of(
    displacement: FloatArray, velocity: FloatArray, parameters: FloatArray, *, adhesive: bool
) -> FloatArray:
    """`adhesive_force` or `hunt_crossley_force`, as the flag says."""
    law = adhesive_force if adhesive else hunt_crossley_force
    return law(displacement, velocity, parameters)


def force_gradient(
    displacement: FloatArray,
    velocity: FloatArray,
    parameters: FloatArray,
    *,
    adhesive: bool = False,
) -> FloatArray:
    """Derivatives of the force with respect to d, v, ln K, ln B, n, p.

    In separation those of the unilateral law are zero: a reading of 0 says an inequality about the
    parameters, and no value. At v = 0 the derivatives by v (infinite for p < 1), ln B and p are 0.

    Args:
        displacement: penetration [mm], shape (N,).
        velocity: its rate [mm/s], shape (N,).
        parameters: K, B, n, p, shape (4,) or (N, 4).
        adhesive: whether the tissue holds a tool that withdraws.

    Returns:
        Derivatives, shape (N, 6).
    """
    stiffness, damping, n, p = np.moveaxis(np.asarray(parameters, dtype=np.float64), -1, 0)
    depth = np.where(displacement > 0.0, displacement, 1.0)
    moving = velocity != 0.0
    speed = np.where(moving, np.abs(velocity), 1.0)
    power = depth**n
    drag = np.sign(velocity) * damping * power * speed**p
    force = stiffness * power + drag
    gradient: FloatArray = np.stack(
        [
            n * force / depth,
            np.where(moving, p * np.abs(drag) / speed, 0.0),
            stiffness * power,
            drag,
            force * np.log(depth),
            drag * np.log(speed),
        ],
        axis=1,
    )
    gradient[(displacement <= 0.0) | ((force <= 0.0) & (not adhesive))] = 0.0
    return gradient


def separated(
    displacement: FloatArray, velocity: FloatArray, parameters: FloatArray
) -> NDArray[np.bool_]:
    """Where the tool has left a tissue into whose space it still reaches: d > 0, F = 0.

    The arguments are those of `adhesive_force`; shape (N,).
    """
    apart: NDArray[np.bool_] = adhesive_force(displacement, velocity, parameters) <= 0.0
    return apart & (displacement > 0.0)
