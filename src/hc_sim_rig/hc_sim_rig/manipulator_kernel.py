"""Compiled manipulators: equations of motion of stage, master and slave, and their controllers.

Equation numbers are those of paper C; the readings that depart from its print are switched by
the scenario (scenario section `readings`), never silently.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hc_sim_rig.compilation import inlined
from hc_sim_rig.layout import (
    DRIVE_IDEAL,
    DRIVE_SERVO,
    OPERATOR_MOTION,
    OPERATOR_NONE,
    SIGNAL_ESTIMATED,
    SIGNAL_FILTERED,
    SIGNAL_SENSOR,
    SIGNAL_TRUE,
    TUNE_AMPLITUDE,
    TUNE_FEEDBACK_GAIN,
    TUNE_RATE,
    TUNE_SPEED,
    TUNE_VALUE,
    Y_ANGLE,
    Y_ANGULAR_VELOCITY,
    Y_POSITION,
    Y_SIZE,
    Y_VELOCITY,
)
from hc_sim_rig.profile import profile_at
from hc_sim_rig.tissue_kernel import tissue_force


@inlined
def motion_time_after(elapsed: float, tunables: NDArray[np.float64]) -> float:
    """Motion time that passes in a time, with a pace that changes steadily [s]."""
    pace = tunables[TUNE_SPEED, TUNE_VALUE] + 0.5 * tunables[TUNE_SPEED, TUNE_RATE] * elapsed
    return float(pace * elapsed)


@inlined
def reference_at(
    elapsed: float,
    config: NDArray[Any],
    state: NDArray[Any],
    tunables: NDArray[np.float64],
    segments: NDArray[np.float64],
    sines: NDArray[np.float64],
) -> Any:
    """Value and rate of the motion (or the operator's profile) some time after this sample."""
    speed = tunables[TUNE_SPEED, TUNE_VALUE] + tunables[TUNE_SPEED, TUNE_RATE] * elapsed
    way = motion_time_after(elapsed, tunables)
    growth = tunables[TUNE_AMPLITUDE, TUNE_RATE]
    amplitude = tunables[TUNE_AMPLITUDE, TUNE_VALUE] + growth * elapsed
    value, rate, segment = profile_at(state[0].motion_time + way, segments, sines, state[0].segment)
    state[0].segment = segment
    return config[0].offset + amplitude * value, amplitude * rate * speed + growth * value


@inlined
def operator_force_at(
    config: NDArray[Any], y: NDArray[np.float64], value: float, rate: float
) -> float:
    """Force of the operator on the master [N]: a profile, or a hand that wants to be somewhere."""
    fixed = config[0]
    if fixed.operator == OPERATOR_MOTION:
        position = fixed.position_scale * y[Y_ANGLE]
        velocity = fixed.position_scale * y[Y_ANGULAR_VELOCITY]
        return float(
            fixed.hand_stiffness * (value - position) + fixed.hand_damping * (rate - velocity)
        )
    if fixed.operator == OPERATOR_NONE:
        return 0.0
    return value


@inlined
def motion_rates(
    elapsed: float,
    y: NDArray[np.float64],
    rates: NDArray[np.float64],
    config: NDArray[Any],
    state: NDArray[Any],
    tunables: NDArray[np.float64],
    values: NDArray[np.float64],
    segments: NDArray[np.float64],
    sines: NDArray[np.float64],
    layers: NDArray[np.float64],
    branches: NDArray[np.float64],
) -> None:
    """Derivatives of the moving state, some time after the sample, with the inputs held."""
    fixed = config[0]
    value, rate = reference_at(elapsed, config, state, tunables, segments, sines)
    if fixed.drive == DRIVE_IDEAL:
        y[Y_POSITION] = value
        y[Y_VELOCITY] = rate
    position, velocity = y[Y_POSITION], y[Y_VELOCITY]
    force = tissue_force(
        position - fixed.surface, velocity, y, rates, config, state, values, layers, branches
    )
    if fixed.drive == DRIVE_IDEAL:
        rates[Y_POSITION] = rate
        rates[Y_VELOCITY] = 0.0
        return
    rates[Y_POSITION] = velocity
    if fixed.drive == DRIVE_SERVO:
        wanted = rate + fixed.servo_position_gain * (value - position)
        wanted = min(max(wanted, -fixed.velocity_limit), fixed.velocity_limit)
        acceleration = fixed.servo_velocity_gain * (wanted - velocity)
        limit = fixed.acceleration_limit
        rates[Y_VELOCITY] = min(max(acceleration, -limit), limit)
        return
    # Eq. 11 (slave) and Eq. 10 (master); springs rest at zero.
    rates[Y_VELOCITY] = (
        state[0].slave_input
        + fixed.force_sign * force
        - fixed.slave_damping * velocity
        - fixed.slave_spring * position
    ) / fixed.slave_mass
    angle, angular_velocity = y[Y_ANGLE], y[Y_ANGULAR_VELOCITY]
    operator_force = operator_force_at(config, y, value, rate)
    rates[Y_ANGLE] = angular_velocity
    rates[Y_ANGULAR_VELOCITY] = (
        state[0].master_input
        + operator_force
        - fixed.master_damping * angular_velocity
        - fixed.master_spring * angle
    ) / fixed.master_inertia


@inlined
def runge_kutta(
    elapsed: float,
    step: float,
    y: NDArray[np.float64],
    work: NDArray[np.float64],
    config: NDArray[Any],
    state: NDArray[Any],
    tunables: NDArray[np.float64],
    values: NDArray[np.float64],
    segments: NDArray[np.float64],
    sines: NDArray[np.float64],
    layers: NDArray[np.float64],
    branches: NDArray[np.float64],
) -> None:
    """One classical Runge-Kutta step of fourth order; `work` is (3, Y_SIZE) of scratch."""
    rates, total, trial = work[0], work[1], work[2]
    for stage in range(4):
        share = 0.0 if stage == 0 else (1.0 if stage == 3 else 0.5)
        weight = 1.0 / 6.0 if stage in (0, 3) else 1.0 / 3.0
        for k in range(Y_SIZE):
            trial[k] = y[k] + share * step * rates[k] if stage > 0 else y[k]
        motion_rates(
            elapsed + share * step,
            trial,
            rates,
            config,
            state,
            tunables,
            values,
            segments,
            sines,
            layers,
            branches,
        )
        for k in range(Y_SIZE):
            total[k] = (total[k] if stage > 0 else 0.0) + weight * rates[k]
    for k in range(Y_SIZE):
        y[k] += step * total[k]


@inlined
def force_signal(
    choice: int, force: float, measured: float, config: NDArray[Any], state: NDArray[Any]
) -> float:
    """The force that a controller uses: true, sensor, filtered or estimated."""
    if choice == SIGNAL_TRUE:
        return force
    if choice == SIGNAL_SENSOR:
        return measured
    if choice == SIGNAL_FILTERED:
        return float(state[0].filtered_force)
    if choice == SIGNAL_ESTIMATED:
        return float(state[0].estimated_force)
    return 0.0


@inlined
def slave_input(
    command: float,
    force: float,
    position: float,
    velocity: float,
    config: NDArray[Any],
) -> float:
    """Control of the slave u_s, Eq. 13 to 15 [N].

    Args:
        command: received position of the master [mm].
        force: contact force that Eq. 13 adds [N].
        position: position of the slave as the controller knows it [mm].
        velocity: its velocity [mm/s].
        config: (1,) record.
    """
    fixed = config[0]
    ratio = fixed.slave_mass / fixed.desired_mass
    excess = fixed.tuning * ratio * (fixed.prefilter * command - position)  # Eq. 14
    impedance = (fixed.slave_spring - ratio * fixed.desired_slave_spring) * position + (
        fixed.slave_damping - ratio * fixed.desired_slave_damping
    ) * velocity  # Eq. 15
    return float(fixed.compensation * force + excess + impedance)  # Eq. 13


@inlined
def master_input(
    operator_force: float,
    feedback: float,
    y: NDArray[np.float64],
    config: NDArray[Any],
    tunables: NDArray[np.float64],
) -> float:
    """Control of the master u_m, Eq. 16 and 17 [N].

    Args:
        operator_force: force of the operator [N].
        feedback: received contact force [N].
        y: (Y_SIZE,) moving state.
        config: (1,) record.
        tunables: (T, 3) settings.
    """
    fixed = config[0]
    ratio = fixed.master_inertia / fixed.desired_inertia
    impedance = (fixed.master_spring - ratio * fixed.desired_spring) * y[Y_ANGLE] + (
        fixed.master_damping - ratio * fixed.desired_damping
    ) * y[Y_ANGULAR_VELOCITY]  # Eq. 17
    reflected = tunables[TUNE_FEEDBACK_GAIN, TUNE_VALUE] * feedback
    return float(-operator_force + ratio * (operator_force - reflected) + impedance)  # Eq. 16
