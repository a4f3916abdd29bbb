"""Compiled adaptation of the slave's impedance to the estimate; its bounds hold whatever comes.

The controller is as stiff as following the master within a share of the depth needs in this tissue,
and critically damped on it. Bounds: stiffness and damping lie between two values each; the
stiffness changes at a bounded rate, and changes the force at a bounded rate; a spring that stiffens
while it is stretched takes energy, which is paid from a tank that the controller's own damper fills
(after Ferraguti et al. 2013). While the estimate is not sure the stiffness goes back to the lowest.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hc_sim_rig.bilateral.layout import (
    MEMORY_SLAVE_DEPTH,
    MEMORY_SLAVE_STIFFNESS,
    MEMORY_SLAVE_TANK,
    MODEL_SURE,
    Constants,
)
from hc_sim_rig.compilation import inlined

DEPTH_MEMORY_S = 2.0
LEAST_DEPTH = 0.5
"""[mm] The tissue's stiffness is looked at no nearer to the surface."""


@inlined
def adapted_impedance(
    stretch: float,
    stretch_rate: float,
    position: float,
    model: NDArray[np.float64],
    constants: Constants,
    memory: NDArray[np.float64],
) -> tuple[float, float]:
    """Stiffness [N/mm] and damping [N s/mm] of the slave's controller for the next sample.

    Args:
        stretch: command less position of the slave [mm].
        stretch_rate: the same of the velocities [mm/s].
        position: of the slave [mm].
        model: 1 if there is a model; K, B, n, p, surface; 1 if the estimate is sure now.
        constants: of the run.
        memory: (MEMORY_SIZE,), changed in place.
    """
    step = constants.step
    depth = max(position - model[5], memory[MEMORY_SLAVE_DEPTH] * (1.0 - step / DEPTH_MEMORY_S))
    memory[MEMORY_SLAVE_DEPTH] = max(depth, 0.0)
    wanted, tangent = constants.stiffness_low, 0.0
    if model[0] > 0.0 and model[MODEL_SURE] > 0.0:
        secant = model[1] * max(depth, LEAST_DEPTH) ** (model[3] - 1.0)
        if secant > 0.0 and secant < math.inf:
            tangent = model[3] * secant
            wanted = min(
                max(constants.stiffness_ratio * secant, constants.stiffness_low),
                constants.stiffness_high,
            )
    stiffness = memory[MEMORY_SLAVE_STIFFNESS]
    change = wanted - stiffness
    limit = constants.stiffness_rate * step
    if abs(stretch) * limit > constants.stiffness_force_rate * step:
        limit = constants.stiffness_force_rate * step / abs(stretch)
    change = min(max(change, -limit), limit)
    half_square = 0.5 * stretch * stretch
    if change > 0.0 and change * half_square > memory[MEMORY_SLAVE_TANK]:
        change = memory[MEMORY_SLAVE_TANK] / half_square
    stiffness += change
    damping = 2.0 * math.sqrt(constants.slave_mass * (stiffness + tangent))
    damping = min(max(damping - constants.slave_damping, 0.0), constants.slave_controller_damping)
    gained = damping * stretch_rate * stretch_rate * step - change * half_square
    tank = min(memory[MEMORY_SLAVE_TANK] + gained, constants.slave_tank)
    memory[MEMORY_SLAVE_TANK] = max(tank, 0.0)
    memory[MEMORY_SLAVE_STIFFNESS] = stiffness
    return stiffness, damping
