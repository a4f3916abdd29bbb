"""Compiled closed loop: operator, master, network, slave, tissue, and four ways to feed force back.

Within one sample: sensors are read, packets that are due are taken, both controllers compute
their force, packets are sent (they arrive with the next sample at the earliest), and the equations
of motion are integrated to the next sample with both forces held.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hc_estimator.contact import hunt_crossley_force
from hc_sim_rig.bilateral.controllers_kernel import hand_control, slave_control
from hc_sim_rig.bilateral.layout import (
    BACKWARD,
    FORWARD,
    FRICTION_VELOCITY,
    MEMORY_CORRECTION,
    MEMORY_MASTER_BEFORE,
    MEMORY_MASTER_VELOCITY,
    MEMORY_MODEL,
    MEMORY_RENDERED,
    MEMORY_SLAVE_BEFORE,
    MEMORY_SLAVE_STIFFNESS,
    MEMORY_SLAVE_TANK,
    MEMORY_SLAVE_VELOCITY,
    MEMORY_TANK,
    MEMORY_WAVE_ENERGY_SENT,
    MEMORY_WAVE_ENERGY_USED,
    MEMORY_WAVE_SENT,
    MODEL_SIZE,
    OUT_EFFORT_READING,
    OUT_FORCE_READING,
    OUT_HAND_ENERGY,
    OUT_HAND_FORCE,
    OUT_LATERAL,
    OUT_MASTER,
    OUT_MASTER_VELOCITY,
    OUT_MODEL,
    OUT_POSITION_READING,
    OUT_SLAVE,
    OUT_SLAVE_LATERAL,
    OUT_SLAVE_STIFFNESS,
    OUT_SLAVE_TANK,
    OUT_SLAVE_VELOCITY,
    OUT_TANK,
    OUT_TIME,
    OUT_TISSUE_ENERGY,
    OUT_TISSUE_FORCE,
    OUT_UPDATE_CHANGE,
    OUT_WAVE_PORTS,
    OUT_WAVE_STORED,
    SENT_ENERGY,
    SENT_FORCE,
    SENT_KNOWN,
    SENT_LATERAL,
    SENT_MODEL,
    SENT_POSITION,
    SENT_VELOCITY,
    SENT_WAVE,
    Y_MASTER,
    Y_MASTER_VELOCITY,
    Y_SIZE,
    Y_SLAVE,
    Y_SLAVE_VELOCITY,
    Constants,
)
from hc_sim_rig.bilateral.waves_kernel import wave_in
from hc_sim_rig.channel_kernel import receive, send
from hc_sim_rig.compilation import compiled, inlined


@inlined
def tissue_at(position: float, velocity: float, lateral: float, constants: Constants) -> float:
    """True force of the tissue at a place [N]; the lump is a bell on K and B."""
    distance = (lateral - constants.lump_centre) / constants.lump_width
    bell = math.exp(-0.5 * distance * distance)
    return float(
        hunt_crossley_force(
            position - constants.surface,
            velocity,
            constants.stiffness * (1.0 + constants.lump_stiffness * bell),
            constants.damping * (1.0 + constants.lump_damping * bell),
            constants.displacement_exponent,
            constants.velocity_exponent,
        )
    )


@inlined
def rates_of(
    y: NDArray[np.float64],
    rates: NDArray[np.float64],
    wish: float,
    wish_rate: float,
    tremor: float,
    lateral: float,
    hand_force: float,
    slave_force: float,
    constants: Constants,
) -> None:
    """Derivatives of the moving state with both controllers' forces held."""
    rates[Y_MASTER] = y[Y_MASTER_VELOCITY]
    arm = constants.hand_stiffness * (wish - y[Y_MASTER]) + constants.hand_damping * (
        wish_rate - y[Y_MASTER_VELOCITY]
    )
    friction = constants.device_damping * y[Y_MASTER_VELOCITY]
    rates[Y_MASTER_VELOCITY] = (arm + tremor - friction - hand_force) / constants.master_mass
    rates[Y_SLAVE] = y[Y_SLAVE_VELOCITY]
    tissue = tissue_at(y[Y_SLAVE], y[Y_SLAVE_VELOCITY], lateral, constants)
    dry = constants.slave_friction * math.tanh(y[Y_SLAVE_VELOCITY] / FRICTION_VELOCITY)
    rates[Y_SLAVE_VELOCITY] = (
        slave_force - constants.slave_damping * y[Y_SLAVE_VELOCITY] - dry - tissue
    ) / constants.slave_mass


