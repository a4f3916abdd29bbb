"""State space `paper`: [d, v, F, K, B, n, p], the force as a state without memory.

The formulation of the papers (paper A, Eq. 2 to 4, with the d^n of the damping term that its
Eq. 3 lacks; paper B, Eq. 2 and 3): constant velocity, the contact law in the process function,
and a measurement that picks displacement and force out of the state.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hc_estimator.compilation import compiled
from hc_estimator.contact.registry import contact_force, contact_gradient
from hc_estimator.linear_algebra import clear_matrix, clear_vector
from hc_estimator.specification import ParameterSpecification


def _density(name: str, default: float, unit: str, what: str) -> ParameterSpecification:
    return ParameterSpecification(
        name,
        "float",
        default,
        f"Process noise of {what}: variance gained per second. The papers' Q per sample is this "
        "times the sampling time.",
        minimum=0.0,
        maximum=1e12,
        unit=unit,
    )


SPECIFICATIONS = (
    _density("process_noise_displacement", 1e-6, "mm^2/s", "the displacement"),
    _density("process_noise_velocity", 50.0, "mm^2/s^3", "the velocity"),
    _density("process_noise_force", 1e-3, "N^2/s", "the force"),
    _density("process_noise_stiffness", 1e-6, "(N/mm^n)^2/s", "the stiffness"),
    _density("process_noise_damping", 1e-8, "(N (s/mm)^p/mm^n)^2/s", "the damping"),
    ParameterSpecification(
        "initial_stiffness_std",
        "float",
        1.0,
        "Standard deviation of the first guess of K; 0 holds K fixed.",
        minimum=0.0,
        maximum=1e6,
        unit="N/mm^n",
        runtime=False,
    ),
    ParameterSpecification(
        "initial_damping_std",
        "float",
        0.05,
        "Standard deviation of the first guess of B; 0 holds B fixed.",
        minimum=0.0,
        maximum=1e6,
        unit="N (s/mm)^p/mm^n",
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
        "initial_force_std",
        "float",
        10.0,
        "Standard deviation of the force state before the first sample and after a gap.",
        minimum=1e-9,
        maximum=1e6,
        unit="N",
        runtime=False,
    ),
    ParameterSpecification(
        "limit_parameters",
        "bool",
        True,
        "Project the estimated K and B to non-negative values and n and p into their physical "
        "range after each update. The papers do not; without it the exponents can run away.",
    ),
)


@compiled
def process(
    contact_model: int,
    elapsed: float,
    lag: float,
    state: NDArray[np.float64],
    result: NDArray[np.float64],
) -> None:
    """Process function (paper A, Eq. 3 corrected; paper B, Eq. 2).

    Args:
        contact_model: code of the contact model.
        elapsed: time step [s].
        lag: share of v - w that a lagged velocity w in the last state makes good; 0 if none.
        state: shape (7,).
        result: takes the next state, shape (7,).
    """
    for i in range(7):
        result[i] = state[i]
    result[0] = state[0] + elapsed * state[1]
    result[2] = contact_force(
        contact_model, state[0], state[1], state[3], state[4], state[5], state[6]
    )
    result[6] = state[6] + lag * (state[1] - state[6])


@compiled
def process_jacobian(
    contact_model: int,
    elapsed: float,
    lag: float,
    state: NDArray[np.float64],
    gradient: NDArray[np.float64],
    jacobian: NDArray[np.float64],
) -> None:
    """Derivative of the process function.

    Args:
        contact_model: code of the contact model.
        elapsed: time step [s].
        lag: as in `process`.
        state: shape (7,).
        gradient: scratch, shape (6,).
        jacobian: takes the derivative, shape (7, 7).
    """
    clear_matrix(jacobian)
    for i in range(7):
        jacobian[i, i] = 1.0
    jacobian[0, 1] = elapsed
    contact_gradient(
        contact_model, state[0], state[1], state[3], state[4], state[5], state[6], gradient
    )
    jacobian[2, 2] = 0.0
    jacobian[2, 0] = gradient[0]
    jacobian[2, 1] = gradient[1]
    for i in range(4):
        jacobian[2, 3 + i] = gradient[2 + i]
    jacobian[6, 6] = 1.0 - lag
    jacobian[6, 1] = lag


@compiled
def process_noise(settings: Any, elapsed: float, noise: NDArray[np.float64]) -> None:
    """Diagonal process noise covariance Q over the elapsed time, shape (7, 7)."""
    clear_matrix(noise)
    noise[0, 0] = settings.process_noise_displacement * elapsed
    noise[1, 1] = settings.process_noise_velocity * elapsed
    noise[2, 2] = settings.process_noise_force * elapsed
    noise[3, 3] = settings.process_noise_stiffness * elapsed
    noise[4, 4] = settings.process_noise_damping * elapsed
    noise[5, 5] = settings.displacement_exponent_walk * elapsed
    noise[6, 6] = settings.velocity_exponent_walk * elapsed


@compiled
def prior(settings: Any, state: NDArray[np.float64], covariance: NDArray[np.float64]) -> None:
    """State and covariance before any sample."""
    clear_vector(state)
    state[3] = settings.initial_stiffness
    state[4] = settings.initial_damping
    state[5] = settings.initial_displacement_exponent
    state[6] = settings.initial_velocity_exponent
    clear_matrix(covariance)
    covariance[3, 3] = settings.initial_stiffness_std**2
    covariance[4, 4] = settings.initial_damping_std**2
    covariance[5, 5] = settings.initial_displacement_exponent_std**2
    covariance[6, 6] = settings.initial_velocity_exponent_std**2


@compiled
def start_motion(
    settings: Any,
    displacement: float,
    force: float,
    state: NDArray[np.float64],
    covariance: NDArray[np.float64],
) -> None:
    """Forget motion and force: mean at the measured values and at rest, wide covariance."""
    state[0] = displacement
    state[1] = 0.0
    state[2] = force
    for i in range(3):
        for j in range(7):
            covariance[i, j] = 0.0
            covariance[j, i] = 0.0
    covariance[0, 0] = settings.initial_displacement_std**2
    covariance[1, 1] = settings.initial_velocity_std**2
    covariance[2, 2] = settings.initial_force_std**2
