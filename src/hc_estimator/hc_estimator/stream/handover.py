"""One estimator takes over what another one knows: for a change of filter while samples flow.

The contact parameters go over with their covariance and their correlations with displacement and
velocity. What a filter learnt about noise does not: it means different things to different
filters, and is learnt again within a window.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hc_estimator.contact.registry import LAWS
from hc_estimator.estimator import Estimator, create_estimator
from hc_estimator.filters.registry import FILTERS, FilterEntry
from hc_estimator.multiple_model.knowledge import keep

_CLOCK = ("started", "accepted", "last_time", "channel_time", "usual_period", "period")
_STAMPS = ("state_time", "force_time")  # at the last sample, whatever delay was allowed for
_THIRD = 2  # position of what the state spaces do not share: acceleration, or force
_LOGARITHMIC = (3, 4)  # positions of K and B, which are logarithms in the kinematic state space
_LAGGED = 6  # position of p, or of a velocity that lags: that belongs to the motion
_LOGARITHMIC_NAMES = ("stiffness", "damping")
_SMALLEST = 1e-9  # K and B below this have no logarithm worth taking over
_KNOWN_LOG_STD = 1.0  # K or B within a factor of e is known, whatever the target guessed


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
        A filter that makes its own beginning (`rls`, `rbpf`), and one with a memory of its own that
        cannot tell or take, gets means and deviations that way, without their correlations.

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
    giver, taker = FILTERS[source.filter], FILTERS[target.filter]
    if not (_tells(giver) and _takes(taker)):
        return _guessing(source, target)
    before, after = source.state()["memory"], target.state()
    memory = after["memory"]
    known = giver.tell(before) if giver.tell else _plain(before)
    state, covariance = _converted(*known, source.state_space, target.state_space)
    if target.state_space == "kinematic":
        for i, name in zip(_LOGARITHMIC, _LOGARITHMIC_NAMES, strict=True):
            if _tells_nothing(target, name, math.sqrt(covariance[i, i])):
                own = target.configuration
                value = math.log(float(own[f"initial_{name}"]))
                keep(state, covariance, i, value, float(own[f"initial_{name}_log_std"]) ** 2)
    if taker.take:
        taker.take(memory, state, covariance)
    else:
        if source.state_space != target.state_space:
            variance = memory["covariance"][_THIRD][_THIRD]
            keep(state, covariance, _THIRD, memory["state"][_THIRD], variance)
        lagged = LAWS[target.contact_model].lagged_velocity
        for i, variance in enumerate(memory["prior_variance"], start=3):
            if variance == 0.0 and not (lagged and i == _LAGGED):
                keep(state, covariance, i, memory["state"][i], 0.0)
        memory["state"], memory["covariance"] = state.tolist(), covariance.tolist()
        if "tempering_count" in before:
            memory["tempering_count"] = before["tempering_count"]
    old, new = before.get("clock", before), memory.get("clock", memory)
    new |= {name: old[name] for name in _CLOCK} | dict.fromkeys(_STAMPS, old["last_time"])
    if after["particles"]:
        memory["started"] = 0  # particles are drawn from state and covariance at the first sample
    target.restore(after)
    return target


def _tells(entry: FilterEntry) -> bool:
    """Whether state and covariance can be read from a filter's memory."""
    return entry.memory is None or entry.tell is not None


def _takes(entry: FilterEntry) -> bool:
    """Whether a filter can begin with a state and a covariance."""
    return not entry.own_beginning and (entry.memory is None or entry.take is not None)


def _plain(memory: Mapping[str, Any]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return state (7,) and covariance (7, 7) of a filter with the memory of all."""
    return np.array(memory["state"]), np.array(memory["covariance"])


def _continued(source: Estimator, target: Estimator) -> Estimator:
    """Return the target with all that a filter of its own kind knows, and its own settings."""
    state = source.state() | {"configuration": target.configuration}
    if np.shape(state["particles"]) == np.shape(target.state()["particles"]):
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
    for name, log_std in zip(_LOGARITHMIC_NAMES, relative, strict=False):
        if _tells_nothing(target, name, log_std):
            del guess[f"initial_{name}"], guess[f"initial_{name}_log_std"]
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


def _tells_nothing(target: Estimator, name: str, log_std: float) -> bool:
    """Whether the target's own first guess of K or B says more than a logarithm this uncertain.

    A value of about 0 with any deviation has a logarithm of no end of deviation: sigma points
    drawn from it foretell forces of 1e22 N.
    """
    own = target.configuration.get(f"initial_{name}_log_std")
    return own is not None and log_std > max(float(own), _KNOWN_LOG_STD)


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