@inlined
def integrate(
    y: NDArray[np.float64],
    work: NDArray[np.float64],
    wish: float,
    wish_rate: float,
    tremor: float,
    lateral: float,
    hand_force: float,
    slave_force: float,
    constants: Constants,
) -> None:
    """One sample of classical Runge-Kutta; `work` is (3, Y_SIZE) of scratch."""
    substeps = int(constants.substeps)
    step = constants.step / substeps
    rates, total, trial = work[0], work[1], work[2]
    for part in range(substeps):
        begin = part * step
        for stage in range(4):
            share = 0.0 if stage == 0 else (1.0 if stage == 3 else 0.5)
            weight = 1.0 / 6.0 if stage in (0, 3) else 1.0 / 3.0
            for k in range(Y_SIZE):
                trial[k] = y[k] + share * step * rates[k] if stage > 0 else y[k]
            rates_of(
                trial,
                rates,
                wish + wish_rate * (begin + share * step),
                wish_rate,
                tremor,
                lateral,
                hand_force,
                slave_force,
                constants,
            )
            for k in range(Y_SIZE):
                total[k] = (total[k] if stage > 0 else 0.0) + weight * rates[k]
        for k in range(Y_SIZE):
            y[k] += step * total[k]


@inlined
def measured_velocity(
    reading: float,
    before: int,
    velocity: int,
    elapsed: float,
    constants: Constants,
    memory: NDArray[np.float64],
) -> float:
    """Velocity from readings of the position: their difference through a low-pass [mm/s].

    Args:
        reading: of the position [mm].
        before: where the reading before stands in memory.
        velocity: where the velocity does.
        elapsed: time since the reading before [s]; 0 if it is the same one.
        constants: of the run.
        memory: (MEMORY_SIZE,), changed in place.
    """
    if elapsed <= 0.0:
        return float(memory[velocity])
    difference = (reading - memory[before]) / elapsed
    weight = 1.0 - math.exp(-constants.velocity_rate * elapsed)
    memory[velocity] += weight * (difference - memory[velocity])
    return float(memory[velocity])


@inlined
def operator_wish(
    k: int,
    path: NDArray[np.float64],
    out: NDArray[np.float64],
    constants: Constants,
    memory: NDArray[np.float64],
) -> float:
    """Where the operator's arm pulls the hand to [mm]: the path, and a late correction of it."""
    late = k - int(constants.reaction_samples)
    if late >= 0:
        error = path[late] - out[late, OUT_MASTER]
        correction = memory[MEMORY_CORRECTION] + constants.correction_rate * constants.step * error
        limit = constants.correction_limit
        memory[MEMORY_CORRECTION] = min(max(correction, -limit), limit)
    return float(path[k] + memory[MEMORY_CORRECTION])


