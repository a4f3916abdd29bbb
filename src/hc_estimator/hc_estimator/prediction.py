"""The prediction step of the Kalman-type filters: state and covariance up to the new sample."""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.linear_algebra import cholesky, copy_matrix, copy_vector
from hc_estimator.specification import ParameterSpecification
from hc_estimator.state_space import kinematic
from hc_estimator.state_space import registry as state_space

UNSCENTED_SPECIFICATIONS = (
    ParameterSpecification(
        "alpha",
        "float",
        1.0,
        "Spread of the sigma points (scaled unscented transform; `a` of paper B, Eq. 5).",
        minimum=1e-3,
        maximum=10.0,
    ),
    ParameterSpecification(
        "beta",
        "float",
        2.0,
        "Extra weight of the central sigma point in covariances; 2 suits Gaussians.",
        minimum=0.0,
        maximum=10.0,
    ),
    ParameterSpecification(
        "kappa",
        "float",
        0.0,
        "Secondary spread of the sigma points.",
        minimum=0.0,
        maximum=100.0,
    ),
)


@compiled
def sigma_scale(settings: Any) -> float:
    """c^2 = N + lambda = alpha^2 (N + kappa) of the scaled unscented transform, N = 7."""
    return settings.alpha * settings.alpha * (7.0 + settings.kappa)  # type: ignore[no-any-return]


@compiled
def central_covariance_weight(settings: Any) -> float:
    """Weight w_0^c of the central point in covariances (paper A, Eq. 9)."""
    scale = sigma_scale(settings)
    weight = (scale - 7.0) / scale + 1.0 - settings.alpha * settings.alpha + settings.beta
    return weight  # type: ignore[no-any-return]


@compiled
def propagate_unscented(settings: Any, memory: Any) -> bool:
    """Scaled unscented transform through the process function, without process noise.

    Paper A, Eq. 7 to 9 (with the sums over all 2N + 1 points), paper B, Eq. 5 to 8. The mean is
    summed as differences to the central point, which loses no digits to large weights.

    Returns:
        False if the covariance has no Cholesky factor.
    """
    if not cholesky(memory.covariance, memory.factor):
        return False
    scale = sigma_scale(settings)
    spread = math.sqrt(scale)
    weight = 0.5 / scale
    elapsed = memory.elapsed
    images = memory.images
    state_space.process(settings, elapsed, memory.state, images[0])
    for j in range(7):
        for i in range(7):
            memory.point[i] = memory.state[i] + spread * memory.factor[i, j]
        state_space.process(settings, elapsed, memory.point, images[1 + j])
        for i in range(7):
            memory.point[i] = memory.state[i] - spread * memory.factor[i, j]
        state_space.process(settings, elapsed, memory.point, images[8 + j])
    for i in range(7):
        total = 0.0
        for k in range(1, 15):
            total += images[k, i] - images[0, i]
        memory.predicted_state[i] = images[0, i] + weight * total
    central = central_covariance_weight(settings)
    for k in range(15):
        for i in range(7):
            images[k, i] -= memory.predicted_state[i]
    for i in range(7):
        for j in range(i + 1):
            total = 0.0
            for k in range(1, 15):
                total += images[k, i] * images[k, j]
            element = central * images[0, i] * images[0, j] + weight * total
            memory.predicted_covariance[i, j] = element
            memory.predicted_covariance[j, i] = element
    return True


@compiled
def restart_motion(settings: Any, memory: Any) -> None:
    """Predict across a start, a gap or a clock jump: motion forgotten, parameters kept."""
    displacement = memory.measurement[0]
    if memory.present[0] == 0:  # a force alone, after one for which particles are drawn anew
        displacement = memory.state[0] + memory.elapsed * memory.state[1]
    copy_vector(memory.state, memory.predicted_state)
    copy_matrix(memory.covariance, memory.predicted_covariance)
    state_space.start_motion(
        settings,
        displacement,
        memory.measurement[1],
        memory.predicted_state,
        memory.predicted_covariance,
    )
    for i in range(7):
        for j in range(7):
            if i < 3 or j < 3:
                memory.process_noise[i, j] = 0.0


@compiled
def add_process_noise(memory: Any) -> None:
    """Add Q to the predicted covariance."""
    for i in range(7):
        for j in range(7):
            memory.predicted_covariance[i, j] += memory.process_noise[i, j]


@compiled
def propagate_linear(settings: Any, memory: Any) -> None:
    """Exact propagation through a linear process function, without process noise."""
    kinematic.propagate(
        memory.elapsed,
        state_space.lag(settings, memory.elapsed),
        memory.state,
        memory.covariance,
        memory.predicted_state,
        memory.predicted_covariance,
    )


@compiled
def propagate_linearised(settings: Any, memory: Any) -> None:
    """Process function at the mean and its Jacobian for the covariance, without process noise.

    Paper C, Eq. 24, with the nonlinear model for the mean (F X over-counts the contact force).
    """
    jacobian, half = memory.process_jacobian, memory.half
    state_space.process(settings, memory.elapsed, memory.state, memory.predicted_state)
    state_space.process_jacobian(settings, memory.elapsed, memory.state, memory.gradient, jacobian)
    for i in range(7):
        for j in range(7):
            total = 0.0
            for k in range(7):
                total += jacobian[i, k] * memory.covariance[k, j]
            half[i, j] = total
    for i in range(7):
        for j in range(i + 1):
            total = 0.0
            for k in range(7):
                total += half[i, k] * jacobian[j, k]
            memory.predicted_covariance[i, j] = total
            memory.predicted_covariance[j, i] = total


@compiled
def predict(settings: Any, memory: Any, unscented: bool) -> bool:
    """Predict state and covariance over memory.elapsed, process noise not yet added.

    Leaves memory.state untouched, so that a refused sample leaves no trace. The caller adds
    memory.process_noise, which an adaptation may have changed, with `add_process_noise`.

    Args:
        settings: settings record.
        memory: memory record.
        unscented: sigma points for a nonlinear process function, else its Jacobian.

    Returns:
        False if the covariance has no Cholesky factor.
    """
    # Over a gap the parameters walk no further than over the longest time that is none.
    elapsed = min(memory.elapsed, settings.longest_gap)
    state_space.process_noise(settings, elapsed, memory.process_noise)
    if memory.restart != 0:
        restart_motion(settings, memory)
    elif state_space.has_linear_process(settings.state_space):
        propagate_linear(settings, memory)
    elif unscented:
        return propagate_unscented(settings, memory)
    else:
        propagate_linearised(settings, memory)
    return True
