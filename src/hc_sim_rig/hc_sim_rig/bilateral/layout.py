"""Names of the numbers that the bilateral kernels read and write.

Units: mm, mm/s, N, s; energies in mJ, which are N mm; masses in N s^2/mm (a kg is 0.001 of it).
"""

from __future__ import annotations

from typing import Final, NamedTuple

METHODS: Final = ("direct", "position_position", "wave_variables", "model_mediated")
DIRECT: Final = 0
POSITION_POSITION: Final = 1
WAVE_VARIABLES: Final = 2
MODEL_MEDIATED: Final = 3

LEAST_IMPEDANCE: Final = 1e-4
LARGEST_IMPEDANCE: Final = 10.0
"""[N s/mm] Of the waves: what they are divided by."""

LOWEST: Final = (1e-4, 0.0, 0.5, 0.2)
HIGHEST: Final = (20.0, 5.0, 4.0, 2.0)
"""K, B, n, p between which a model may lie that is sent, taken and rendered."""

FORWARD: Final = 0  # master to slave
BACKWARD: Final = 1

# What a packet holds; a model is K, B, n, p and the surface.
SENT_POSITION: Final = 0
SENT_VELOCITY: Final = 1
SENT_LATERAL: Final = 2
SENT_FORCE: Final = 3
SENT_WAVE: Final = 4  # integral of the wave
SENT_ENERGY: Final = 5  # integral of half its square
SENT_KNOWN: Final = 6  # 1: the model is one
SENT_MODEL: Final = 7
MODEL_SIZE: Final = 5
SENT_COLUMNS: Final = SENT_MODEL + MODEL_SIZE
MODEL_SURE: Final = 1 + MODEL_SIZE  # after 1 if there is a model, and the model: 1 if it is sure
SLAVE_MODEL_SIZE: Final = MODEL_SURE + 1

# The moving state.
Y_MASTER: Final = 0
Y_MASTER_VELOCITY: Final = 1
Y_SLAVE: Final = 2
Y_SLAVE_VELOCITY: Final = 3
Y_SIZE: Final = 4

# What the controllers remember.
MEMORY_MASTER_BEFORE: Final = 0  # [mm] last reading of the master's position
MEMORY_MASTER_VELOCITY: Final = 1  # [mm/s] filtered difference of its readings
MEMORY_SLAVE_BEFORE: Final = 2
MEMORY_SLAVE_VELOCITY: Final = 3
MEMORY_CORRECTION: Final = 4  # [mm] voluntary correction of the operator
MEMORY_WAVE_COMMAND: Final = 5  # [mm] position that the waves ask of the slave
MEMORY_WAVE_SENT: Final = 6  # two columns: integral of the wave sent forward, backward
MEMORY_WAVE_ENERGY_SENT: Final = 8  # two columns
MEMORY_WAVE_USED: Final = 10  # two columns: integral of the wave that came out
MEMORY_WAVE_ENERGY_USED: Final = 12  # two columns
MEMORY_RENDERED: Final = 14  # 1: the master has a model
MEMORY_MODEL: Final = 15  # the model that is rendered
MEMORY_TANK: Final = 20  # [mJ] energy that the renderer may still give
MEMORY_ELASTIC: Final = 21  # [mJ] in the rendered spring
MEMORY_FORCE_BEFORE: Final = 22  # [N] rendered since the last sample
MEMORY_SLAVE_STIFFNESS: Final = 23  # [N/mm] of the slave's controller, where it adapts
MEMORY_SLAVE_TANK: Final = 24  # [mJ] energy that its spring may still take
MEMORY_SLAVE_DEPTH: Final = 25  # [mm] of the last seconds
MEMORY_SIZE: Final = 26

# Columns of the result, one row a sample.
OUT_TIME: Final = 0
OUT_MASTER: Final = 1
OUT_MASTER_VELOCITY: Final = 2
OUT_SLAVE: Final = 3
OUT_SLAVE_VELOCITY: Final = 4
OUT_LATERAL: Final = 5  # of the hand
OUT_SLAVE_LATERAL: Final = 6
OUT_HAND_FORCE: Final = 7  # what the device lets the hand feel
OUT_TISSUE_FORCE: Final = 8  # true
OUT_FORCE_READING: Final = 9
OUT_POSITION_READING: Final = 10  # of the slave
OUT_UPDATE_CHANGE: Final = 11  # [N] of the rendered force by this sample's model update
OUT_TANK: Final = 12  # [mJ]
OUT_HAND_ENERGY: Final = 13  # [mJ] put in by the hand so far
OUT_TISSUE_ENERGY: Final = 14  # [mJ] put into the tissue so far
OUT_WAVE_STORED: Final = 15  # two columns: energy in the waves under way
OUT_WAVE_PORTS: Final = 17  # [mJ] what master and slave have put into the waves, less what came out
OUT_MODEL: Final = 18  # the model that is rendered; NaN without one
OUT_EFFORT_READING: Final = OUT_MODEL + MODEL_SIZE  # [N] of the slave's motor
OUT_SLAVE_STIFFNESS: Final = OUT_EFFORT_READING + 1  # [N/mm] of the slave's controller
OUT_SLAVE_TANK: Final = OUT_SLAVE_STIFFNESS + 1  # [mJ]
OUT_COLUMNS: Final = OUT_SLAVE_TANK + 1

FRICTION_VELOCITY: Final = 0.5
"""[mm/s] Speed at which dry friction has reached tanh(1) of its value (smooth at rest)."""


class Constants(NamedTuple):
    """Everything that stays in a run; see `parts.py` for what it means and where it is from."""

    step: float
    rate: float
    substeps: float
    method: float
    velocity_rate: float  # [1/s] of the filter of measured velocities
    # operator and master
    master_mass: float  # of device and hand
    device_damping: float
    force_limit: float
    hand_stiffness: float
    hand_damping: float
    reaction_samples: float
    correction_rate: float
    correction_limit: float
    # slave
    slave_mass: float
    slave_damping: float
    slave_stiffness: float
    slave_controller_damping: float
    slave_force_limit: float
    slave_friction: float
    # its adaptation to the estimate
    adaptive: float  # 1: it adapts
    stiffness_low: float
    stiffness_high: float
    stiffness_ratio: float
    stiffness_rate: float
    stiffness_force_rate: float
    slave_tank: float
    # tissue
    surface: float
    stiffness: float
    damping: float
    displacement_exponent: float
    velocity_exponent: float
    lump_centre: float
    lump_width: float
    lump_stiffness: float  # added to the factor 1 at the centre
    lump_damping: float
    # feedback
    position_stiffness: float
    position_damping: float
    wave_impedance: float
    wave_stiffness: float
    playout: float  # samples from a packet's stamp to its turn
    # rendering
    update_rate: float
    update_time: float
    largest_stiffness: float  # [N/mm] slope of the rendered spring over depth
    largest_damping: float
    controller_damping: float
    tank_limit: float
    # network
    delay: float  # [s] one way
