"""Names of the numbers that the compiled rig reads and writes: one place for every index.

The kernels work on flat records and arrays so that one compiled function serves all scenarios.
`CONFIG` is what a scenario fixes, `STATE` what changes from sample to sample, the tunables are
the settings that may change while the rig runs, `OUT_*` the columns that come back.
Units: mm, mm/s, N, s, rad; the master's angle in rad, its torque in the papers' N.
"""

from __future__ import annotations

from typing import Final

import numpy as np

# Settings that may change while the rig runs; each glides to its target (see tunables.py).
TUNE_SPEED: Final = 0  # [1] pace of the motion; 0 stands still
TUNE_AMPLITUDE: Final = 1  # [1] scale of the motion (or of the operator's force)
TUNE_STIFFNESS: Final = 2  # [N/mm^n] K
TUNE_DAMPING: Final = 3  # [N (s/mm)^p / mm^n] B
TUNE_DISPLACEMENT_EXPONENT: Final = 4  # [1] n
TUNE_VELOCITY_EXPONENT: Final = 5  # [1] p
TUNE_DISPLACEMENT_NOISE: Final = 6  # [mm] standard deviation
TUNE_FORCE_NOISE: Final = 7  # [N] standard deviation
TUNE_TISSUE_SCALE: Final = 8  # [1] factor on every force of the tissue
TUNE_FEEDBACK_GAIN: Final = 9  # [1] k_f of the master's controller
TUNE_FORWARD_DELAY: Final = 10  # [s] master to slave
TUNE_BACKWARD_DELAY: Final = 11  # [s] slave to master
TUNABLES: Final = 12

# Columns of the tunables' array.
TUNE_VALUE: Final = 0
TUNE_RATE: Final = 1
TUNE_TARGET: Final = 2

# Columns of the random draws: one generator each, so that switching one on moves no other.
DRAW_NOISE: Final = 0  # two columns: displacement, force
DRAW_PROCESS: Final = 2
DRAW_WALK: Final = 3  # two columns
DRAW_SPIKE: Final = 5  # two columns, uniform
DRAW_DROPOUT: Final = 7  # two columns, uniform
DRAW_JITTER: Final = 9  # two columns: forward, backward
DRAW_LOSS: Final = 11  # two columns, uniform
DRAW_BURST: Final = 13  # two columns, uniform
DRAWS: Final = 15

# Columns of the output.
OUT_TIME: Final = 0
OUT_DISPLACEMENT: Final = 1
OUT_FORCE: Final = 2
OUT_TRUE_DISPLACEMENT: Final = 3
OUT_TRUE_VELOCITY: Final = 4
OUT_TRUE_FORCE: Final = 5
OUT_PARAMETERS: Final = 6  # four columns K, B, n, p
OUT_CONTACT: Final = 10
OUT_MASTER: Final = 11  # three columns position, velocity, effort
OUT_SLAVE: Final = 14  # three columns, the same
OUT_LATERAL: Final = 17  # [mm] sideways position of the tool
OUT_COMMAND: Final = 18  # [mm] position that the slave has received
OUT_OPERATOR_FORCE: Final = 19  # [N]
OUT_FEEDBACK_FORCE: Final = 20  # [N] force that the master has received
OUT_SENT_FORCE: Final = 21  # [N] force that the slave sends
OUT_COLUMNS: Final = 22

# Columns of a motion's tables.
SEGMENT_COLUMNS: Final = 5  # start time, end time, start value, end value, shape
SINE_COLUMNS: Final = 3  # amplitude, angular frequency, phase
SHAPE_LINEAR: Final = 0.0
SHAPE_MINIMUM_JERK: Final = 1.0
SHAPE_SPEEDING_UP: Final = 2.0  # from rest, at a constant acceleration
SHAPE_SLOWING_DOWN: Final = 3.0  # to rest, the same

# What carries the tool.
DRIVE_IDEAL: Final = 0
DRIVE_SERVO: Final = 1
DRIVE_TELEOPERATION: Final = 2

# What the tool meets.
TISSUE_NONE: Final = 0
TISSUE_HUNT_CROSSLEY: Final = 1
TISSUE_KELVIN_VOIGT: Final = 2
TISSUE_VISCOELASTIC: Final = 3
TISSUE_LAYERED: Final = 4
TISSUE_ADHESIVE: Final = 5
TISSUE_OF_OTHERS: Final = 6  # and all above: those of other packages

