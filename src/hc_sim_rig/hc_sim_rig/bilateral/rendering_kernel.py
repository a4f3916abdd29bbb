"""Compiled rendering of a contact model at the master: bounded updates, passivity.

The force that the hand feels comes from the model that the master has, at the hand's own position:
no delay is in this loop. What arrives over the network changes the model, and only so fast that
the force changes by at most `update_rate`, and only with energy that the tank holds. The tank is
the passivity observer: it counts what the hand has put in, less what the rendered spring holds
and what updates have taken. Where sampling drives it below zero the passivity controller damps
(Hannaford and Ryu 2002). Equations in docs/teleoperation.md.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hc_sim_rig.bilateral.layout import (
    MEMORY_ELASTIC,
    MEMORY_FORCE_BEFORE,
    MEMORY_MASTER_BEFORE,
    MEMORY_MODEL,
    MEMORY_RENDERED,
    MEMORY_TANK,
    MODEL_SIZE,
    SENT_KNOWN,
    SENT_MODEL,
    Constants,
)
from hc_sim_rig.compilation import inlined

HALVINGS = 30
"""An update that is too much is halved so often; then it waits for the next sample."""
SMALLEST_SPEED = 1e-3
"""[mm/s] Below this the passivity controller has nothing to hold on to."""


@inlined
def spring(depth: float, model: NDArray[np.float64], largest_slope: float) -> tuple[float, float]:
    """Force [N] and energy [mJ] of the model's spring, nowhere steeper than a bound.

    K d^n where that is no steeper; where it is, a straight line: from the depth on at which its
    slope K n d^(n-1) reaches the bound (n > 1), or up to the depth where it crosses (n <= 1).

    Args:
        depth: in the model [mm].
        model: (5,) K, B, n, p and surface.
        largest_slope: of the force over depth [N/mm].
    """
    stiffness, exponent = model[0], model[2]
    if exponent > 1.0:
        straight = (largest_slope / (stiffness * exponent)) ** (1.0 / (exponent - 1.0))
        curved = min(depth, straight)
        force = stiffness * curved**exponent
        energy = force * curved / (exponent + 1.0)
        beyond = depth - curved
        energy += (force + 0.5 * largest_slope * beyond) * beyond
        return force + largest_slope * beyond, energy
    if exponent == 1.0:
        slope = min(stiffness, largest_slope)
        return slope * depth, 0.5 * slope * depth * depth
    crossing = (stiffness / largest_slope) ** (1.0 / (1.0 - exponent))
    if depth <= crossing:
        return largest_slope * depth, 0.5 * largest_slope * depth * depth
    force = stiffness * depth**exponent
    energy = 0.5 * largest_slope * crossing * crossing
    energy += (force * depth - largest_slope * crossing * crossing) / (exponent + 1.0)
    return force, energy


@inlined
def rendered_force(
    position: float, velocity: float, model: NDArray[np.float64], constants: Constants
) -> float:
    """Force of a model [N]: Hunt-Crossley, unilateral, spring and damping bounded.

    Args:
        position: of the hand [mm].
        velocity: of the hand [mm/s].
        model: (5,) K, B, n, p and surface.
        constants: bounds: `largest_stiffness` on the spring's slope, `largest_damping` on drag
            over velocity.
    """
    depth = position - model[4]
    if depth <= 0.0:
        return 0.0
    speed = abs(velocity)
    drag = min(model[1] * depth ** model[2] * speed ** model[3], constants.largest_damping * speed)
    elastic, _ = spring(depth, model, constants.largest_stiffness)
    return float(max(0.0, elastic + math.copysign(drag, velocity)))


@inlined
def elastic_energy(position: float, model: NDArray[np.float64], constants: Constants) -> float:
    """Energy of the model's spring [mJ]."""
    depth = position - model[4]
    if depth <= 0.0:
        return 0.0
    _, energy = spring(depth, model, constants.largest_stiffness)
    return energy


@inlined
def between(
    share: float,
    model: NDArray[np.float64],
    target: NDArray[np.float64],
    result: NDArray[np.float64],
) -> None:
    """Write the model that lies a share of the way to another: K geometrically, the rest evenly."""
    result[0] = model[0] * (target[0] / model[0]) ** share
    for k in range(1, MODEL_SIZE):
        result[k] = model[k] + share * (target[k] - model[k])


