"""The state spaces by name, and the functions through which the filters reach them.

A state space is a process function, a measurement function, a noise builder, a prior and a map to
the physical parameters. To add one: write these in a new file, then add its name and a branch in
each function here. Every state space has seven states, displacement and velocity first and the
four contact parameters last.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hc_estimator.compilation import compiled
from hc_estimator.contact.kelvin_boltzmann import lag_share
from hc_estimator.contact.registry import (
    LARGEST_DISPLACEMENT_EXPONENT,
    LARGEST_VELOCITY_EXPONENT,
    SMALLEST_DISPLACEMENT_EXPONENT,
    SMALLEST_VELOCITY_EXPONENT,
    contact_force,
    fixed_value,
    has_lagged_velocity,
)
from hc_estimator.linear_algebra import clear_matrix
from hc_estimator.specification import ParameterSpecification
from hc_estimator.state_space import kinematic, paper

KINEMATIC = 0
PAPER = 1

STATE_SPACES = ("kinematic", "paper")  # position = code

COMMON_SPECIFICATIONS = (
    ParameterSpecification(
        "initial_stiffness",
        "float",
        1.0,
        "First guess of the stiffness K.",
        minimum=1e-6,
        maximum=1e6,
        unit="N/mm^n",
        runtime=False,
    ),
    ParameterSpecification(
        "initial_damping",
        "float",
        0.01,
        "First guess of the damping B.",
        minimum=1e-9,
        maximum=1e6,
        unit="N (s/mm)^p/mm^n",
        runtime=False,
    ),
    ParameterSpecification(
        "initial_displacement_exponent",
        "float",
        1.5,
        "First guess of the exponent n of the displacement (1.5: Hertz).",
        minimum=0.5,
        maximum=4.0,
        runtime=False,
    ),
    ParameterSpecification(
        "initial_velocity_exponent",
        "float",
        1.0,
        "First guess of the exponent p of the velocity (1: linear damping).",
        minimum=0.25,
        maximum=3.0,
        runtime=False,
    ),
    ParameterSpecification(
        "initial_displacement_exponent_std",
        "float",
        0.3,
        "Standard deviation of the first guess of n; 0 holds n fixed.",
        minimum=0.0,
        maximum=10.0,
        runtime=False,
    ),
    ParameterSpecification(
        "initial_velocity_exponent_std",
        "float",
        0.1,
        "Standard deviation of the first guess of p; 0 holds p fixed.",
        minimum=0.0,
        maximum=10.0,
        runtime=False,
    ),
    ParameterSpecification(
        "initial_displacement_std",
        "float",
        1.0,
        "Standard deviation of the displacement before the first sample and after a gap; wide "
        "against the sensor's noise leaves all weight to the first sample.",
        minimum=1e-9,
        maximum=1e6,
        unit="mm",
        runtime=False,
    ),
    ParameterSpecification(
        "displacement_exponent_walk",
        "float",
        1e-6,
        "Variance that n gains per second (random walk).",
        minimum=0.0,
        maximum=1e3,
        unit="1/s",
    ),
    ParameterSpecification(
        "velocity_exponent_walk",
        "float",
        1e-6,
        "Variance that p gains per second (random walk).",
        minimum=0.0,
        maximum=1e3,
        unit="1/s",
    ),
)

SPECIFICATIONS = {
    "kinematic": COMMON_SPECIFICATIONS + kinematic.SPECIFICATIONS,
    "paper": COMMON_SPECIFICATIONS + paper.SPECIFICATIONS,
}


# Beyond these an estimate is lost: ln K and ln B, K and B themselves.
LOST_LOG = 35.0
LOST_VALUE = 1e12


@compiled
def has_linear_process(space: int) -> bool:
    """True if the process function is linear, so that prediction needs no sigma points."""
    return space == KINEMATIC


@compiled
def lag(settings: Any, elapsed: float) -> float:
    """Share of the lag that the contact model's lagged velocity makes good; 0 if it has none."""
    if has_lagged_velocity(settings.contact_model):
        return lag_share(elapsed, settings.relaxation_time)
    return 0.0


