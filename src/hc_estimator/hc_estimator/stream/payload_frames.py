"""What else would explain the forces of a tool at rest: another way down, or another mounting.

A weight is identified with the attitude of the sensor and the direction of gravity in the frame of
the pose. Where one of both is not as it was set (a pose told in the frame of a tracker or of a
tilted base, a sensor that sits turned at the flange) no weight fits, but the same readings say
which one does.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

FloatArray = NDArray[np.float64]

LEAST_ATTITUDES = 4
"""Three say as many numbers as are sought: they explain anything."""


class Otherwise(NamedTuple):
    """A setting that explains the forces.

    Attributes:
        name: gravity or force.mounting.
        value: what it would have to be; a mounting is what comes behind the one that was set, a
            quaternion x, y, z, w.
        mass: payload that it gives [kg].
        residual_n: RMS of what the forces differ by then [N].
    """

    name: str
    value: Any
    mass: float
    residual_n: float


def explain_otherwise(
    forces: FloatArray, attitudes: FloatArray, gravity: tuple[float, float, float]
) -> Otherwise | None:
    """Return which setting would explain the forces best, None if too few were taken.

    Args:
        forces: mean readings at rest in the sensor's frame [N], shape (n, 3).
        attitudes: of the sensor in the base frame, quaternions x, y, z, w, shape (n, 4).
        gravity: in the base frame, as it was set [m/s^2].
    """
    if len(forces) < LEAST_ATTITUDES:
        return None
    found = (
        _other_gravity(forces, attitudes, gravity),
        _other_mounting(forces, attitudes, gravity),
    )
    return min(found, key=lambda one: one.residual_n)


def _other_gravity(
    forces: FloatArray, attitudes: FloatArray, gravity: tuple[float, float, float]
) -> Otherwise:
    """Fit F = b + R^T w, w the weight in the base frame: its direction is free."""
    count = len(forces)
    turns = Rotation.from_quat(attitudes).inv().as_matrix()
    matrix = np.column_stack((np.tile(np.eye(3), (count, 1)), turns.reshape(-1, 3)))
    solved = np.linalg.lstsq(matrix, forces.reshape(-1), rcond=None)[0]
    residuals = forces.reshape(-1) - matrix @ solved
    newtons, usual = float(np.linalg.norm(solved[3:])), float(np.linalg.norm(gravity))
    down = solved[3:] * (usual / newtons) if newtons > 0.0 else np.array(gravity)
    mass = newtons / usual
    return Otherwise("gravity", tuple(map(float, down)), mass, _rms(residuals))


def _other_mounting(
    forces: FloatArray, attitudes: FloatArray, gravity: tuple[float, float, float]
) -> Otherwise:
    """Fit F = b + m E^T R^T g, E a further turn of the sensor (Kabsch, with the scale m)."""
    expected = Rotation.from_quat(attitudes).inv().apply(gravity)
    from_mean = expected - expected.mean(axis=0)
    measured = forces - forces.mean(axis=0)
    left, sizes, right = np.linalg.svd(from_mean.T @ measured)
    signs = np.array([1.0, 1.0, np.sign(np.linalg.det(left @ right)) or 1.0])
    turn = left @ np.diag(signs) @ right
    mass = float(sizes @ signs) / max(float(np.sum(from_mean**2)), 1e-12)
    quaternion = Rotation.from_matrix(turn).as_quat(canonical=True)
    residuals = measured - mass * from_mean @ turn
    return Otherwise("force.mounting", tuple(map(float, quaternion)), mass, _rms(residuals))


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))
