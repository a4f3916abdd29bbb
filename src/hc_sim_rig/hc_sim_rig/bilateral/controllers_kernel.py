"""Compiled controllers of both ends: the force at the hand and the slave's, by method of feedback.

The simulation (`kernel.py`) and the live sides (`live_kernel.py`) call these same functions, so
that what is measured offline is what runs live. Equations in docs/teleoperation.md.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hc_sim_rig.bilateral.adaptation_kernel import adapted_impedance
from hc_sim_rig.bilateral.layout import (
    BACKWARD,
    DIRECT,
    FORWARD,
    MEMORY_SLAVE_STIFFNESS,
    MEMORY_WAVE_COMMAND,
    MODEL_MEDIATED,
    POSITION_POSITION,
    SENT_ENERGY,
    SENT_FORCE,
    SENT_POSITION,
    SENT_VELOCITY,
    SENT_WAVE,
    WAVE_VARIABLES,
    Constants,
)
from hc_sim_rig.bilateral.rendering_kernel import render
from hc_sim_rig.bilateral.waves_kernel import (
    master_wave,
    master_wave_force,
    slave_wave,
    slave_wave_force,
    slave_wave_velocity,
    wave_out,
)
from hc_sim_rig.compilation import inlined


@inlined
def slave_control(
    position: float,
    velocity: float,
    command: float,
    command_velocity: float,
    arrived: NDArray[np.float64],
    lead: int,
    model: NDArray[np.float64],
    constants: Constants,
    memory: NDArray[np.float64],
) -> tuple[float, float, float]:
    """Force of the slave's controller [N], wave it sends back, power it puts into the waves [mW].

    Args:
        position: reading of the slave's position [mm].
        velocity: of the slave, as measured [mm/s].
        command: position of the master as it arrived [mm]; with waves it does not matter.
        command_velocity: its velocity [mm/s].
        arrived: (SENT_COLUMNS,) newest packet of the master; zeros before one has come.
        lead: samples until it is that packet's turn; for waves alone.
        model: (SLAVE_MODEL_SIZE,) as in `adapted_impedance`.
        constants: of the run.
        memory: (MEMORY_SIZE,), changed in place.
    """
    limit = constants.slave_force_limit
    method = int(constants.method)
    if method == WAVE_VARIABLES:
        impedance = constants.wave_impedance
        wave = wave_out(
            FORWARD, arrived[SENT_WAVE], arrived[SENT_ENERGY], lead, constants.step, memory
        )
        force = slave_wave_force(
            wave,
            memory[MEMORY_WAVE_COMMAND] - position,
            velocity,
            constants.wave_stiffness,
            impedance,  # as damping: what arrives is not thrown back
            impedance,
        )
        wanted = slave_wave_velocity(wave, force, impedance)
        back_wave = slave_wave(wave, force, impedance)
        memory[MEMORY_WAVE_COMMAND] += wanted * constants.step
        return min(max(force, -limit), limit), back_wave, -force * wanted
    stiffness, damping = constants.slave_stiffness, constants.slave_controller_damping
    if method == POSITION_POSITION:  # one spring and damper, at both ends
        stiffness, damping = constants.position_stiffness, constants.position_damping
    elif constants.adaptive > 0.0:
        stiffness, damping = adapted_impedance(
            command - position, command_velocity - velocity, position, model, constants, memory
        )
    else:
        memory[MEMORY_SLAVE_STIFFNESS] = stiffness
    force = stiffness * (command - position) + damping * (command_velocity - velocity)
    return min(max(force, -limit), limit), 0.0, 0.0


@inlined
def hand_control(
    position: float,
    velocity: float,
    arrived: NDArray[np.float64],
    heard: bool,
    lead: int,
    constants: Constants,
    memory: NDArray[np.float64],
) -> tuple[float, float, float, float]:
    """Force at the hand [N], its change by a model's update [N], wave sent, power into waves [mW].

    Args:
        position: reading of the hand's position [mm].
        velocity: of the hand, as measured [mm/s].
        arrived: (SENT_COLUMNS,) newest packet of the slave; zeros before one has come.
        heard: whether one has come.
        lead: samples until it is that packet's turn; for waves alone.
        constants: of the run.
        memory: (MEMORY_SIZE,), changed in place.
    """
    method = int(constants.method)
    change, force, wave_sent, port = 0.0, 0.0, 0.0, 0.0
    if method == DIRECT:
        force = arrived[SENT_FORCE]
    elif method == POSITION_POSITION:
        if heard:
            force = constants.position_stiffness * (
                position - arrived[SENT_POSITION]
            ) + constants.position_damping * (velocity - arrived[SENT_VELOCITY])
    elif method == WAVE_VARIABLES:
        impedance = constants.wave_impedance
        wave = wave_out(
            BACKWARD, arrived[SENT_WAVE], arrived[SENT_ENERGY], lead, constants.step, memory
        )
        force = master_wave_force(velocity, wave, impedance)
        wave_sent = master_wave(velocity, wave, impedance)
        port = force * velocity
    elif method == MODEL_MEDIATED:
        force, change = render(position, velocity, arrived, constants, memory)
    force = min(max(force, -constants.force_limit), constants.force_limit)
    return force, change, wave_sent, port
