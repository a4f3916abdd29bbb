"""From a scenario to the arrays that the compiled rig works on."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hc_sim_rig.drives import MotionOperator, Stage, Teleoperation
from hc_sim_rig.layout import (
    CONFIG,
    DRAW_BURST,
    DRAW_DROPOUT,
    DRAW_LOSS,
    DRAW_NOISE,
    DRAW_PROCESS,
    DRAW_SPIKE,
    DRAWS,
    DRIVE_IDEAL,
    DRIVE_SERVO,
    DRIVE_TELEOPERATION,
    HISTORY,
    LINK_COLUMNS,
    MEMORY_COLUMNS,
    NO_PACKET,
    OPERATOR_FORCE,
    OPERATOR_MOTION,
    OPERATOR_NONE,
    PACKET_COLUMNS,
    PACKET_SEQUENCE,
    PROCESS_NONE,
    PROCESS_POSITION,
    PROCESS_VELOCITY,
    RING,
    SIDE_BOTH,
    SIDE_MASTER,
    SIDE_SLAVE,
    SIGNAL_ESTIMATED,
    SIGNAL_FILTERED,
    SIGNAL_SENSOR,
    SIGNAL_TRUE,
    STATE,
    TISSUE_ADHESIVE,
    TISSUE_HUNT_CROSSLEY,
    TISSUE_KELVIN_VOIGT,
    TISSUE_LAYERED,
    TISSUE_NONE,
    TISSUE_OF_OTHERS,
    TISSUE_VISCOELASTIC,
    TUNABLES,
    TUNE_AMPLITUDE,
    TUNE_BACKWARD_DELAY,
    TUNE_DAMPING,
    TUNE_DISPLACEMENT_EXPONENT,
    TUNE_DISPLACEMENT_NOISE,
    TUNE_FEEDBACK_GAIN,
    TUNE_FORCE_NOISE,
    TUNE_FORWARD_DELAY,
    TUNE_SPEED,
    TUNE_STIFFNESS,
    TUNE_TARGET,
    TUNE_TISSUE_SCALE,
    TUNE_VALUE,
    TUNE_VELOCITY_EXPONENT,
    Y_ANGLE,
    Y_POSITION,
    Y_SIZE,
)
from hc_sim_rig.profile import Profile, profile_at, profile_from_points
from hc_sim_rig.scenario import Scenario
from hc_sim_rig.sensors import Noise, Variates
from hc_sim_rig.tissues import MM_PER_UNIT, branch_table, change_table, layer_table
from hc_sim_rig.tissues_of_others import OTHERS

Array = NDArray[np.float64]

GLIDE_SHARE = 5.83
"""A critically damped response is 98 % there after 5.83 / natural frequency."""

NO_SIGNAL = -1
TISSUES = {
    "none": TISSUE_NONE,
    "hunt_crossley": TISSUE_HUNT_CROSSLEY,
    "adhesive": TISSUE_ADHESIVE,
    "kelvin_voigt": TISSUE_KELVIN_VOIGT,
    "viscoelastic": TISSUE_VISCOELASTIC,
    "layered": TISSUE_LAYERED,
    **{name: TISSUE_OF_OTHERS + code for code, name in enumerate(OTHERS)},
}
SIGNALS = {
    "none": NO_SIGNAL,
    "true": SIGNAL_TRUE,
    "sensor": SIGNAL_SENSOR,
    "filtered": SIGNAL_FILTERED,
    "estimated": SIGNAL_ESTIMATED,
}
SIDES = {"both": SIDE_BOTH, "master": SIDE_MASTER, "slave": SIDE_SLAVE}
PROCESSES = {"none": PROCESS_NONE, "position": PROCESS_POSITION, "velocity": PROCESS_VELOCITY}


class Constants(NamedTuple):
    """What a scenario fixes, in the order in which `advance` takes it."""

    segments: Array
    sines: Array
    lateral_segments: Array
    lateral_sines: Array
    changes: Array
    layers: Array
    branches: Array
    sensors: Array
    links: Array


class Memory(NamedTuple):
    """What changes while the rig runs, in the order in which `advance` takes it."""

    y: Array
    memory: Array
    history: Array
    packets: Array
    ring: Array
    work: Array


def configuration(scenario: Scenario, side: str = "both") -> NDArray[np.void]:
    """(1,) record of layout.CONFIG for a scenario, or for one side of a teleoperation."""
    record = np.zeros(1, CONFIG)
    config = record[0]
    config["rate"] = scenario.rate_hz
    config["substeps"] = scenario.substeps
    if scenario.transition_time_s > 0.0:
        config["transition_rate"] = GLIDE_SHARE / scenario.transition_time_s
    config["surface"] = scenario.tissue.surface_mm
    config["offset"] = scenario.motion().profile().offset
    if scenario.at_end == "loop":
        config["loop_time"] = scenario.duration_s
    _configure_tissue(config, scenario)
    if isinstance(scenario.drive, Teleoperation):
        _configure_teleoperation(config, scenario.drive)
        config["side"] = SIDES[side]
        if side == "master":  # the tissue is where the slave is, and so is the slave
            config["tissue"] = TISSUE_NONE
            config["process"] = PROCESS_NONE
        elif side == "slave":
            config["operator"] = OPERATOR_NONE
    else:
        _configure_stage(config, scenario.drive)
    return record


def _configure_stage(config: np.void, stage: Stage) -> None:
    config["drive"] = DRIVE_IDEAL if stage.dynamics == "ideal" else DRIVE_SERVO
    gain = 2.0 * math.pi * stage.bandwidth_hz
    config["servo_position_gain"] = 0.5 * gain  # with four times that: two poles at `gain`
    config["servo_velocity_gain"] = 2.0 * gain
    config["velocity_limit"] = stage.velocity_limit_mm_s
    config["acceleration_limit"] = stage.acceleration_limit_mm_s2
    config["process"] = PROCESSES[stage.process_noise.enters]
    config["process_std"] = stage.process_noise.std
    if stage.lateral is not None:
        config["lateral_offset"] = stage.lateral.profile().offset


def _configure_teleoperation(config: np.void, drive: Teleoperation) -> None:
    master, slave = drive.master, drive.slave
    unit = MM_PER_UNIT[drive.length_unit]
    config["drive"] = DRIVE_TELEOPERATION
    config["operator"] = OPERATOR_FORCE
    if isinstance(drive.operator, MotionOperator):
        config["operator"] = OPERATOR_MOTION
        config["hand_stiffness"] = drive.operator.hand_stiffness_n_per_mm
        config["hand_damping"] = drive.operator.hand_damping_n_s_per_mm
    config["master_inertia"] = master.inertia
    config["master_damping"] = master.damping
    config["master_spring"] = master.spring
    config["desired_inertia"] = master.desired_inertia
    config["desired_damping"] = master.desired_damping
    config["desired_spring"] = master.desired_spring
    config["slave_mass"] = slave.mass / unit
    config["slave_damping"] = slave.damping / unit
    config["slave_spring"] = slave.spring / unit
    config["desired_mass"] = slave.desired_mass / unit
    config["desired_slave_damping"] = slave.desired_damping / unit
    config["desired_slave_spring"] = slave.desired_spring / unit
    config["tuning"] = slave.tuning / unit
    config["position_scale"] = slave.position_scale * unit
    droop = (slave.tuning + slave.desired_spring) / slave.tuning
    readings, signals = drive.readings, drive.signals
    config["prefilter"] = droop if readings.tracking_prefilter else 1.0
    config["controlled"] = drive.control == "impedance"
    config["compensation"] = 1.0 if readings.eq13_adds_contact_force else 0.0
    config["force_sign"] = -1.0 if readings.eq18_force_opposes_slave else 1.0
    if not readings.eq12_subtracts_surface:
        config["surface"] = 0.0
    config["feedback_signal"] = SIGNALS[signals.feedback_force]
    config["compensation_signal"] = SIGNALS[signals.compensation_force]
    config["motion_signal"] = SIGNALS[signals.slave_motion]
    config["filter_rate"] = 2.0 * math.pi * signals.filter_hz
    config["process"] = PROCESSES[drive.process_noise.enters]
    config["process_std"] = drive.process_noise.std


def _configure_tissue(config: np.void, scenario: Scenario) -> None:
    tissue = scenario.tissue
    config["tissue"] = TISSUES[tissue.kind]
    inclusion = getattr(tissue, "inclusion", None)
    if inclusion is not None:
        config["inclusion_centre"] = inclusion.centre_mm
        config["inclusion_width"] = inclusion.width_mm
        config["inclusion_stiffness"] = inclusion.stiffness_factor - 1.0
        config["inclusion_damping"] = inclusion.damping_factor - 1.0
    config["rupture_time"] = getattr(tissue, "rupture_time_s", 0.0)
    config["shaft_friction"] = getattr(tissue, "shaft_friction_n_per_mm", 0.0)
    config["cutting_force"] = getattr(tissue, "cutting_force_n", 0.0)


def constants(scenario: Scenario) -> Constants:
    """Tables of a scenario."""
    profile = scenario.motion().profile()
    lateral = getattr(scenario.drive, "lateral", None)
    sideways = profile_from_points([(0.0, 0.0)], 0.0) if lateral is None else lateral.profile()
    links = np.zeros((2, LINK_COLUMNS))
    if isinstance(scenario.drive, Teleoperation):
        channel = scenario.drive.channel
        links = np.array([channel.forward.constants(), channel.backward.constants()])
    sensors = scenario.sensors
    return Constants(
        profile.segments,
        profile.sines,
        sideways.segments,
        sideways.sines,
        change_table(scenario.tissue),
        layer_table(scenario.tissue),
        branch_table(scenario.tissue),
        np.array([sensors.displacement.constants(), sensors.force.constants()]),
        links,
    )


def first_state() -> NDArray[np.void]:
    """(1,) record of layout.STATE at the beginning."""
    return np.zeros(1, STATE)


def first_memory(scenario: Scenario) -> Memory:
    """Memory of a rig at its beginning."""
    y = np.zeros(Y_SIZE)
    packets = np.zeros((2, PACKET_COLUMNS))
    packets[:, PACKET_SEQUENCE] = NO_PACKET
    ring = np.full((2, RING, 2), NO_PACKET)
    drive = scenario.drive
    if isinstance(drive, Teleoperation):
        y[Y_ANGLE] = drive.master.start_rad
        y[Y_POSITION] = drive.slave.start * MM_PER_UNIT[drive.length_unit]
    else:
        y[Y_POSITION] = profile_start(scenario.motion().profile())
    return Memory(
        y,
        np.zeros((2, MEMORY_COLUMNS)),
        np.zeros((2, HISTORY)),
        packets,
        ring,
        np.zeros((4, Y_SIZE)),
    )


def profile_start(profile: Profile) -> float:
    """Value of a profile at the beginning."""
    value, _, _ = profile_at(0.0, profile.segments, profile.sines, 0)
    return float(profile.offset + value)


def first_tunables(scenario: Scenario) -> Array:
    """(TUNABLES, 3) settings at the beginning, at rest."""
    stiffness, damping, displacement_exponent, velocity_exponent = scenario.tissue.values()
    values = {
        TUNE_SPEED: 1.0,
        TUNE_AMPLITUDE: 1.0,
        TUNE_STIFFNESS: stiffness,
        TUNE_DAMPING: damping,
        TUNE_DISPLACEMENT_EXPONENT: displacement_exponent,
        TUNE_VELOCITY_EXPONENT: velocity_exponent,
        TUNE_DISPLACEMENT_NOISE: scenario.sensors.displacement.noise_std_mm,
        TUNE_FORCE_NOISE: scenario.sensors.force.noise_std_n,
        TUNE_TISSUE_SCALE: 1.0,
    }
    drive = scenario.drive
    if isinstance(drive, Teleoperation):
        values[TUNE_FEEDBACK_GAIN] = drive.feedback_gain
        values[TUNE_FORWARD_DELAY] = drive.channel.forward.delay_s
        values[TUNE_BACKWARD_DELAY] = drive.channel.backward.delay_s
    tunables = np.zeros((TUNABLES, 3))
    for row, value in values.items():
        tunables[row, TUNE_VALUE] = value
        tunables[row, TUNE_TARGET] = value
    return tunables


def variates(scenario: Scenario) -> list[Variates]:
    """What draws each column of the random draws."""
    drawers: list[Variates] = [Noise().variates()] * DRAWS
    drawers[DRAW_NOISE] = scenario.sensors.displacement.noise.variates()
    drawers[DRAW_NOISE + 1] = scenario.sensors.force.noise.variates()
    drawers[DRAW_PROCESS] = scenario.drive.process_noise.noise.variates()
    for column in (DRAW_SPIKE, DRAW_DROPOUT, DRAW_LOSS, DRAW_BURST):
        drawers[column] = drawers[column + 1] = lambda generator, count: generator.random(count)
    return drawers
