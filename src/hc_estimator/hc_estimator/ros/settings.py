"""The node's ROS parameters: every setting of the estimators, and those of the node itself.

All settings of all filters are declared from the start, so that a file dumped with one filter
loads while another one runs; a setting that the present filter does not have waits for one that
has. A setting that nobody gave follows the default of the filter in use.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

from hc_estimator import (
    DEFAULT_FILTER,
    ParameterSpecification,
    available_contact_models,
    available_filters,
    available_state_spaces,
    parameter_specifications,
)
from hc_estimator.ros.node_settings import (
    CHOICE_NAMES,
    MISSING_READINGS,
    NODE_SETTINGS,
)
from hc_estimator.ros.settings_meaning import check_together
from hc_msgs_py.parameters import declare, declare_specified, refuse_unknown


class Kind(NamedTuple):
    """Which estimator: the three names that `create_estimator` takes."""

    filter: str
    state_space: str
    contact_model: str


class Change(NamedTuple):
    """What a client changed, between two samples.

    Attributes:
        kind: the new kind of estimator, None if it stays.
        estimator: changed settings of the estimator that can change while it runs.
        node: names of changed settings of the node.
    """

    kind: Kind | None
    estimator: dict[str, Any]
    node: frozenset[str]


class Settings:
    """Declares, checks and holds the parameters of the estimator node."""

    def __init__(self, node: Node) -> None:
        """Declare everything with what the parameter file says.

        Args:
            node: the estimator node; nothing of this may be declared yet.

        Raises:
            ValueError: for a parameter that does not exist or a value that is not allowed.
            rclpy.exceptions.ParameterException: the same, found by rclpy.
        """
        self._node = node
        self._values: dict[str, Any] = {}
        given = dict(node._parameter_overrides)
        self._declare_kind()
        self._specifications = _all_specifications()
        own = self._own_specifications()
        for name, specification in self._specifications.items():
            _declare_specification(node, own.get(name, specification), self._users(name))
        for setting in NODE_SETTINGS.values():
            declare_specified(node, setting)
        refuse_unknown(node)
        self._given = set(given)
        self._filled: frozenset[str] = frozenset()
        self._values = {name: _plain(node.get_parameter(name).value) for name in self.names}
        reason = self._check(self._values)
        if reason:
            raise ValueError(reason)
        self._at_start = dict(self._values)

    @property
    def names(self) -> tuple[str, ...]:
        """All declared parameters."""
        return (*CHOICE_NAMES, *self._specifications, *NODE_SETTINGS)

    @property
    def values(self) -> Mapping[str, Any]:
        """Present value of every parameter by name."""
        return self._values

    @property
    def kind(self) -> Kind:
        """The kind of estimator that is asked for."""
        return Kind(*(self._values[name] for name in CHOICE_NAMES))

    def changed_of_node(self) -> dict[str, Any]:
        """Return the node's own settings that are no longer those of its start: zeros, say."""
        now, start = self._values, self._at_start
        return {name: now[name] for name in NODE_SETTINGS if now[name] != start[name]}

    def estimator_values(self) -> dict[str, Any]:
        """Return the settings that the present kind of estimator has."""
        return {name: self._values[name] for name in self._own_specifications()}

    def fill_defaults(self, parameters: list[Parameter]) -> list[Parameter]:
        """Pre-set callback: let settings that nobody gave follow the default of a new kind.

        A number for a setting that also takes a word becomes a floating-point one, however it was
        written: ROS does not know its type.
        """
        self._filled = frozenset()
        parameters = [self._with_own_type(p) for p in parameters]
        named = {p.name: p.value for p in parameters}
        if not any(name in named for name in CHOICE_NAMES):
            return parameters
        kind = Kind(*(named.get(name, self._values[name]) for name in CHOICE_NAMES))
        try:
            specifications = _specifications(kind)
        except ValueError:
            return parameters  # the on-set callback refuses it with the reason
        follow = {
            s.name: s.default
            for s in specifications
            if s.name not in self._given and s.name not in named
        }
        changed = [
            Parameter(name, value=value)
            for name, value in follow.items()
            if value != self._values[name]
        ]
        self._filled = frozenset(p.name for p in changed)
        return [*parameters, *changed]

    def check(self, parameters: Sequence[Parameter]) -> SetParametersResult:
        """On-set callback: refuse, with the reason, what could not be applied."""
        for parameter in parameters:
            if parameter.name in self._values and parameter.type_ == Parameter.Type.NOT_SET:
                return SetParametersResult(
                    successful=False, reason=f"parameter {parameter.name} cannot be removed"
                )
        known = {p.name: _plain(p.value) for p in parameters if p.name in self._values}
        reason = self._check({**self._values, **known})
        return SetParametersResult(successful=not reason, reason=reason)

    def take(self, parameters: Sequence[Parameter]) -> Change:
        """Post-set callback's part: hold the new values and say what changed."""
        known = {p.name: _plain(p.value) for p in parameters if p.name in self._values}
        self._given |= known.keys() - self._filled
        before, kind_before = dict(self._values), self.kind
        self._values.update(known)
        changed = {name for name, value in known.items() if value != before[name]}
        own = self._own_specifications()
        return Change(
            kind=self.kind if self.kind != kind_before else None,
            estimator={n: self._values[n] for n in changed if n in own and own[n].runtime},
            node=frozenset(changed & NODE_SETTINGS.keys()),
        )

    def _with_own_type(self, parameter: Parameter) -> Parameter:
        specification = self._specifications.get(parameter.name)
        if specification is None or specification.kind != "auto":
            return parameter
        try:
            return Parameter(parameter.name, value=specification.checked(parameter.value))
        except ValueError:
            return parameter  # the on-set callback refuses it with the reason

    def _own_specifications(self) -> dict[str, ParameterSpecification]:
        return {s.name: s for s in _specifications(self.kind)}

    def _check(self, values: Mapping[str, Any]) -> str:
        """Return why these values cannot be, or nothing."""
        try:
            # The kind first: it says which words go together.
            parameter_specifications(*(values[name] for name in CHOICE_NAMES))
            for name, specification in self._specifications.items():
                specification.checked(values[name])
            for name, setting in NODE_SETTINGS.items():
                setting.checked(values[name])
            check_together(values)
        except ValueError as error:
            return str(error)
        return ""

    def _declare_kind(self) -> None:
        node = self._node
        choices = {
            "filter": (DEFAULT_FILTER, "the filter", available_filters()),
            "state_space": ("kinematic", "the state space", available_state_spaces()),
            "contact_model": ("hunt_crossley", "the contact law", available_contact_models()),
        }
        for name in CHOICE_NAMES:
            default, description, words = choices[name]
            self._values[name] = declare(node, name, default, description, choices=words)
        parameter_specifications(*self.kind)  # raises ValueError for what does not go together

    def _users(self, name: str) -> str:
        """Return which filters have a setting, for its description; nothing if all have it."""
        users = dict.fromkeys(
            kind.filter
            for kind, specifications in _KINDS.items()
            if any(s.name == name for s in specifications)
        )
        return "" if len(users) == len(available_filters()) else ", ".join(users)


