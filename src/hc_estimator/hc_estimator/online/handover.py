"""One estimator takes over what another one knows: for a change of filter while samples flow.

The contact parameters go over with their covariance and their correlations with displacement and
velocity. What a filter learnt about noise does not: it means different things to different
filters, and is learnt again within a window.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hc_estimator.estimator import Estimator

_SHARED = ("started", "accepted", "last_time", "tempering_count")
_THIRD = 2  # position of what the state spaces do not share: acceleration, or force
_LOGARITHMIC = (3, 4)  # positions of K and B, which are logarithms in the kinematic state space
_SMALLEST = 1e-9  # K and B below this have no logarithm worth taking over


def can_hand_over(source: Estimator, target: Estimator) -> bool:
    """Whether the parameters of two estimators mean the same: they share the contact model."""
    return source.contact_model == target.contact_model


def hand_over(source: Estimator, target: Estimator) -> None:
    """Let one estimator continue with what another one knows.

    Args:
        source: estimator that has seen samples; it stays as it is.
        target: fresh estimator with the same contact model; its own settings stay, and parameters
            that it holds fixed (prior deviation 0) stay fixed.

    Raises:
        ValueError: if the contact models differ.
    """
    if not can_hand_over(source, target):
        raise ValueError(
            f"contact_model = {source.contact_model!r} cannot hand over to "
            f"{target.contact_model!r}: their parameters differ in meaning"
        )
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
    target.restore(after)


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
