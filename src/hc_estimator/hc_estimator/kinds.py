"""Which estimators there are: filters, state spaces, contact models, and their parameters."""

from __future__ import annotations

from collections.abc import Iterable

from hc_estimator import screening
from hc_estimator.contact import registry as contact_registry
from hc_estimator.contact.registry import CONTACT_MODELS
from hc_estimator.filters.registry import FILTERS
from hc_estimator.specification import ParameterSpecification, with_defaults
from hc_estimator.state_space import registry as state_space_registry
from hc_estimator.state_space.registry import STATE_SPACES

DEFAULT_FILTER = "self_tuning_ukf"
DEFAULT_STATE_SPACE = "kinematic"
DEFAULT_CONTACT_MODEL = "hunt_crossley"


def available_filters() -> tuple[str, ...]:
    """Names that `create_estimator` takes as filter."""
    return tuple(FILTERS)


def available_state_spaces(filter: str | None = None) -> tuple[str, ...]:
    """Names that `create_estimator` takes as state_space, or those that suit one filter.

    Raises:
        ValueError: unknown filter.
    """
    if filter is None:
        return STATE_SPACES
    return FILTERS[checked_choice("filter", filter, available_filters())].state_spaces


def available_contact_models(filter: str | None = None) -> tuple[str, ...]:
    """Names that `create_estimator` takes as contact_model, or those that suit one filter.

    Raises:
        ValueError: unknown filter.
    """
    if filter is None:
        return CONTACT_MODELS
    return FILTERS[checked_choice("filter", filter, available_filters())].contact_models


def filter_summary(filter: str) -> str:
    """One line on what a filter is.

    Raises:
        ValueError: unknown filter.
    """
    return FILTERS[checked_choice("filter", filter, available_filters())].summary


def checked_choice(name: str, value: object, choices: tuple[str, ...]) -> str:
    """One of the choices.

    Raises:
        ValueError: it is none of them.
    """
    if not (isinstance(value, str) and value in choices):
        raise ValueError(f"{name} = {value!r} is not one of {', '.join(choices)}")
    return value


def parameter_specifications(
    filter: str,
    state_space: str = DEFAULT_STATE_SPACE,
    contact_model: str = DEFAULT_CONTACT_MODEL,
    internal: Iterable[str] = (),
) -> tuple[ParameterSpecification, ...]:
    """The parameters that an estimator of this kind has, with the defaults for this combination.

    Args:
        filter: one of `available_filters()`.
        state_space: one of `available_state_spaces(filter)`.
        contact_model: one of `available_contact_models()`.
        internal: names of those that are for experiments with the filter which are wanted too.

    Returns:
        One specification per parameter, in a fixed order.

    Raises:
        ValueError: an unknown name, or a combination that does not exist.
    """
    entry = FILTERS[checked_choice("filter", filter, available_filters())]
    checked_choice("state_space", state_space, STATE_SPACES)
    checked_choice("contact_model", contact_model, CONTACT_MODELS)
    if state_space not in entry.state_spaces:
        raise ValueError(
            f"state_space = {state_space!r} does not go with filter {filter!r}: "
            f"one of {', '.join(entry.state_spaces)}"
        )
    if contact_model not in entry.contact_models:
        raise ValueError(
            f"contact_model = {contact_model!r} does not go with filter {filter!r}: "
            f"one of {', '.join(entry.contact_models)}"
        )
    own = entry.specifications
    if state_space != "kinematic":
        own = tuple(s for s in own if s.name not in entry.kinematic_only)
    specifications = (
        own
        + tuple(
            s
            for s in state_space_registry.SPECIFICATIONS[state_space]
            if s.name not in entry.without
        )
        + contact_registry.SPECIFICATIONS.get(contact_model, ())
        + screening.SPECIFICATIONS
    )
    hidden = set(entry.internal).difference(internal)
    specifications = tuple(s for s in specifications if s.name not in hidden)
    return with_defaults(specifications, entry.defaults.get(state_space, {}))