@compiled
def is_held(settings: Any, parameter: int) -> bool:
    """True if K, B, n or p (0 to 3) is held fixed: by the law, or by a deviation of 0."""
    if not math.isnan(fixed_value(settings.contact_model, parameter)):
        return True
    if parameter == 2:
        return bool(settings.initial_displacement_exponent_std == 0.0)
    if parameter == 3:
        return bool(settings.initial_velocity_exponent_std == 0.0)
    if settings.state_space == KINEMATIC:
        logarithmic = settings.initial_stiffness_log_std, settings.initial_damping_log_std
        return bool(logarithmic[parameter] == 0.0)
    return bool((settings.initial_stiffness_std, settings.initial_damping_std)[parameter] == 0.0)


@compiled
def process(
    settings: Any, elapsed: float, state: NDArray[np.float64], result: NDArray[np.float64]
) -> None:
    """Process function without noise: state after the elapsed time [s], shape (7,)."""
    share = lag(settings, elapsed)
    if settings.state_space == KINEMATIC:
        kinematic.process(elapsed, share, state, result)
    else:
        paper.process(settings.contact_model, elapsed, share, state, result)


@compiled
def process_jacobian(
    settings: Any,
    elapsed: float,
    state: NDArray[np.float64],
    gradient: NDArray[np.float64],
    jacobian: NDArray[np.float64],
) -> None:
    """Derivative of the process function where that is not linear, shape (7, 7)."""
    share = lag(settings, elapsed)
    paper.process_jacobian(settings.contact_model, elapsed, share, state, gradient, jacobian)


@compiled
def process_noise(settings: Any, elapsed: float, noise: NDArray[np.float64]) -> None:
    """Process noise covariance over the elapsed time [s], shape (7, 7)."""
    if settings.state_space == KINEMATIC:
        kinematic.process_noise(settings, elapsed, noise)
    else:
        paper.process_noise(settings, elapsed, noise)
    for i in range(4):
        if is_held(settings, i):
            noise[3 + i, 3 + i] = 0.0


@compiled
def measure(settings: Any, state: NDArray[np.float64], result: NDArray[np.float64]) -> None:
    """Measurement function: displacement [mm] and force [N] of a state, shape (2,)."""
    if settings.state_space == KINEMATIC:
        kinematic.measure(settings.contact_model, state, result)
    else:
        result[0] = state[0]
        result[1] = state[2]


@compiled
def measurement_jacobian(
    settings: Any,
    state: NDArray[np.float64],
    gradient: NDArray[np.float64],
    jacobian: NDArray[np.float64],
) -> None:
    """Derivative of the measurement function, shape (2, 7); gradient is scratch, shape (6,)."""
    if settings.state_space == KINEMATIC:
        kinematic.measurement_jacobian(settings.contact_model, state, gradient, jacobian)
    else:
        clear_matrix(jacobian)
        jacobian[0, 0] = 1.0
        jacobian[1, 2] = 1.0


@compiled
def prior(settings: Any, state: NDArray[np.float64], covariance: NDArray[np.float64]) -> None:
    """State (7,) and covariance (7, 7) before any sample."""
    if settings.state_space == KINEMATIC:
        kinematic.prior(settings, state, covariance)
    else:
        paper.prior(settings, state, covariance)
    for i in range(4):
        if not math.isnan(fixed_value(settings.contact_model, i)):
            covariance[3 + i, 3 + i] = 0.0


