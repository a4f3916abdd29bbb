"""The proposal `motion` of `sir_pf`: particles' motion drawn from a Kalman filter of its own.

The motion filter is that of `kinematic`, by the displacement alone.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hc_estimator.compilation import compiled
from hc_estimator.linear_algebra import cholesky, clear_matrix, clear_vector
from hc_estimator.memory import Field
from hc_estimator.state_space import kinematic
from hc_estimator.vector_mathematics import add_scaled

FIELDS = (
    Field("motion_state", np.float64, (7,)),  # of the motion filter; the first three count
    Field("motion_covariance", np.float64, (7, 7), covariance=True),
)


@compiled
def draw_motion(
    memory: Any,
    state: NDArray[np.float64],
    covariance: NDArray[np.float64],
    normals: NDArray[np.float64],
    planes: NDArray[np.float64],
) -> bool:
    """Draw each particle's displacement, velocity and acceleration from a Gaussian.

    Args:
        memory: memory record.
        state: mean, shape (7,), the first three count.
        covariance: covariance, shape (7, 7), zero outside of the motion.
        normals: standard normal numbers, shape (7, count), the first three planes are used.
        planes: the particles, shape (7, count); their motion is replaced.

    Returns:
        False if the covariance has no Cholesky factor.
    """
    if not cholesky(covariance, memory.factor):
        return False
    for i in range(3):
        plane = planes[i]
        for k in range(plane.shape[0]):
            plane[k] = state[i]
        for j in range(i + 1):
            add_scaled(memory.factor[i, j], normals[j], plane)
    return True


@compiled
def predict_motion(settings: Any, memory: Any) -> None:
    """Predict the motion filter: memory.predicted_state and predicted_covariance.

    At a restart the state is where `prediction.restart_motion` has put it.
    """
    state, covariance = memory.predicted_state, memory.predicted_covariance
    if memory.restart != 0:
        displacement = state[0]
        clear_vector(state)
        clear_matrix(covariance)
        kinematic.start_motion(settings, displacement, state, covariance)
        return
    kinematic.propagate(
        memory.elapsed, 0.0, memory.motion_state, memory.motion_covariance, state, covariance
    )
    for i in range(3):
        for j in range(3):
            covariance[i, j] += memory.process_noise[i, j]