def _specifications(kind: Kind) -> tuple[ParameterSpecification, ...]:
    """Return the settings of a kind of estimator with the node's defaults.

    In hc_msgs/IndenterSample a NaN is a reading that is missing.

    Raises:
        ValueError: see parameter_specifications.
    """
    return tuple(
        dataclasses.replace(s, default=True) if s.name == MISSING_READINGS else s
        for s in parameter_specifications(*kind)
    )


def _every_kind() -> dict[Kind, tuple[ParameterSpecification, ...]]:
    """Return the settings of every combination of filter, state space and contact model."""
    return {
        Kind(name, space, model): _specifications(Kind(name, space, model))
        for name in available_filters()
        for space in available_state_spaces(name)
        for model in available_contact_models(name)
    }


_KINDS = _every_kind()


def _all_specifications() -> dict[str, ParameterSpecification]:
    """Return every setting of every kind of estimator once, with the first default met."""
    result: dict[str, ParameterSpecification] = {}
    for specifications in _KINDS.values():
        for specification in specifications:
            result.setdefault(specification.name, specification)
    return result


def _declare_specification(node: Node, given: ParameterSpecification, users: str) -> None:
    description = given.description
    if users:
        description += f" Used by {users}."
    if not given.runtime:
        description += " Takes effect at the next reset."
    declare_specified(node, dataclasses.replace(given, description=description))


def _plain(value: Any) -> Any:
    """Return number lists, which rclpy hands out as array.array, as lists."""
    return list(value) if hasattr(value, "typecode") else value
