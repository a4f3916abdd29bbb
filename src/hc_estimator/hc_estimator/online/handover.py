"""One estimator takes over what another one knows: for a change of filter while samples flow.

The contact parameters go over with their covariance and their correlations with displacement and
velocity. What a filter learnt about noise does not: it means different things to different
filters, and is learnt again within a window.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hc_estimator.estimator import Estimator, create_estimator

_SHARED = ("started", "accepted", "last_time", "tempering_count")
_OWN_BEGINNING = ("rls", "rbpf")
_THIRD = 2  # position of what the state spaces do not share: acceleration, or force
_LOGARITHMIC = (3, 4)  # positions of K and B, which are logarithms in the kinematic state space
_SMALLEST = 1e-9  # K and B below this have no logarithm worth taking over


def can_hand_over(source: Estimator, target: Estimator) -> bool:
    """Whether the parameters of two estimators mean the same: they share the contact model."""
    return source.contact_model == target.contact_model


def hand_over(source: Estimator, target: Estimator) -> Estimator:
    """Let one estimator continue with what another one knows.

    Args:
        source: estimator that has seen samples; it stays as it is.
        target: fresh estimator with the same contact model; its own settings stay, and parameters
            that it holds fixed (prior deviation 0) stay fixed.

    Returns:
        The estimator to go on with: the target, or one like it whose first guess is the estimate.
        A filter that makes its own beginning (`rls`, `rbpf`) takes means and deviations over that
        way, without their correlations.

    Raises:
        ValueError: if the contact models differ.
    """
    if not can_hand_over(source, target):
        raise ValueError(
            f"contact_model = {source.contact_model!r} cannot hand over to "
            f"{target.contact_model!r}: their parameters differ in meaning"
        )
    if target.filter == source.filter and target.state_space == source.state_space:
        return _continued(source, target)
    if target.filter in _OWN_BEGINNING:
        return _guessing(source, target)
    before, after = source.state()["memory"], target.state()
    memory = after["memory"]
    state, covariance = _converted(
        np.array(before["state"]),
        np.array(before["covariance"]),
        source.state_space,
        target.state_space,
    )
    if source.state_space != target.state_space:
        state[_THIRD] = memory["state"][_THIRD]
        covariance[_THIRD, :] = covariance[:, _THIRD] = 0.0
        covariance[_THIRD, _THIRD] = memory["covariance"][_THIRD][_THIRD]
    for i, variance in enumerate(memory["prior_variance"], start=3):
        if variance == 0.0:
            state[i] = memory["state"][i]
            covariance[i, :] = covariance[:, i] = 0.0
    memory["state"], memory["covariance"] = state.tolist(), covariance.tolist()
    for name in _SHARED:
        memory[name] = before[name]
    if after["particles"]:
        memory["started"] = 0  # particles are drawn from state and covariance at the first sample
    target.restore(after)
    return target


def _continued(source: Estimator, target: Estimator) -> Estimator:
    """Return the target with all that a filter of its own kind knows, and its own settings."""
    state = source.state() | {"configuration": target.configuration}
    if len(state["particles"]) == len(target.state()["particles"]):
        target.restore(state)
        return target
    return _guessing(source, target)


def _guessing(source: Estimator, target: Estimator) -> Estimator:
    """Return an estimator like the target whose first guess is the source's estimate."""
    estimate = source.step(math.nan, 0.0, 0.0)  # is refused, and answers what is known
    values = estimate.parameters
    deviations = estimate.parameters_std
    relative = deviations / np.maximum(np.abs(values), _SMALLEST)
    guess = {
        "initial_stiffness": values[0],
        "initial_damping": values[1],
        "initial_displacement_exponent": values[2],
        "initial_velocity_exponent": values[3],
        "initial_stiffness_log_std": relative[0],
        "initial_damping_log_std": relative[1],
        "initial_displacement_exponent_std": deviations[2],
        "initial_velocity_exponent_std": deviations[3],
    }
    configuration: dict[str, object] = dict(target.configuration)
    for specification in target.specifications:
        value = guess.get(specification.name)
        # What is held fixed stays fixed; the estimate may lie outside what a guess may be.
        if value is not None and target.configuration.get(f"{specification.name}_std") != 0.0:
            assert specification.minimum is not None
            assert specification.maximum is not None
            limited = min(max(float(value), specification.minimum), specification.maximum)
            configuration[specification.name] = limited
    return create_estimator(
        target.filter,
        state_space=target.state_space,
        contact_model=target.contact_model,
        **configuration,
    )


def _converted(
    state: NDArray[np.float64], covariance: NDArray[np.float64], source: str, target: str
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return state (7,) and covariance (7, 7) in another state space, to first order."""
    if source == target:
        return state, covariance
    slopes = np.ones(7)
    for i in _LOGARITHMIC:
        if target == "kinematic":
            value = max(state[i], _SMALLEST)
            state[i], slopes[i] = np.log(value), 1.0 / value
        else:
            state[i] = slopes[i] = np.exp(state[i])
    return state, covariance * np.outer(slopes, slopes)
