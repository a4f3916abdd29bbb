"""The two filters of paper C: they know slave and tissue, see the position and no force.

State: position and velocity of the slave (and, in the particle filter, the contact force). Input:
the slave's control force. Lengths in cm inside, as in the paper's tables I and II, and in mm
outside. Readings of the misprints: penetration is max(0, x - x_e0); the element (2, 1) of Eq. 20
and 26 has the sign of a discretised spring; the nonlinear model is propagated, not F X; the
innovation is y - C X; the weight has a minus sign.

The particle filter has two readings of Eq. 26. By default the law at a particle's position and
velocity moves it, and sigma_3 is added to the force that is told. With `force_state` the force is a
state as printed: the third row makes it from the position and velocity before the step plus its
noise, and it is this force, sigma_3 included, that moves the particle in the next step.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hc_msgs_py.compilation import KernelCompiler

FloatArray = NDArray[np.float64]
compiled = KernelCompiler(lambda: (Path(__file__),))

FILTERS = ("position_ekf", "position_pf")
COLUMNS = 4  # displacement [mm], velocity [mm/s], force [N], force before the update [N]

MM_PER_CM = 10.0


@compiled
def contact_force(model: FloatArray, position: float, velocity: float) -> float:
    """K d^n + B d^n v, never pulling; d = max(0, x - x_e0) (Eq. 12).

    Args:
        model: mass, damping, spring of the slave, K, B, n, x_e0; shape (7,), in cm.
        position: position of the slave [cm].
        velocity: its velocity [cm/s].
    """
    depth = position - model[6]
    if depth <= 0.0:
        return 0.0
    force: float = max(depth ** model[5] * (model[3] + model[4] * velocity), 0.0)
    return force


@compiled
def _advance(
    model: FloatArray, step: float, position: float, velocity: float, drive: float, force: float
) -> tuple[float, float]:
    """Position and velocity one step on (Eq. 18 to 20)."""
    rate = -model[1] / model[0]
    decay = math.exp(rate * step)
    share = (decay - 1.0) / rate
    pushed = -model[2] / model[0] * position + (drive - force) / model[0]
    return position + step * velocity, decay * velocity + share * pushed


@compiled
def _extended(
    model: FloatArray,
    step: float,
    readings: FloatArray,
    drive: FloatArray,
    noise: FloatArray,
    mean: float,
    result: FloatArray,
) -> None:
    """Extended Kalman filter of paper C, section IV.A.

    Args:
        model: as in contact_force.
        step: time step [s].
        readings: measured positions [cm], shape (N,).
        drive: control force u_s [N], shape (N,).
        noise: variances of position and velocity per step and of the reading, shape (3,).
        mean: mean of the velocity's process noise that the filter is told [cm/s].
        result: takes position, velocity, force, force before the update, shape (N, 4).
    """
    x, v = readings[0], 0.0
    p00, p01, p11 = noise[2], 0.0, 1.0
    for k in range(readings.size):
        predicted = contact_force(model, x, v)
        if k > 0:
            depth = max(x - model[6], 0.0)
            f00, f01 = 1.0, step
            decay = math.exp(-model[1] / model[0] * step)
            f10 = -step * model[2] / model[0]
            f11 = decay
            if depth > 0.0 and predicted > 0.0:
                f10 -= step / model[0] * model[5] * predicted / depth
                f11 -= step / model[0] * model[4] * depth ** model[5]
            x, v = _advance(model, step, x, v, drive[k - 1], predicted)
            v += mean
            a00 = f00 * p00 + f01 * p01
            a01 = f00 * p01 + f01 * p11
            a10 = f10 * p00 + f11 * p01
            a11 = f10 * p01 + f11 * p11
            p00 = a00 * f00 + a01 * f01 + noise[0]
            p01 = a00 * f10 + a01 * f11
            p11 = a10 * f10 + a11 * f11 + noise[1]
            predicted = contact_force(model, x, v)
        total = p00 + noise[2]
        gain0, gain1 = p00 / total, p01 / total
        innovation = readings[k] - x
        x += gain0 * innovation
        v += gain1 * innovation
        p11 -= gain1 * p01
        p01 -= gain0 * p01
        p00 -= gain0 * p00
        result[k, 0] = x
        result[k, 1] = v
        result[k, 2] = contact_force(model, x, v)
        result[k, 3] = predicted


@compiled
def _particles(
    model: FloatArray,
    step: float,
    readings: FloatArray,
    drive: FloatArray,
    draws: FloatArray,
    offsets: FloatArray,
    variance: float,
    force_state: bool,
    result: FloatArray,
) -> None:
    """Sampling, importance, resampling at every sample; paper C, section IV.B.

    Args:
        model: as in contact_force.
        step: time step [s].
        readings: measured positions [cm], shape (N,).
        drive: control force u_s [N], shape (N,).
        draws: process noise of position, velocity and force, shape (N, particles, 3).
        offsets: uniform numbers of the systematic resampling, shape (N,).
        variance: variance of the reading in the weights.
        force_state: Eq. 26 as printed, the force a state that moves the particle.
        result: as in _extended.
    """
    count = draws.shape[1]
    now = np.zeros((count, 3))
    moved = np.zeros((count, 3))
    weights = np.zeros(count)
    now[:, 0] = readings[0]
    for k in range(readings.size):
        largest = -math.inf
        predicted = 0.0
        for i in range(count):
            if k > 0:
                force = contact_force(model, now[i, 0], now[i, 1])
                push = now[i, 2] if force_state else force
                x, v = _advance(model, step, now[i, 0], now[i, 1], drive[k - 1], push)
                moved[i, 0] = x + draws[k, i, 0]
                moved[i, 1] = v + draws[k, i, 1]
                if not force_state:
                    force = contact_force(model, moved[i, 0], moved[i, 1])
                moved[i, 2] = force + draws[k, i, 2]
            else:
                moved[i] = now[i]
            predicted += moved[i, 2] / count
            residual = readings[k] - moved[i, 0]
            weights[i] = -0.5 * residual * residual / variance
            largest = max(largest, weights[i])
        total = 0.0
        for i in range(count):
            weights[i] = math.exp(weights[i] - largest)
            total += weights[i]
        result[k, :] = 0.0
        for i in range(count):
            weights[i] /= total
            for j in range(3):
                result[k, j] += weights[i] * moved[i, j]
        result[k, 3] = predicted
        chosen, level = 0, weights[0]
        for i in range(count):
            mark = (i + offsets[k]) / count
            while level < mark and chosen < count - 1:
                chosen += 1
                level += weights[chosen]
            now[i] = moved[chosen]


def run(
    filter: str,
    position_mm: FloatArray,
    drive_n: FloatArray,
    step_s: float,
    settings: Mapping[str, Any],
) -> FloatArray:
    """Filter the slave's motion and force from its noisy position.

    Args:
        filter: "position_ekf" or "position_pf".
        position_mm: measured penetration [mm] (negative before contact), shape (N,).
        drive_n: control force of the slave u_s [N], shape (N,).
        step_s: time step [s].
        settings: `model` (mass, damping, spring, K, B, n, x_e0 of tables I, lengths in cm),
            `process_noise` (standard deviations of position, velocity, force per step, in cm),
            `measurement_variance` [cm^2]; of the EKF `process_mean` [cm/s]; of the particle filter
            `particles`, `seed` and optionally `gamma` (shape and scale [cm/s] of the velocity's
            process noise, Eq. 22, in place of the Gaussian) and `force_state` (Eq. 26 as printed).

    Returns:
        Penetration [mm], velocity [mm/s], force [N] and the force before the update, shape (N, 4).
    """
    model = np.array([float(value) for value in settings["model"]])
    surface = model[6]
    readings = position_mm / MM_PER_CM + surface
    deviations = [float(value) for value in settings["process_noise"]]
    variance = float(settings["measurement_variance"])
    result = np.empty((readings.size, COLUMNS))
    if filter == "position_ekf":
        noise = np.array([deviations[0] ** 2, deviations[1] ** 2, variance])
        mean = float(settings.get("process_mean", 0.0))
        _extended(model, step_s, readings, drive_n, noise, mean, result)
    else:
        generator = np.random.Generator(np.random.PCG64(int(settings["seed"])))
        count = int(settings["particles"])
        draws = generator.standard_normal((readings.size, count, 3)) * deviations
        if "gamma" in settings:
            shape, scale = (float(value) for value in settings["gamma"])
            draws[:, :, 1] = generator.gamma(shape, scale, (readings.size, count))
        offsets = generator.random(readings.size)
        force_state = bool(settings.get("force_state", False))
        _particles(model, step_s, readings, drive_n, draws, offsets, variance, force_state, result)
    result[:, 0] = (result[:, 0] - surface) * MM_PER_CM
    result[:, 1] *= MM_PER_CM
    return result
