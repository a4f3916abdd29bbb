"""Posterior Cramer-Rao bound of the kinematic formulation: how good any estimator can be.

For a linear-Gaussian system the bound of Tichavsky, Muravchik and Nehorai (IEEE Trans. Signal
Processing 46(5), 1998, Eq. 21) is the covariance of the Kalman filter. Linearising the measurement
at the true states gives the bound of the nonlinear model, by the same Riccati recursion. State:
[d, v, a, ln K, ln B, n, p]; the tool's motion is driven by white jerk, the parameters by a slow
random walk, both displacement and force are measured.

The bound knows the separation: where the tool has left the tissue (d > 0, F = 0) the force reading
carries no information about the parameters. Strictly it says that the law's sum is not positive
there, an inequality; its derivative at the true parameters is zero, and zero is what enters.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hc_estimator.contact.arrays import force_gradient
from hc_msgs_py.compilation import KernelCompiler

FloatArray = NDArray[np.float64]
compiled = KernelCompiler(lambda: (Path(__file__),))


@compiled
def _riccati(
    time_s: FloatArray,
    gradient: FloatArray,
    displacement_variance: FloatArray,
    force_variance: FloatArray,
    jerk_density: float,
    parameter_density: FloatArray,
    initial_covariance: FloatArray,
) -> FloatArray:
    count = time_s.size
    covariance = initial_covariance.copy()
    bound = np.empty((count, 4, 4))
    transition = np.eye(7)
    process = np.zeros((7, 7))
    row = np.zeros(7)
    for k in range(count):
        if k > 0:
            dt = time_s[k] - time_s[k - 1]
            transition[0, 1] = dt
            transition[1, 2] = dt
            transition[0, 2] = 0.5 * dt * dt
            process[0, 0] = jerk_density * dt**5 / 20.0
            process[0, 1] = process[1, 0] = jerk_density * dt**4 / 8.0
            process[0, 2] = process[2, 0] = jerk_density * dt**3 / 6.0
            process[1, 1] = jerk_density * dt**3 / 3.0
            process[1, 2] = process[2, 1] = jerk_density * dt**2 / 2.0
            process[2, 2] = jerk_density * dt
            for i in range(4):
                process[3 + i, 3 + i] = parameter_density[i] * dt
            covariance = transition @ covariance @ transition.T + process
        for channel in range(2):
            row[:] = 0.0
            if channel == 0:
                row[0] = 1.0
                noise = displacement_variance[k]
            else:
                noise = force_variance[k]
                row[:2] = gradient[k, :2]
                row[3:] = gradient[k, 2:]
            if np.isinf(noise):
                continue  # this channel has no reading here
            column = covariance @ row
            gain = column / (row @ column + noise)
            reduced = np.eye(7) - np.outer(gain, row)
            # Joseph form: stays positive definite over decades of initial variance.
            covariance = reduced @ covariance @ reduced.T + noise * np.outer(gain, gain)
        bound[k] = covariance[3:, 3:]
    return bound


def posterior_cramer_rao_bound(
    time_s: FloatArray,
    displacement: FloatArray,
    velocity: FloatArray,
    parameters: FloatArray,
    *,
    displacement_noise_std: FloatArray | float,
    force_noise_std: FloatArray | float,
    jerk_density: float,
    parameter_density: FloatArray,
    initial_covariance: FloatArray,
    adhesive: bool = False,
) -> FloatArray:
    """Bound on the covariance of ln K, ln B, n, p after each sample.

    Args:
        time_s: Instants, shape (N,).
        displacement: True penetration [mm], shape (N,).
        velocity: True rate of penetration [mm/s], shape (N,).
        parameters: True K, B, n, p, shape (N, 4).
        displacement_noise_std: True sensor noise [mm], scalar or shape (N,); infinite where there
            is no reading.
        force_noise_std: True sensor noise [N], the same.
        jerk_density: Spectral density of the white jerk [mm^2/s^5].
        parameter_density: Variance per second of the random walk of ln K, ln B, n, p, shape (4,).
        initial_covariance: Covariance of the state before the first sample, shape (7, 7).
        adhesive: Whether the tissue holds a tool that withdraws; otherwise it lets go of it.

    Returns:
        Covariance bounds in the coordinates ln K, ln B, n, p, shape (N, 4, 4).
    """
    count = time_s.size
    bound: FloatArray = _riccati(
        np.ascontiguousarray(time_s, dtype=np.float64),
        force_gradient(displacement, velocity, parameters, adhesive=adhesive),
        np.square(np.broadcast_to(displacement_noise_std, (count,)).astype(np.float64)),
        np.square(np.broadcast_to(force_noise_std, (count,)).astype(np.float64)),
        float(jerk_density),
        np.asarray(parameter_density, dtype=np.float64),
        np.asarray(initial_covariance, dtype=np.float64),
    )
    return bound
