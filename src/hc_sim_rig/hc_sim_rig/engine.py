"""The compiled heart of the rig: one function that takes samples and moves the plant on.

`advance` is what both Rig.step (one sample) and Rig.run (many) call, so that both give the same
numbers to the last bit.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hc_estimator.contact import hunt_crossley_force
from hc_sim_rig.compilation import compiled
from hc_sim_rig.layout import (
    DRAW_DISPLACEMENT_NOISE,
    DRAW_FORCE_NOISE,
    OUT_CONTACT,
    OUT_DISPLACEMENT,
    OUT_FORCE,
    OUT_MASTER,
    OUT_PARAMETERS,
    OUT_SLAVE,
    OUT_TIME,
    OUT_TRUE_DISPLACEMENT,
    OUT_TRUE_FORCE,
    OUT_TRUE_VELOCITY,
    TUNE_AMPLITUDE,
    TUNE_DAMPING,
    TUNE_DISPLACEMENT_EXPONENT,
    TUNE_DISPLACEMENT_NOISE,
    TUNE_FORCE_NOISE,
    TUNE_RATE,
    TUNE_SPEED,
    TUNE_STIFFNESS,
    TUNE_VALUE,
    TUNE_VELOCITY_EXPONENT,
)
from hc_sim_rig.profile import profile_at
from hc_sim_rig.tunables import glide


@compiled
def advance(
    config: NDArray[Any],
    state: NDArray[Any],
    tunables: NDArray[np.float64],
    segments: NDArray[np.float64],
    sines: NDArray[np.float64],
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
        draws: (R, D) random draws; needs as many rows left as `out` has.
        out: (N, OUT_COLUMNS) result.
    """
    fixed = config[0]
    now = state[0]
    step = 1.0 / fixed.rate
    for row in range(out.shape[0]):
        speed = tunables[TUNE_SPEED, TUNE_VALUE]
        amplitude = tunables[TUNE_AMPLITUDE, TUNE_VALUE]
        stiffness = tunables[TUNE_STIFFNESS, TUNE_VALUE]
        damping = tunables[TUNE_DAMPING, TUNE_VALUE]
        exponent = tunables[TUNE_DISPLACEMENT_EXPONENT, TUNE_VALUE]
        velocity_exponent = tunables[TUNE_VELOCITY_EXPONENT, TUNE_VALUE]
        value, rate, segment = profile_at(now.motion_time, segments, sines, now.segment)
        now.segment = segment
        position = fixed.offset + amplitude * value
        velocity = amplitude * rate * speed + tunables[TUNE_AMPLITUDE, TUNE_RATE] * value
        displacement = position - fixed.surface
        force = hunt_crossley_force(
            displacement, velocity, stiffness, damping, exponent, velocity_exponent
        )
        draw = draws[now.draw]
        out[row, OUT_TIME] = now.tick / fixed.rate
        out[row, OUT_DISPLACEMENT] = (
            displacement
            + tunables[TUNE_DISPLACEMENT_NOISE, TUNE_VALUE] * draw[DRAW_DISPLACEMENT_NOISE]
        )
        out[row, OUT_FORCE] = (
            force + tunables[TUNE_FORCE_NOISE, TUNE_VALUE] * draw[DRAW_FORCE_NOISE]
        )
        out[row, OUT_TRUE_DISPLACEMENT] = displacement
        out[row, OUT_TRUE_VELOCITY] = velocity
        out[row, OUT_TRUE_FORCE] = force
        out[row, OUT_PARAMETERS] = stiffness
        out[row, OUT_PARAMETERS + 1] = damping
        out[row, OUT_PARAMETERS + 2] = exponent
        out[row, OUT_PARAMETERS + 3] = velocity_exponent
        out[row, OUT_CONTACT] = 1.0 if displacement > 0.0 else 0.0
        out[row, OUT_MASTER] = position
        out[row, OUT_MASTER + 1] = velocity
        out[row, OUT_MASTER + 2] = 0.0
        out[row, OUT_SLAVE] = position
        out[row, OUT_SLAVE + 1] = velocity
        out[row, OUT_SLAVE + 2] = force
        now.tick += 1
        now.draw += 1
        now.motion_time += step * speed
        if fixed.loop_time > 0.0 and now.motion_time >= fixed.loop_time:
            now.motion_time -= fixed.loop_time
            now.segment = 0
        glide(tunables, fixed.transition_rate, step)
