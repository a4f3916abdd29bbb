"""State space `kinematic`: [d, v, a, ln K, ln B, n, p], the force as a measurement function.

The tool's motion is a constant-acceleration model driven by white jerk; the parameters walk
slowly; both measurements, displacement and force, are functions of the state. Stiffness and
damping are estimated as logarithms, so that they stay positive and their scale does not matter.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hc_estimator.compilation import compiled
from hc_estimator.contact.registry import contact_force, contact_gradient
from hc_estimator.linear_algebra import cholesky, clear_matrix, clear_vector
from hc_estimator.specification import ParameterSpecification

SPECIFICATIONS = (
    ParameterSpecification(
        "jerk_density",
        "float",
        1e5,
        "Spectral density of the white jerk that drives the motion model. Larger follows faster "
        "motion, smaller averages longer; between 1e4 and 1e6 it hardly matters, because the "
        "force itself tells the velocity.",
        minimum=1e-6,
        maximum=1e15,
        unit="mm^2/s^5",
    ),
    ParameterSpecification(
        "stiffness_log_walk",
        "float",
        1e-6,
        "Variance that ln K gains per second (random walk).",
        minimum=0.0,
        maximum=1e3,
        unit="1/s",
    ),
    ParameterSpecification(
        "damping_log_walk",
        "float",
        1e-6,
        "Variance that ln B gains per second (random walk).",
        minimum=0.0,
        maximum=1e3,
        unit="1/s",
    ),
    ParameterSpecification(
        "initial_stiffness_log_std",
        "float",
        1.0,
        "Standard deviation of the first guess of ln K; 0 holds K fixed.",
        minimum=0.0,
        maximum=10.0,
        runtime=False,
    ),
    ParameterSpecification(
        "initial_damping_log_std",
        "float",
        1.0,
        "Standard deviation of the first guess of ln B; 0 holds B fixed.",
        minimum=0.0,
        maximum=10.0,
        runtime=False,
    ),
    ParameterSpecification(
        "initial_velocity_std",
        "float",
        50.0,
        "Standard deviation of the tool's velocity before the first sample and after a gap.",
        minimum=1e-6,
        maximum=1e6,
        unit="mm/s",
        runtime=False,
    ),
    ParameterSpecification(
        "initial_acceleration_std",
        "float",
        500.0,
        "Standard deviation of the tool's acceleration before the first sample and after a gap.",
        minimum=1e-6,
        maximum=1e9,
        unit="mm/s^2",
        runtime=False,
    ),
)

# ln K and ln B are limited to this inside the model function, so that exp() stays finite.
LARGEST_LOG = 50.0


@compiled
def exponential(logarithm: float) -> float:
    """exp() of ln K or ln B, limited so that it stays finite."""
    return math.exp(min(max(logarithm, -LARGEST_LOG), LARGEST_LOG))


@compiled
def propagate(
    elapsed: float,
    lag: float,
    state: NDArray[np.float64],
    covariance: NDArray[np.float64],
    predicted_state: NDArray[np.float64],
    predicted_covariance: NDArray[np.float64],
) -> None:
    """Constant acceleration over the elapsed time, without process noise.

    The process is linear, so that the exact x' = A x, P' = A P A^T serve every Kalman-type filter
    (the unscented transform of a linear function is the same).

    Args:
        elapsed: time step [s].
        lag: share of v - w that a lagged velocity w in the last state makes good; 0 if there is
            none.
        state: x, shape (7,).
        covariance: P, shape (7, 7).
        predicted_state: takes A x, shape (7,).
        predicted_covariance: takes A P A^T, shape (7, 7).
    """
    half = 0.5 * elapsed * elapsed
    for i in range(7):
        predicted_state[i] = state[i]
    predicted_state[0] = state[0] + elapsed * state[1] + half * state[2]
    predicted_state[1] = state[1] + elapsed * state[2]
    predicted_state[6] = state[6] + lag * (state[1] - state[6])
    for j in range(7):
        second, third = covariance[1, j], covariance[2, j]
        predicted_covariance[0, j] = covariance[0, j] + elapsed * second + half * third
        predicted_covariance[1, j] = second + elapsed * third
        for i in range(2, 6):
            predicted_covariance[i, j] = covariance[i, j]
        predicted_covariance[6, j] = covariance[6, j] + lag * (second - covariance[6, j])
    for i in range(7):
        second, third = predicted_covariance[i, 1], predicted_covariance[i, 2]
        predicted_covariance[i, 6] += lag * (second - predicted_covariance[i, 6])
        predicted_covariance[i, 0] += elapsed * second + half * third
        predicted_covariance[i, 1] = second + elapsed * third
    for i in range(7):  # exact symmetry
        for j in range(i):
            predicted_covariance[j, i] = predicted_covariance[i, j]


@compiled
def process(
    elapsed: float, lag: float, state: NDArray[np.float64], result: NDArray[np.float64]
) -> None:
    """The process function for one point; see `propagate`."""
    for i in range(7):
        result[i] = state[i]
    result[0] = state[0] + elapsed * state[1] + 0.5 * elapsed * elapsed * state[2]
    result[1] = state[1] + elapsed * state[2]
    result[6] = state[6] + lag * (state[1] - state[6])


@compiled
def process_noise(settings: Any, elapsed: float, noise: NDArray[np.float64]) -> None:
    """Process noise covariance of white jerk and random walks over the elapsed time.

    Args:
        settings: settings record.
        elapsed: time step [s].
        noise: takes Q, shape (7, 7).
    """
    clear_matrix(noise)
    density = settings.jerk_density
    t2 = elapsed * elapsed
    noise[2, 2] = density * elapsed
    noise[1, 2] = noise[2, 1] = density * t2 / 2.0
    noise[0, 2] = noise[2, 0] = density * t2 * elapsed / 6.0
    noise[1, 1] = density * t2 * elapsed / 3.0
    noise[0, 1] = noise[1, 0] = density * t2 * t2 / 8.0
    noise[0, 0] = density * t2 * t2 * elapsed / 20.0
    noise[3, 3] = settings.stiffness_log_walk * elapsed
    noise[4, 4] = settings.damping_log_walk * elapsed
    noise[5, 5] = settings.displacement_exponent_walk * elapsed
    noise[6, 6] = settings.velocity_exponent_walk * elapsed


@compiled
def measure(contact_model: int, state: NDArray[np.float64], result: NDArray[np.float64]) -> None:
    """Measurement function y = [d, F(d, v, K, B, n, p)].

    Args:
        contact_model: code of the contact model.
        state: shape (7,).
        result: takes displacement [mm] and force [N], shape (2,).
    """
    result[0] = state[0]
    result[1] = contact_force(
        contact_model,
        state[0],
        state[1],
        exponential(state[3]),
        exponential(state[4]),
        state[5],
        state[6],
    )


@compiled
def measurement_jacobian(
    contact_model: int,
    state: NDArray[np.float64],
    gradient: NDArray[np.float64],
    jacobian: NDArray[np.float64],
) -> None:
    """Derivative of the measurement function.

    Args:
        contact_model: code of the contact model.
        state: shape (7,).
        gradient: scratch, shape (6,).
        jacobian: takes the derivative, shape (2, 7).
    """
    clear_matrix(jacobian)
    jacobian[0, 0] = 1.0
    stiffness, damping = exponential(state[3]), exponential(state[4])
    contact_gradient(
        contact_model, state[0], state[1], stiffness, damping, state[5], state[6], gradient
    )
    jacobian[1, 0] = gradient[0]
    jacobian[1, 1] = gradient[1]
    jacobian[1, 3] = gradient[2] * stiffness if abs(state[3]) < LARGEST_LOG else 0.0
    jacobian[1, 4] = gradient[3] * damping if abs(state[4]) < LARGEST_LOG else 0.0
    jacobian[1, 5] = gradient[4]
    jacobian[1, 6] = gradient[5]


@compiled
def prior(settings: Any, state: NDArray[np.float64], covariance: NDArray[np.float64]) -> None:
    """State and covariance before any sample."""
    clear_vector(state)
    state[3] = math.log(settings.initial_stiffness)
    state[4] = math.log(settings.initial_damping)
    state[5] = settings.initial_displacement_exponent
    state[6] = settings.initial_velocity_exponent
    clear_matrix(covariance)
    covariance[3, 3] = settings.initial_stiffness_log_std**2
    covariance[4, 4] = settings.initial_damping_log_std**2
    covariance[5, 5] = settings.initial_displacement_exponent_std**2
    covariance[6, 6] = settings.initial_velocity_exponent_std**2


@compiled
def start_motion(
    settings: Any,
    displacement: float,
    state: NDArray[np.float64],
    covariance: NDArray[np.float64],
) -> None:
    """Forget the motion: mean at the measured displacement and at rest, wide covariance.

    The displacement itself is then used by the update; its wide prior leaves all weight to that.
    """
    state[0] = displacement
    state[1] = 0.0
    state[2] = 0.0
    for i in range(3):
        for j in range(7):
            covariance[i, j] = 0.0
            covariance[j, i] = 0.0
    covariance[0, 0] = settings.initial_displacement_std**2
    covariance[1, 1] = settings.initial_velocity_std**2
    covariance[2, 2] = settings.initial_acceleration_std**2


@compiled
def to_parameters(
    state: NDArray[np.float64], parameters: NDArray[np.float64], slopes: NDArray[np.float64]
) -> None:
    """Physical parameters of a state and their derivatives with respect to the estimated ones.

    K and B are the medians exp(mean of ln K): the value is the same in every unit and gives the
    force that the filter itself predicts. Their covariance follows by the delta method with these
    slopes.

    Args:
        state: shape (7,).
        parameters: takes K, B, n, p, shape (4,).
        slopes: takes dK/dlnK, dB/dlnB, 1, 1, shape (4,).
    """
    parameters[0] = exponential(state[3])
    parameters[1] = exponential(state[4])
    parameters[2] = state[5]
    parameters[3] = state[6]
    slopes[0] = parameters[0]
    slopes[1] = parameters[1]
    slopes[2] = 1.0
    slopes[3] = 1.0


@compiled
def correct_motion(
    innovation: float,
    noise: float,
    state: NDArray[np.float64],
    covariance: NDArray[np.float64],
    factor: NDArray[np.float64],
    updated_state: NDArray[np.float64],
    updated_covariance: NDArray[np.float64],
) -> bool:
    """Kalman update of the motion alone with a measured displacement.

    For filters that estimate the parameters apart from the motion. The displacement is the first
    state, so that only the first column of the covariance's lower factor knows it: scaling that
    column is the whole update, and what it leaves is a covariance whatever the rounding.

    Args:
        innovation: measured minus predicted displacement [mm].
        noise: variance of the measurement [mm^2].
        state: predicted state, shape (7,).
        covariance: predicted covariance, shape (7, 7); the first three rows and columns are used.
        factor: scratch, shape (7, 7).
        updated_state: takes the updated state, shape (7,).
        updated_covariance: takes the updated covariance, shape (7, 7).

    Returns:
        False if the covariance has no Cholesky factor.
    """
    for i in range(7):
        updated_state[i] = state[i]
        for j in range(7):
            updated_covariance[i, j] = covariance[i, j]
    if not cholesky(covariance[:3, :3], factor):
        return False
    total = factor[0, 0] * factor[0, 0] + noise
    scale = noise / total
    for i in range(3):
        updated_state[i] += factor[i, 0] * factor[0, 0] / total * innovation
        for j in range(i + 1):
            element = scale * factor[i, 0] * factor[j, 0]
            for k in range(1, 3):
                element += factor[i, k] * factor[j, k]
            updated_covariance[i, j] = element
            updated_covariance[j, i] = element
    return True
