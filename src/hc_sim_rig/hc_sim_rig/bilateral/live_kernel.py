"""Compiled parts of one side each, for master and slave as live nodes: `kernel.py` cut in two.

The equations are those of the simulation, and most of the code: a side that stands alone integrates
only its own half.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hc_sim_rig.bilateral.controllers_kernel import hand_control, slave_control
from hc_sim_rig.bilateral.kernel import integrate, measured_velocity, tissue_at
from hc_sim_rig.bilateral.layout import (
    BACKWARD,
    FORWARD,
    MEMORY_MASTER_BEFORE,
    MEMORY_MASTER_VELOCITY,
    MEMORY_SLAVE_BEFORE,
    MEMORY_SLAVE_VELOCITY,
    Y_SIZE,
    Y_SLAVE,
    Y_SLAVE_VELOCITY,
    Constants,
)
from hc_sim_rig.bilateral.waves_kernel import wave_in
from hc_sim_rig.compilation import compiled

FAR = -1e6
"""[mm] Where the tool is while only the hand is moved: nowhere near tissue."""


@compiled
def hand_force(
    position: float,
    elapsed: float,
    arrived: NDArray[np.float64],
    heard: bool,
    lead: int,
    constants: Constants,
    memory: NDArray[np.float64],
) -> tuple[float, float, float]:
    """Force at the hand [N], its velocity as measured [mm/s], change of force by the update [N].

    Args:
        position: reading of the hand's position [mm].
        elapsed: time since the reading before [s]; 0 if it is the same one.
        arrived: (SENT_COLUMNS,) newest packet; zeros before one has come.
        heard: whether the slave is there.
        lead: samples until it is the newest packet's turn.
        constants: of the run.
        memory: (MEMORY_SIZE,), changed in place.
    """
    velocity = measured_velocity(
        position, MEMORY_MASTER_BEFORE, MEMORY_MASTER_VELOCITY, elapsed, constants, memory
    )
    force, change, wave, _ = hand_control(
        position, velocity, arrived, heard, lead, constants, memory
    )
    wave_in(FORWARD, wave, constants.step, memory)
    memory[MEMORY_MASTER_BEFORE] = position
    return force, velocity, change


@compiled
def move_hand(
    wish: float,
    wish_rate: float,
    tremor: float,
    force: float,
    constants: Constants,
    y: NDArray[np.float64],
) -> None:
    """Bring the simulated hand to the next sample; `y` is (Y_SIZE,), changed in place."""
    y[Y_SLAVE], y[Y_SLAVE_VELOCITY] = FAR, 0.0
    integrate(y, np.empty((3, Y_SIZE)), wish, wish_rate, tremor, 0.0, force, 0.0, constants)


@compiled
def slave_force(
    position: float,
    command: float,
    command_velocity: float,
    arrived: NDArray[np.float64],
    lead: int,
    model: NDArray[np.float64],
    constants: Constants,
    memory: NDArray[np.float64],
) -> tuple[float, float]:
    """Force of the slave's controller [N], and its velocity as measured [mm/s].

    Args:
        position: reading of the slave's position [mm].
        command: position of the master as it arrived [mm].
        command_velocity: its velocity [mm/s].
        arrived: (SENT_COLUMNS,) newest packet; zeros before one has come.
        lead: samples until it is that packet's turn.
        model: as in `adapted_impedance`.
        constants: of the run.
        memory: (MEMORY_SIZE,), changed in place.
    """
    velocity = measured_velocity(
        position, MEMORY_SLAVE_BEFORE, MEMORY_SLAVE_VELOCITY, constants.step, constants, memory
    )
    memory[MEMORY_SLAVE_BEFORE] = position
    force, wave, _ = slave_control(
        position, velocity, command, command_velocity, arrived, lead, model, constants, memory
    )
    wave_in(BACKWARD, wave, constants.step, memory)
    return force, velocity


@compiled
def move_slave(lateral: float, force: float, constants: Constants, y: NDArray[np.float64]) -> None:
    """Bring the simulated slave to the next sample; `y` is (Y_SIZE,), changed in place.

    Its hand stays where it is: that half of the state is the other side's.
    """
    hand = y[0]
    y[1] = 0.0
    integrate(y, np.empty((3, Y_SIZE)), hand, 0.0, 0.0, lateral, 0.0, force, constants)
    y[0] = hand


@compiled
def tissue_force(y: NDArray[np.float64], lateral: float, constants: Constants) -> float:
    """True force of the tissue on the slave [N]."""
    return float(tissue_at(y[Y_SLAVE], y[Y_SLAVE_VELOCITY], lateral, constants))
