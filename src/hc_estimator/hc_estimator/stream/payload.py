"""What hangs on a force sensor, from some attitudes in which the tool rests free of contact.

In attitude R the sensor reads F = b + m R^T g and T = b_T + m c x R^T g, linear in the offset b,
the mass m, the torque's offset b_T and m c: least squares, with the uncertainty from the residuals.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

FloatArray = NDArray[np.float64]

LEAST_ATTITUDES = 3
SMALLEST_TURN = math.radians(20.0)
"""Attitudes that differ by less do not tell the weight from the offset."""
ANOTHER_TURN = math.radians(5.0)
"""Attitudes that differ by less against the vertical are one that was taken twice."""
UNEXPLAINED = 0.1
"""Of the weight: a residual beyond it is no noise, the attitudes are not those of the sensor."""
NOISE_N = 0.05
"""Means over a rest are noisy by less, whatever hangs there."""
GRAVITY = (0.0, 0.0, -9.81)
STILL_TURN = math.radians(1.0)
STILL_S = 0.5
SETTLE_S = 0.2
"""A tool that has turned by no more than this for so long rests; but for the time to settle."""


class PayloadEstimate(NamedTuple):
    """A payload with standard deviations.

    Attributes:
        mass: [kg].
        mass_std: [kg].
        center: centre of mass in the sensor's frame [m], shape (3,).
        center_std: [m], shape (3,).
        force_bias: reading without load [N], shape (3,).
        force_bias_std: [N], shape (3,).
        torque_bias: [N m], shape (3,).
        residual_n: RMS of what the forces differ by from the model [N].
        attitudes: number of attitudes used.
        is_explained: whether weight and offset explain the forces.
    """

    mass: float
    mass_std: float
    center: FloatArray
    center_std: FloatArray
    force_bias: FloatArray
    force_bias_std: FloatArray
    torque_bias: FloatArray
    residual_n: float
    attitudes: int
    is_explained: bool


class StillReadings(NamedTuple):
    """Means over the times at which a tool rested, one row an attitude.

    Attributes:
        forces: [N], shape (n, 3).
        torques: [N m], shape (n, 3).
        attitudes: quaternions x, y, z, w, shape (n, 4).
    """

    forces: FloatArray
    torques: FloatArray
    attitudes: FloatArray


def still_readings(
    wrench_s: FloatArray, wrenches: FloatArray, pose_s: FloatArray, attitudes: FloatArray
) -> StillReadings:
    """Cut a recording into the attitudes in which the tool rested.

    Args:
        wrench_s: stamps of the wrenches [s], shape (n,).
        wrenches: forces [N] and torques [N m], shape (n, 6).
        pose_s: stamps of the poses [s], shape (m,).
        attitudes: quaternions x, y, z, w, shape (m, 4).

    Raises:
        ValueError: if none of the poses has an orientation.
    """
    sound = np.isfinite(wrenches).all(axis=1)
    wrench_s, wrenches = wrench_s[sound], wrenches[sound]
    length = np.linalg.norm(attitudes, axis=1)
    turned = np.isfinite(length) & (length > 0.0)
    if not turned.any():
        raise ValueError("no pose has an orientation: all quaternions are zero, or no numbers")
    pose_s, attitudes = pose_s[turned], attitudes[turned]
    turns = Rotation.from_quat(attitudes)
    found: list[tuple[FloatArray, FloatArray]] = []
    start = 0
    for i in range(len(pose_s) + 1):
        moved = i == len(pose_s) or (
            (turns[start].inv() * turns[i]).magnitude() > STILL_TURN and i > start
        )
        if not moved:
            continue
        # The tool has just come to rest at the start, and is about to move at the end.
        begin, end = pose_s[start] + SETTLE_S, pose_s[i - 1] - SETTLE_S
        if end - begin >= STILL_S:
            within = (wrench_s >= begin) & (wrench_s <= end)
            if within.any():
                middle = (pose_s >= begin) & (pose_s <= end)
                # Of a pose a second none may lie there.
                rest = turns[middle] if middle.any() else turns[start:i]
                found.append((wrenches[within].mean(axis=0), rest.mean().as_quat()))
        start = i
    return StillReadings(
        np.array([wrench[:3] for wrench, _ in found]).reshape(-1, 3),
        np.array([wrench[3:] for wrench, _ in found]).reshape(-1, 3),
        np.array([attitude for _, attitude in found]).reshape(-1, 4),
    )


def identify_payload(
    forces: FloatArray,
    torques: FloatArray,
    attitudes: FloatArray,
    gravity: tuple[float, float, float] = GRAVITY,
) -> PayloadEstimate:
    """Identify mass, centre of mass and offsets.

    Args:
        forces: mean readings at rest in the sensor's frame [N], shape (n, 3).
        torques: the same of the torque [N m], shape (n, 3).
        attitudes: of the sensor in the base frame, quaternions x, y, z, w, shape (n, 4).
        gravity: in the base frame [m/s^2].

    Raises:
        ValueError: if the attitudes are too few or too much alike.
    """
    if len(forces) < LEAST_ATTITUDES:
        raise ValueError(f"{_attitudes(len(forces))} too few: give at least {LEAST_ATTITUDES}")
    turned = Rotation.from_quat(attitudes).inv().apply(gravity)  # gravity in the sensor's frame
    unit = turned / np.linalg.norm(turned, axis=1)[:, None]
    widest = math.acos(float(np.clip(np.min(unit @ unit.T), -1.0, 1.0)))
    if widest < SMALLEST_TURN:
        raise ValueError(
            f"the attitudes differ by {math.degrees(widest):.0f} degrees against the vertical: "
            f"turn the tool by {math.degrees(SMALLEST_TURN):.0f} or more"
        )
    different = _different(unit)
    if different < LEAST_ATTITUDES:  # the centre would be any of a line, and its deviation 0
        raise ValueError(
            f"{_attitudes(different)} too few, though {len(forces)} were taken: the others turn "
            f"about the vertical only, or come again; give at least {LEAST_ATTITUDES}"
        )
    count = len(forces)
    identity = np.tile(np.eye(3), (count, 1))
    of_force = np.column_stack((identity, turned.reshape(-1)))
    solved, covariance, residual = _least_squares(of_force, forces.reshape(-1))
    bias, mass = solved[:3], float(solved[3])
    # m c x g' = -[g'] m c
    cross = np.zeros((3 * count, 3))
    for i, (x, y, z) in enumerate(turned):
        cross[3 * i : 3 * i + 3] = [[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]]
    moments, moment_covariance, _residual = _least_squares(
        np.column_stack((identity, cross)), torques.reshape(-1)
    )
    deviations = np.sqrt(np.diagonal(covariance))
    known = abs(mass) > 2.0 * deviations[3] and mass > 0.0
    center = moments[3:] / mass if known else np.zeros(3)
    spread = np.sqrt(np.diagonal(moment_covariance))[3:]
    return PayloadEstimate(
        mass,
        float(deviations[3]),
        center,
        spread / mass if known else np.full(3, np.nan),
        bias,
        deviations[:3],
        moments[:3],
        residual,
        count,
        is_small(residual, mass, gravity),
    )


def is_small(residual_n: float, mass: float, gravity: tuple[float, float, float]) -> bool:
    """Whether what a weight leaves unexplained is noise."""
    return residual_n <= max(UNEXPLAINED * abs(mass) * float(np.linalg.norm(gravity)), NOISE_N)


def _attitudes(number: int) -> str:
    return "1 attitude is" if number == 1 else f"{number} attitudes are"


def _different(directions: FloatArray) -> int:
    """Return how many of some unit vectors differ from all that are counted before."""
    kept: list[FloatArray] = []
    for direction in directions:
        if all(float(direction @ other) < math.cos(ANOTHER_TURN) for other in kept):
            kept.append(direction)
    return len(kept)


def _least_squares(matrix: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """Return solution, covariance from the residuals, and their RMS."""
    solved = np.asarray(np.linalg.lstsq(matrix, values, rcond=None)[0], np.float64)
    residuals = values - matrix @ solved
    freedom = max(len(values) - matrix.shape[1], 1)
    variance = float(residuals @ residuals) / freedom
    return (
        solved,
        np.asarray(variance * np.linalg.pinv(matrix.T @ matrix), np.float64),
        math.sqrt(float(np.mean(residuals**2))),
    )
