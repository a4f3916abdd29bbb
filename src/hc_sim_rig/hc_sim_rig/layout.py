"""Names of the numbers that the compiled rig reads and writes: one place for every index.

The kernels work on flat records and arrays so that one compiled function serves all scenarios.
`CONFIG` is what a scenario fixes, `STATE` what changes from sample to sample, the tunables are
the settings that may change while the rig runs, `OUT_*` the columns that come back.
Units: mm, mm/s, N, s, rad.
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
TUNABLES: Final = 8

# Columns of the tunables' array.
TUNE_VALUE: Final = 0
TUNE_RATE: Final = 1
TUNE_TARGET: Final = 2

# Columns of the random draws: one generator each, so that switching one on moves no other.
DRAW_DISPLACEMENT_NOISE: Final = 0
DRAW_FORCE_NOISE: Final = 1
DRAWS: Final = 2

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
OUT_COLUMNS: Final = 17

# Columns of a motion's tables.
SEGMENT_COLUMNS: Final = 5  # start time, end time, start value, end value, shape
SINE_COLUMNS: Final = 3  # amplitude, angular frequency, phase
SHAPE_LINEAR: Final = 0.0
SHAPE_MINIMUM_JERK: Final = 1.0

CONFIG: Final = np.dtype(
    [
        ("rate", "f8"),  # [Hz]
        ("transition_rate", "f8"),  # [1/s] of the tunables' glide
        ("surface", "f8"),  # [mm] where the tissue begins
        ("loop_time", "f8"),  # [s] motion time after which everything begins anew; 0: never
        ("offset", "f8"),  # [mm] part of the motion that the amplitude does not scale
    ]
)

STATE: Final = np.dtype(
    [
        ("tick", "i8"),  # sequence of the next sample
        ("draw", "i8"),  # row of the random draws for the next sample
        ("motion_time", "f8"),  # [s] runs with the pace of the motion
        ("segment", "i8"),  # of the motion, where the last look-up ended
    ]
)
