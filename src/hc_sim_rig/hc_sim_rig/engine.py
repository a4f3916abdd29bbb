"""The compiled heart of the rig: one function that takes samples and moves the plant on.

`advance` is what both Rig.step (one sample) and Rig.run (many) call, so that both give the same
numbers to the last bit. Order within a sample: true state, sensors, channel and controllers,
output, then the differential equations up to the next sample with the inputs held.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hc_sim_rig.channel_kernel import receive, send
from hc_sim_rig.compilation import compiled, inlined
from hc_sim_rig.layout import (
    DRAW_PROCESS,
    DRIVE_IDEAL,
    DRIVE_TELEOPERATION,
    NOW_DAMPING,
    NOW_DISPLACEMENT_EXPONENT,
    NOW_STIFFNESS,
    NOW_VELOCITY_EXPONENT,
    OUT_COMMAND,
    OUT_CONTACT,
    OUT_DISPLACEMENT,
    OUT_FEEDBACK_FORCE,
    OUT_FORCE,
    OUT_LATERAL,
    OUT_MASTER,
    OUT_OPERATOR_FORCE,
    OUT_PARAMETERS,
    OUT_SENT_FORCE,
    OUT_SLAVE,
    OUT_TIME,
    OUT_TRUE_DISPLACEMENT,
    OUT_TRUE_FORCE,
    OUT_TRUE_VELOCITY,
    PROCESS_POSITION,
    PROCESS_VELOCITY,
    SIDE_BOTH,
    SIDE_MASTER,
    SIDE_SLAVE,
    SIGNAL_ESTIMATED,
    SIGNAL_FILTERED,
    SIGNAL_SENSOR,
    TISSUE_ADHESIVE,
    TISSUE_HUNT_CROSSLEY,
    TISSUE_KELVIN_VOIGT,
    TISSUE_LAYERED,
    TISSUE_NONE,
    TISSUE_OF_OTHERS,
    TISSUE_VISCOELASTIC,
    TUNE_BACKWARD_DELAY,
    TUNE_DISPLACEMENT_NOISE,
    TUNE_FORCE_NOISE,
    TUNE_FORWARD_DELAY,
    TUNE_VALUE,
    Y_ANGLE,
    Y_ANGULAR_VELOCITY,
    Y_BRANCHES,
    Y_POSITION,
    Y_VELOCITY,
)
from hc_sim_rig.manipulator_kernel import (
    force_signal,
    master_input,
    motion_time_after,
    operator_force_at,
    reference_at,
    runge_kutta,
    slave_input,
)
from hc_sim_rig.profile import profile_at
from hc_sim_rig.sensor_kernel import reading
from hc_sim_rig.tissue_kernel import rupture, tissue_force, tissue_now
from hc_sim_rig.tissues_of_others import HAS
from hc_sim_rig.tunables import glide


@inlined
def write_truth(
    line: NDArray[np.float64],
    displacement: float,
    velocity: float,
    force: float,
    kind: int,
    values: NDArray[np.float64],
) -> None:
    """Write the true state and the parameters that the plant has into a line of output."""
    line[OUT_TRUE_DISPLACEMENT] = displacement
    line[OUT_TRUE_VELOCITY] = velocity
    line[OUT_TRUE_FORCE] = force
    line[OUT_PARAMETERS : OUT_PARAMETERS + 4] = np.nan
    if kind in (TISSUE_HUNT_CROSSLEY, TISSUE_ADHESIVE):
        line[OUT_PARAMETERS] = values[NOW_STIFFNESS]
        line[OUT_PARAMETERS + 1] = values[NOW_DAMPING]
        line[OUT_PARAMETERS + 2] = values[NOW_DISPLACEMENT_EXPONENT]
        line[OUT_PARAMETERS + 3] = values[NOW_VELOCITY_EXPONENT]
    elif kind == TISSUE_KELVIN_VOIGT:  # its damping does not grow with depth: no B, no p
        line[OUT_PARAMETERS] = values[NOW_STIFFNESS]
        line[OUT_PARAMETERS + 2] = 1.0
    elif kind >= TISSUE_OF_OTHERS:
        for i in range(4):
            if HAS[kind - TISSUE_OF_OTHERS, i]:
                line[OUT_PARAMETERS + i] = values[NOW_STIFFNESS + i]
    touches = displacement > 0.0 and kind != TISSUE_NONE
    if kind == TISSUE_VISCOELASTIC or kind >= TISSUE_OF_OTHERS:
        # The tip may be below zero and yet above the dented surface.
        touches = force > 0.0
    line[OUT_CONTACT] = 1.0 if touches else 0.0


@inlined
def keep_readings(
    displacement: float,
    force: float,
    config: NDArray[Any],
    state: NDArray[Any],
    step: float,
) -> None:
    """Keep the last finite readings and their low-pass for the controllers."""
    fixed = config[0]
    now = state[0]
    if math.isfinite(displacement):
        now.sensor_position = displacement + fixed.surface
    if math.isfinite(force):
        now.sensor_force = force
    if now.tick == 0:
        now.filtered_force = now.sensor_force
        now.filtered_position = now.sensor_position
        now.filtered_velocity = 0.0
    share = 1.0 - math.exp(-fixed.filter_rate * step)
    now.filtered_force += share * (now.sensor_force - now.filtered_force)
    change = share * (now.sensor_position - now.filtered_position)
    now.filtered_position += change
    now.filtered_velocity = change / step


@inlined
def teleoperate(
    line: NDArray[np.float64],
    value: float,
    rate: float,
    force: float,
    y: NDArray[np.float64],
    config: NDArray[Any],
    state: NDArray[Any],
    tunables: NDArray[np.float64],
    links: NDArray[np.float64],
    packets: NDArray[np.float64],
    ring: NDArray[np.float64],
    draw: NDArray[np.float64],
) -> None:
    """Exchange packets, then compute both controllers' outputs for the next period."""
    fixed = config[0]
    now = state[0]
    position = fixed.position_scale * y[Y_ANGLE]
    forward = tunables[TUNE_FORWARD_DELAY, TUNE_VALUE]
    backward = tunables[TUNE_BACKWARD_DELAY, TUNE_VALUE]
    reflected = force_signal(fixed.feedback_signal, force, now.sensor_force, config, state)
    if fixed.side == SIDE_BOTH:
        send(0, position, now.tick, fixed.rate, forward, links, packets, ring, draw)
        send(1, reflected, now.tick, fixed.rate, backward, links, packets, ring, draw)
        command = receive(0, now.tick, links, packets, ring)
        feedback = receive(1, now.tick, links, packets, ring)
    else:  # the channel is a real one
        command = now.received_command
        feedback = now.received_force
    operator_force = operator_force_at(config, y, value, rate)
    slave_position, slave_velocity = y[Y_POSITION], y[Y_VELOCITY]
    if fixed.motion_signal == SIGNAL_SENSOR:
        slave_position, slave_velocity = now.sensor_position, now.filtered_velocity
    elif fixed.motion_signal == SIGNAL_FILTERED:
        slave_position, slave_velocity = now.filtered_position, now.filtered_velocity
    elif fixed.motion_signal == SIGNAL_ESTIMATED:
        slave_position, slave_velocity = now.estimated_position, now.estimated_velocity
    added = force_signal(fixed.compensation_signal, force, now.sensor_force, config, state)
    if fixed.controlled and fixed.side != SIDE_MASTER:
        now.slave_input = slave_input(command, added, slave_position, slave_velocity, config)
    if fixed.controlled and fixed.side != SIDE_SLAVE:
        now.master_input = master_input(operator_force, feedback, y, config, tunables)
    line[OUT_SENT_FORCE] = reflected
    line[OUT_COMMAND] = command
    line[OUT_OPERATOR_FORCE] = operator_force
    line[OUT_FEEDBACK_FORCE] = feedback
    line[OUT_MASTER] = position
    line[OUT_MASTER + 1] = fixed.position_scale * y[Y_ANGULAR_VELOCITY]
    line[OUT_MASTER + 2] = now.master_input
    line[OUT_SLAVE + 2] = now.slave_input