@compiled
def start_motion(
    settings: Any,
    displacement: float,
    force: float,
    state: NDArray[np.float64],
    covariance: NDArray[np.float64],
) -> None:
    """Replace the motion part of state and covariance by a wide prior at the measured values."""
    if settings.state_space == KINEMATIC:
        kinematic.start_motion(settings, displacement, state, covariance)
    else:
        paper.start_motion(settings, displacement, force, state, covariance)
    if has_lagged_velocity(settings.contact_model):
        state[6] = 0.0
        for i in range(7):
            covariance[6, i] = 0.0
            covariance[i, 6] = 0.0
        # Narrower than the velocity itself: with ln B as free as w, a wide w starves B.
        covariance[6, 6] = 0.01 * covariance[1, 1]


@compiled
def is_literal(settings: Any) -> bool:
    """True for the papers' filters to the letter: `paper` without limit_parameters."""
    return bool(settings.state_space == PAPER and settings.limit_parameters == 0)


@compiled
def constrain(settings: Any, state: NDArray[np.float64]) -> None:
    """Project the parameters into their physical range.

    Beyond it the law is that of the limit, and no reading would ever bring an exponent back. K and
    B are positive by their logarithms on `kinematic`.
    """
    if is_literal(settings):
        return
    if settings.state_space == PAPER:
        state[3] = max(state[3], 0.0)
        state[4] = max(state[4], 0.0)
    state[5] = min(max(state[5], SMALLEST_DISPLACEMENT_EXPONENT), LARGEST_DISPLACEMENT_EXPONENT)
    if not has_lagged_velocity(settings.contact_model):
        state[6] = min(max(state[6], SMALLEST_VELOCITY_EXPONENT), LARGEST_VELOCITY_EXPONENT)


@compiled
def limits(settings: Any, index: int) -> tuple[float, float]:
    """Smallest and largest value that `constrain` leaves to a state's parameter, 3 to 6."""
    if index < 5:
        return (0.0 if settings.state_space == PAPER else -math.inf), math.inf
    if index == 5:
        return SMALLEST_DISPLACEMENT_EXPONENT, LARGEST_DISPLACEMENT_EXPONENT
    if has_lagged_velocity(settings.contact_model):
        return -math.inf, math.inf
    return SMALLEST_VELOCITY_EXPONENT, LARGEST_VELOCITY_EXPONENT


@compiled
def is_lost(settings: Any, state: NDArray[np.float64]) -> bool:
    """True if the parameters are so far from any tissue that no data would bring them back."""
    if is_literal(settings):
        return False
    largest = LOST_LOG if settings.state_space == KINEMATIC else LOST_VALUE
    return bool(abs(state[3]) > largest or abs(state[4]) > largest)


@compiled
def to_parameters(
    settings: Any,
    state: NDArray[np.float64],
    parameters: NDArray[np.float64],
    slopes: NDArray[np.float64],
) -> None:
    """Physical parameters K, B, n, p of a state and their slopes, each of shape (4,)."""
    if settings.state_space == KINEMATIC:
        kinematic.to_parameters(state, parameters, slopes)
    else:
        for i in range(4):
            parameters[i] = state[3 + i]
            slopes[i] = 1.0
    for i in range(4):
        value = fixed_value(settings.contact_model, i)
        if not math.isnan(value):
            parameters[i] = value
            slopes[i] = 0.0


@compiled
def force_of_state(settings: Any, state: NDArray[np.float64]) -> float:
    """Force [N] of the contact law with displacement, velocity and parameters of a state."""
    stiffness, damping = state[3], state[4]
    if settings.state_space == KINEMATIC:
        stiffness = kinematic.exponential(stiffness)
        damping = kinematic.exponential(damping)
    return contact_force(
        settings.contact_model, state[0], state[1], stiffness, damping, state[5], state[6]
    )


@compiled
def force_of_parameters(
    settings: Any, state: NDArray[np.float64], parameters: NDArray[np.float64]
) -> float:
    """`force_of_state` where `to_parameters` has found K and B already."""
    model = settings.contact_model
    if not (math.isnan(fixed_value(model, 0)) and math.isnan(fixed_value(model, 1))):
        return force_of_state(settings, state)
    return contact_force(
        model, state[0], state[1], parameters[0], parameters[1], state[5], state[6]
    )