# Current values of the tissue.
NOW_STIFFNESS: Final = 0
NOW_DAMPING: Final = 1
NOW_DISPLACEMENT_EXPONENT: Final = 2
NOW_VELOCITY_EXPONENT: Final = 3
NOW_SCALE: Final = 4
NOW_COLUMNS: Final = 5

# Tables of the tissue.
CHANGE_COLUMNS: Final = 6  # time, duration, factor on K, factor on B, added to n, added to p
LAYER_COLUMNS: Final = 4  # start depth, rupture depth, stiffness, exponent
BRANCH_COLUMNS: Final = 2  # stiffness relative to K, time constant
MAX_BRANCHES: Final = 4

# The moving state: what the differential equations describe.
Y_POSITION: Final = 0  # [mm] tool, slave or stage
Y_VELOCITY: Final = 1  # [mm/s]
Y_ANGLE: Final = 2  # [rad] master
Y_ANGULAR_VELOCITY: Final = 3  # [rad/s]
Y_BRANCHES: Final = 4  # [mm] where the dashpots of the viscoelastic branches stand
Y_SIZE: Final = Y_BRANCHES + MAX_BRANCHES

# Which force (or motion) a controller uses.
SIGNAL_TRUE: Final = 0
SIGNAL_SENSOR: Final = 1
SIGNAL_FILTERED: Final = 2
SIGNAL_ESTIMATED: Final = 3

OPERATOR_FORCE: Final = 0
OPERATOR_MOTION: Final = 1
OPERATOR_NONE: Final = 2

# Which half of a teleoperation is simulated here; the other one is on another host.
SIDE_BOTH: Final = 0
SIDE_MASTER: Final = 1
SIDE_SLAVE: Final = 2

# Where the process noise enters.
PROCESS_NONE: Final = 0
PROCESS_POSITION: Final = 1
PROCESS_VELOCITY: Final = 2

# Columns of a sensor's constants (rows: displacement, force).
SENSOR_BIAS: Final = 0
SENSOR_DRIFT: Final = 1  # per second
SENSOR_WALK: Final = 2  # standard deviation per square root of a second
SENSOR_DELAY: Final = 3  # [s]
SENSOR_RESOLUTION: Final = 4
SENSOR_MINIMUM: Final = 5
SENSOR_MAXIMUM: Final = 6
SENSOR_SPIKE_PROBABILITY: Final = 7
SENSOR_SPIKE_SIZE: Final = 8
SENSOR_DROPOUT_PROBABILITY: Final = 9
SENSOR_DROPOUT_END: Final = 10  # probability that a dropout ends at a sample
SENSOR_DROPOUT_NAN: Final = 11  # 1: reads NaN meanwhile, 0: holds the last reading
SENSOR_COLUMNS: Final = 12

# Columns of a sensor's memory.
MEMORY_WALK: Final = 0
MEMORY_HELD: Final = 1
MEMORY_DROPPED: Final = 2
MEMORY_COLUMNS: Final = 3

HISTORY: Final = 4096
"""Samples of the true values kept for sensors that are late."""

# Columns of a link's constants (rows: forward, backward).
LINK_VARIATION: Final = 0  # [s] amplitude of the slow variation of the delay
LINK_VARIATION_RATE: Final = 1  # [rad/s]
LINK_JITTER: Final = 2  # [s] standard deviation
LINK_LOSS: Final = 3  # probability
LINK_BURST_BEGIN: Final = 4  # probability per packet
LINK_BURST_END: Final = 5  # probability per packet
LINK_OVERTAKING: Final = 6  # 1: packets may overtake
LINK_NEWEST: Final = 7  # 1: the receiver ignores what is older than what it has
LINK_COLUMNS: Final = 8

# Columns of a link's memory.
PACKET_VALUE: Final = 0  # what the receiver has
PACKET_SEQUENCE: Final = 1  # of it
PACKET_LAST_ARRIVAL: Final = 2  # tick
PACKET_BURST: Final = 3  # 1 while a burst swallows packets
PACKETS_LOST: Final = 4
PACKETS_OVERTAKEN: Final = 5
PACKET_COLUMNS: Final = 6

RING: Final = 4096
"""Ticks of a link: no packet may travel longer."""

NO_PACKET: Final = -1.0