@inlined
def begin_anew(config: NDArray[Any], state: NDArray[Any], y: NDArray[np.float64]) -> None:
    """After the last sample of a loop: wind the motion back and put a fresh specimen in."""
    now = state[0]
    now.motion_time -= config[0].loop_time
    now.segment = 0
    now.lateral_segment = 0
    now.layer = 0
    now.rupture_factor = 0.0
    now.deepest = 0.0
    now.first_tick = now.tick
    y[Y_BRANCHES:] = 0.0


@compiled
def advance(
    config: NDArray[Any],
    state: NDArray[Any],
    tunables: NDArray[np.float64],
    segments: NDArray[np.float64],
    sines: NDArray[np.float64],
    lateral_segments: NDArray[np.float64],
    lateral_sines: NDArray[np.float64],
    changes: NDArray[np.float64],
    layers: NDArray[np.float64],
    branches: NDArray[np.float64],
    sensors: NDArray[np.float64],
    links: NDArray[np.float64],
    y: NDArray[np.float64],
    memory: NDArray[np.float64],
    history: NDArray[np.float64],
    packets: NDArray[np.float64],
    ring: NDArray[np.float64],
    work: NDArray[np.float64],
    draws: NDArray[np.float64],
    out: NDArray[np.float64],
) -> None:
    """Take samples and move the rig on, one row of `out` per sample.

    Args:
        config: (1,) record of layout.CONFIG.
        state: (1,) record of layout.STATE, changed in place.
        tunables: (T, 3) settings, changed in place (tunables.py).
        segments: (S, 5) waypoints of the motion.
        sines: (M, 3) sines of the motion.
        lateral_segments: (S, 5) waypoints of the sideways motion.
        lateral_sines: (M, 3) sines of it.
        changes: (E, CHANGE_COLUMNS) changes of the tissue in time.
        layers: (L, LAYER_COLUMNS) layers that rupture.
        branches: (M, BRANCH_COLUMNS) viscoelastic branches.
        sensors: (2, SENSOR_COLUMNS) constants of the sensors.
        links: (2, LINK_COLUMNS) constants of the links.
        y: (Y_SIZE,) moving state, changed in place.
        memory: (2, MEMORY_COLUMNS) of the sensors, changed in place.
        history: (2, HISTORY) true values of the last samples, changed in place.
        packets: (2, PACKET_COLUMNS) of the links, changed in place.
        ring: (2, RING, 2) packets under way, changed in place.
        work: (4, Y_SIZE) scratch.
        draws: (R, DRAWS) random draws; needs as many rows left as `out` has.
        out: (N, OUT_COLUMNS) result.
    """
    fixed = config[0]
    now = state[0]
    step = 1.0 / fixed.rate
    substep = step / fixed.substeps
    integrates = fixed.drive != DRIVE_IDEAL or branches.shape[0] > 0
    if fixed.tissue >= TISSUE_OF_OTHERS:  # it may have a state inside
        integrates = True
    values = work[3]
    for row in range(out.shape[0]):
        line = out[row]
        draw = draws[now.draw]
        age = (now.tick - now.first_tick) * step
        lateral, _, segment = profile_at(
            now.motion_time, lateral_segments, lateral_sines, now.lateral_segment
        )
        now.lateral_segment = segment
        lateral += fixed.lateral_offset
        tissue_now(values, config, tunables, changes, age, lateral)
        value, rate = reference_at(0.0, config, state, tunables, segments, sines)
        if fixed.drive == DRIVE_IDEAL:
            y[Y_POSITION] = value
            y[Y_VELOCITY] = rate
        position, velocity = y[Y_POSITION], y[Y_VELOCITY]
        displacement = position - fixed.surface
        force = tissue_force(
            displacement, velocity, y, work[0], config, state, values, layers, branches
        )
        line[OUT_TIME] = now.tick / fixed.rate
        measured = reading(
            0,
            displacement,
            tunables[TUNE_DISPLACEMENT_NOISE, TUNE_VALUE],
            now.tick,
            fixed.rate,
            sensors,
            memory,
            history,
            draw,
        )
        measured_force = reading(
            1,
            force,
            tunables[TUNE_FORCE_NOISE, TUNE_VALUE],
            now.tick,
            fixed.rate,
            sensors,
            memory,
            history,
            draw,
        )
        line[OUT_DISPLACEMENT] = measured
        line[OUT_FORCE] = measured_force
        write_truth(line, displacement, velocity, force, fixed.tissue, values)
        keep_readings(measured, measured_force, config, state, step)
        line[OUT_MASTER] = value
        line[OUT_MASTER + 1] = rate
        line[OUT_MASTER + 2] = 0.0
        line[OUT_SLAVE] = position
        line[OUT_SLAVE + 1] = velocity
        line[OUT_SLAVE + 2] = force
        line[OUT_LATERAL] = lateral
        line[OUT_COMMAND] = value
        line[OUT_OPERATOR_FORCE] = 0.0
        line[OUT_FEEDBACK_FORCE] = 0.0
        line[OUT_SENT_FORCE] = 0.0
        if fixed.drive == DRIVE_TELEOPERATION:
            teleoperate(
                line,
                value,
                rate,
                force,
                y,
                config,
                state,
                tunables,
                links,
                packets,
                ring,
                draw,
            )
        if integrates:
            for k in range(fixed.substeps):
                runge_kutta(
                    k * substep,
                    substep,
                    y,
                    work,
                    config,
                    state,
                    tunables,
                    values,
                    segments,
                    sines,
                    layers,
                    branches,
                )
        if fixed.process == PROCESS_POSITION:
            y[Y_POSITION] += fixed.process_std * draw[DRAW_PROCESS]
        elif fixed.process == PROCESS_VELOCITY:
            y[Y_VELOCITY] += fixed.process_std * draw[DRAW_PROCESS]
        if fixed.tissue == TISSUE_LAYERED:
            rupture(displacement, config, state, layers, step)
        now.tick += 1
        now.draw += 1
        now.motion_time += motion_time_after(step, tunables)
        if fixed.loop_time > 0.0 and now.motion_time >= fixed.loop_time - 0.5 * step:
            begin_anew(config, state, y)
        glide(tunables, fixed.transition_rate, step)