@inlined
def update_model(
    position: float,
    velocity: float,
    target: NDArray[np.float64],
    constants: Constants,
    memory: NDArray[np.float64],
) -> float:
    """Bring the rendered model nearer to the one that arrived; return the change of the force [N].

    Args:
        position: of the hand [mm].
        velocity: as the force uses it [mm/s].
        target: (5,) model that arrived.
        constants: of the run.
        memory: (MEMORY_SIZE,), changed in place.
    """
    model = memory[MEMORY_MODEL : MEMORY_MODEL + MODEL_SIZE]
    if memory[MEMORY_RENDERED] == 0.0:
        # First contact: the hand may be deep in the tissue already. The surface begins under it,
        # where neither force nor energy are, and then moves up like every other update.
        for k in range(MODEL_SIZE):
            model[k] = target[k]
        model[4] = max(target[4], position)
        memory[MEMORY_RENDERED] = 1.0
        memory[MEMORY_ELASTIC] = 0.0
        return 0.0
    if position <= model[4] and position <= target[4]:  # free motion in both: nothing can jump
        for k in range(MODEL_SIZE):
            model[k] = target[k]
        return 0.0
    before = rendered_force(position, velocity, model, constants)
    elastic = memory[MEMORY_ELASTIC]
    trial = np.empty(MODEL_SIZE)
    share = min(1.0, constants.step / constants.update_time)
    for _ in range(HALVINGS):
        between(share, model, target, trial)
        change = rendered_force(position, velocity, trial, constants) - before
        taken = elastic_energy(position, trial, constants) - elastic
        if abs(change) <= constants.update_rate * constants.step and (
            taken <= 0.0 or taken <= memory[MEMORY_TANK]
        ):
            for k in range(MODEL_SIZE):
                model[k] = trial[k]
            memory[MEMORY_TANK] = min(memory[MEMORY_TANK] - taken, constants.tank_limit)
            memory[MEMORY_ELASTIC] = elastic + taken
            return change
        share *= 0.5
    return 0.0


@inlined
def render(
    position: float,
    velocity: float,
    arrived: NDArray[np.float64],
    constants: Constants,
    memory: NDArray[np.float64],
) -> tuple[float, float]:
    """The force at the hand for the next sample [N], and how much of it is this sample's update.

    Args:
        position: of the hand [mm].
        velocity: of the hand, as measured [mm/s].
        arrived: (SENT_COLUMNS,) newest packet.
        constants: of the run.
        memory: (MEMORY_SIZE,), changed in place; the last position is still the last sample's.
    """
    model = memory[MEMORY_MODEL : MEMORY_MODEL + MODEL_SIZE]
    # Passivity observer: exact, for the force was held while the hand moved.
    work = memory[MEMORY_FORCE_BEFORE] * (position - memory[MEMORY_MASTER_BEFORE])
    elastic = elastic_energy(position, model, constants) if memory[MEMORY_RENDERED] > 0.0 else 0.0
    memory[MEMORY_TANK] += work - (elastic - memory[MEMORY_ELASTIC])
    memory[MEMORY_TANK] = min(memory[MEMORY_TANK], constants.tank_limit)
    memory[MEMORY_ELASTIC] = elastic
    change = 0.0
    if arrived[SENT_KNOWN] > 0.0:
        change = update_model(
            position,
            velocity,
            arrived[SENT_MODEL : SENT_MODEL + MODEL_SIZE],
            constants,
            memory,
        )
    force = 0.0
    if memory[MEMORY_RENDERED] > 0.0:
        force = rendered_force(position, velocity, model, constants)
    if memory[MEMORY_TANK] < 0.0 and abs(velocity) > SMALLEST_SPEED:
        needed = -memory[MEMORY_TANK] / (velocity * velocity * constants.step)
        force += min(needed, constants.controller_damping) * velocity
    force = min(max(force, -constants.force_limit), constants.force_limit)
    memory[MEMORY_FORCE_BEFORE] = force
    return force, change