CONFIG: Final = np.dtype(
    [
        ("rate", "f8"),  # [Hz]
        ("substeps", "i8"),  # integration steps per sample
        ("transition_rate", "f8"),  # [1/s] of the tunables' glide
        ("surface", "f8"),  # [mm] where the tissue begins
        ("loop_time", "f8"),  # [s] motion time after which everything begins anew; 0: never
        ("offset", "f8"),  # [mm] part of the motion that the amplitude does not scale
        ("lateral_offset", "f8"),  # [mm]
        ("drive", "i8"),
        ("servo_position_gain", "f8"),  # [1/s]
        ("servo_velocity_gain", "f8"),  # [1/s]
        ("velocity_limit", "f8"),  # [mm/s]
        ("acceleration_limit", "f8"),  # [mm/s^2]
        ("side", "i8"),
        ("operator", "i8"),
        ("hand_stiffness", "f8"),  # [N/mm]
        ("hand_damping", "f8"),  # [N s/mm]
        ("master_inertia", "f8"),  # j_m
        ("master_damping", "f8"),  # b_m
        ("master_spring", "f8"),  # k_m
        ("desired_inertia", "f8"),  # j_dm
        ("desired_damping", "f8"),  # b_dm
        ("desired_spring", "f8"),  # k_dm
        ("slave_mass", "f8"),  # m_s [N s^2/mm]
        ("slave_damping", "f8"),  # b_s [N s/mm]
        ("slave_spring", "f8"),  # k_s [N/mm]
        ("desired_mass", "f8"),  # m_ds
        ("desired_slave_damping", "f8"),  # b_ds
        ("desired_slave_spring", "f8"),  # k_ds
        ("tuning", "f8"),  # K_tun
        ("position_scale", "f8"),  # k_x [mm/rad]
        ("prefilter", "f8"),  # [1] factor on the received position
        ("controlled", "i8"),
        ("compensation", "f8"),  # 1: F_e in Eq. 13, 0: without
        ("force_sign", "f8"),  # -1: the contact force opposes the slave, 1: Eq. 18 as printed
        ("feedback_signal", "i8"),
        ("compensation_signal", "i8"),
        ("motion_signal", "i8"),
        ("filter_rate", "f8"),  # [1/s] of the low-pass behind SIGNAL_FILTERED
        ("tissue", "i8"),
        ("inclusion_centre", "f8"),  # [mm] sideways
        ("inclusion_width", "f8"),  # [mm] standard deviation of the bell; 0: no inclusion
        ("inclusion_stiffness", "f8"),  # [1] added to K's factor at the centre
        ("inclusion_damping", "f8"),  # [1] added to B's factor at the centre
        ("rupture_time", "f8"),  # [s] time constant with which a ruptured layer lets go
        ("shaft_friction", "f8"),  # [N/mm] of the inserted length
        ("cutting_force", "f8"),  # [N] at the tip while it goes deeper than ever
        ("process", "i8"),
        ("process_std", "f8"),  # per sample
    ]
)

STATE: Final = np.dtype(
    [
        ("tick", "i8"),  # sequence of the next sample
        ("first_tick", "i8"),  # first sample of this specimen (a loop begins a new one)
        ("draw", "i8"),  # row of the random draws for the next sample
        ("motion_time", "f8"),  # [s] runs with the pace of the motion
        ("segment", "i8"),  # of the motion, where the last look-up ended
        ("lateral_segment", "i8"),
        ("layer", "i8"),  # layers ruptured so far
        ("rupture_factor", "f8"),  # what the last ruptured layer still holds
        ("deepest", "f8"),  # [mm] deepest penetration so far
        ("filtered_force", "f8"),  # [N]
        ("filtered_position", "f8"),  # [mm]
        ("filtered_velocity", "f8"),  # [mm/s]
        ("sensor_force", "f8"),  # [N] last finite reading
        ("sensor_position", "f8"),  # [mm] of the tool, from the last finite reading
        ("received_command", "f8"),  # [mm] put in from another host
        ("received_force", "f8"),  # [N] put in from another host
        ("estimated_force", "f8"),  # [N] put in by the estimator in the loop
        ("estimated_position", "f8"),  # [mm] of the tool, the same
        ("estimated_velocity", "f8"),  # [mm/s] the same
        ("master_input", "f8"),  # u_m
        ("slave_input", "f8"),  # u_s [N]
    ]
)