@compiled
def advance(
    first: int,
    count: int,
    constants: Constants,
    path: NDArray[np.float64],
    lateral: NDArray[np.float64],
    tremor: NDArray[np.float64],
    noise: NDArray[np.float64],
    draws: NDArray[np.float64],
    links: NDArray[np.float64],
    packets: NDArray[np.float64],
    ring: NDArray[np.float64],
    sent: NDArray[np.float64],
    model: NDArray[np.float64],
    y: NDArray[np.float64],
    memory: NDArray[np.float64],
    out: NDArray[np.float64],
) -> None:
    """Simulate some samples.

    Args:
        first: index of the first.
        count: how many.
        constants: of the run.
        path: (N + 1,) where the operator wants the hand [mm].
        lateral: (N + 1,) sideways position of the hand [mm].
        tremor: (N,) force of the tremor [N].
        noise: (N, 4) errors of the readings: master's position, slave's position, force, effort.
        draws: (N, DRAWS) random draws of the network.
        links: (2, LINK_COLUMNS) of channel_kernel.
        packets: (2, PACKET_COLUMNS) of channel_kernel, changed in place.
        ring: (2, RING, 2) of channel_kernel, changed in place.
        sent: (2, N + 1, SENT_COLUMNS) what was sent at each sample; the last row holds zeros.
        model: (SLAVE_MODEL_SIZE,) 1 if the slave has a model, it, and 1 if it is sure.
        y: (Y_SIZE,) moving state, changed in place.
        memory: (MEMORY_SIZE,) changed in place.
        out: (N, OUT_COLUMNS) result.
    """
    work = np.empty((3, Y_SIZE))
    nothing = sent.shape[1] - 1
    playout = int(constants.playout)
    for k in range(first, first + count):
        master = y[Y_MASTER] + noise[k, 0]
        slave = y[Y_SLAVE] + noise[k, 1]
        master_velocity = measured_velocity(
            master, MEMORY_MASTER_BEFORE, MEMORY_MASTER_VELOCITY, constants.step, constants, memory
        )
        slave_velocity = measured_velocity(
            slave, MEMORY_SLAVE_BEFORE, MEMORY_SLAVE_VELOCITY, constants.step, constants, memory
        )
        at_slave = int(receive(FORWARD, k, links, packets, ring))
        at_master = int(receive(BACKWARD, k, links, packets, ring))
        forward = sent[FORWARD, at_slave if at_slave >= 0 else nothing]
        backward = sent[BACKWARD, at_master if at_master >= 0 else nothing]
        slave_lateral = forward[SENT_LATERAL] if at_slave >= 0 else lateral[0]
        tissue = tissue_at(y[Y_SLAVE], y[Y_SLAVE_VELOCITY], slave_lateral, constants)
        force_reading = tissue + noise[k, 2]

        # the slave
        command, command_velocity = slave, 0.0
        if at_slave >= 0:
            command, command_velocity = forward[SENT_POSITION], forward[SENT_VELOCITY]
        slave_force, back_wave, slave_port = slave_control(
            slave,
            slave_velocity,
            command,
            command_velocity,
            forward,
            at_slave - k + playout,
            model,
            constants,
            memory,
        )

        # the master
        hand_force, change, forward_wave, master_port = hand_control(
            master,
            master_velocity,
            backward,
            at_master >= 0,
            at_master - k + playout,
            constants,
            memory,
        )
        memory[MEMORY_MASTER_BEFORE] = master
        memory[MEMORY_SLAVE_BEFORE] = slave

        # what goes into the network
        wave_in(FORWARD, forward_wave, constants.step, memory)
        wave_in(BACKWARD, back_wave, constants.step, memory)
        for side in range(2):
            packet = sent[side, k]
            packet[SENT_POSITION] = master if side == FORWARD else slave
            packet[SENT_VELOCITY] = master_velocity if side == FORWARD else slave_velocity
            packet[SENT_LATERAL] = lateral[k] if side == FORWARD else slave_lateral
            packet[SENT_FORCE] = force_reading
            packet[SENT_WAVE] = memory[MEMORY_WAVE_SENT + side]
            packet[SENT_ENERGY] = memory[MEMORY_WAVE_ENERGY_SENT + side]
            if side == BACKWARD:
                packet[SENT_KNOWN] = model[0]
                for i in range(MODEL_SIZE):
                    packet[SENT_MODEL + i] = model[1 + i]
            # sent as if at the next sample: a packet takes one sample at least
            send(
                side,
                float(k),
                k + 1,
                constants.rate,
                constants.delay,
                links,
                packets,
                ring,
                draws[k],
            )

        wish = operator_wish(k, path, out, constants, memory)
        row = out[k]
        row[OUT_TIME] = k * constants.step
        row[OUT_MASTER] = y[Y_MASTER]
        row[OUT_MASTER_VELOCITY] = y[Y_MASTER_VELOCITY]
        row[OUT_SLAVE] = y[Y_SLAVE]
        row[OUT_SLAVE_VELOCITY] = y[Y_SLAVE_VELOCITY]
        row[OUT_LATERAL] = lateral[k]
        row[OUT_SLAVE_LATERAL] = slave_lateral
        row[OUT_HAND_FORCE] = hand_force
        row[OUT_TISSUE_FORCE] = tissue
        row[OUT_FORCE_READING] = force_reading
        row[OUT_POSITION_READING] = slave
        row[OUT_EFFORT_READING] = slave_force + noise[k, 3]
        row[OUT_UPDATE_CHANGE] = change
        row[OUT_TANK] = memory[MEMORY_TANK]
        row[OUT_SLAVE_STIFFNESS] = memory[MEMORY_SLAVE_STIFFNESS]
        row[OUT_SLAVE_TANK] = memory[MEMORY_SLAVE_TANK]
        for side in range(2):
            row[OUT_WAVE_STORED + side] = (
                memory[MEMORY_WAVE_ENERGY_SENT + side] - memory[MEMORY_WAVE_ENERGY_USED + side]
            )
        before = out[k - 1, OUT_WAVE_PORTS] if k > 0 else 0.0
        row[OUT_WAVE_PORTS] = before + constants.step * (master_port + slave_port)
        for i in range(MODEL_SIZE):
            known = memory[MEMORY_RENDERED] > 0.0
            row[OUT_MODEL + i] = memory[MEMORY_MODEL + i] if known else math.nan
        if k == 0:
            row[OUT_HAND_ENERGY] = 0.0
            row[OUT_TISSUE_ENERGY] = 0.0
        else:
            last = out[k - 1]
            row[OUT_HAND_ENERGY] = last[OUT_HAND_ENERGY] + last[OUT_HAND_FORCE] * (
                row[OUT_MASTER] - last[OUT_MASTER]
            )
            row[OUT_TISSUE_ENERGY] = last[OUT_TISSUE_ENERGY] + 0.5 * (
                row[OUT_TISSUE_FORCE] + last[OUT_TISSUE_FORCE]
            ) * (row[OUT_SLAVE] - last[OUT_SLAVE])
        wish_rate = (path[k + 1] - path[k]) * constants.rate
        integrate(
            y,
            work,
            wish,
            wish_rate,
            tremor[k],
            slave_lateral,
            hand_force,
            slave_force,
            constants,
        )
