"""Declaration of ROS parameters from their specifications.

rclpy checks ranges and the read-only mark itself; a choice among words, and a limit that is not
itself allowed, are text only to it (additional_constraints), so the node's on-set callback must
enforce those.
"""

from __future__ import annotations

import difflib
import weakref
from collections.abc import Mapping, Sequence
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.node import Node
from rclpy.parameter import Parameter

from hc_msgs_py.ros_yaml import text_of_boolean
from hc_msgs_py.specification import ParameterSpecification, setting

MOST_NAMES = 40
"""A node with more parameters is not listed whole in one line."""

_declared: weakref.WeakKeyDictionary[Node, dict[str, ParameterSpecification]] = (
    weakref.WeakKeyDictionary()
)


def declare(
    node: Node,
    name: str,
    default: bool | int | float | str | Sequence[str] | Sequence[float],
    description: str,
    *,
    minimum: float | None = None,
    maximum: float | None = None,
    choices: Sequence[str] = (),
    unit: str = "",
    read_only: bool = False,
) -> Any:
    """Declare a parameter of a node and return its value; see `hc_msgs_py.specification.setting`.

    Raises:
        ValueError: see `declare_specified`.
    """
    return declare_specified(
        node,
        setting(
            name,
            default,
            description,
            minimum=minimum,
            maximum=maximum,
            choices=choices,
            unit=unit,
            read_only=read_only,
        ),
    )


def declare_specified(node: Node, specification: ParameterSpecification) -> Any:
    """Declare a parameter of a node and return its value (a parameter file may override it).

    Kind "auto" is a number or a text, so ROS takes any type for it, and the caller checks changes.

    Raises:
        ValueError: if the value given at start is of the wrong type, out of range or not among
            the choices; names the parameter, the value and what is allowed.
    """
    name, kind = specification.name, specification.kind
    if kind == "float":
        _whole_number_too(node, name)
    if kind == "str":
        _boolean_as_text(node, specification)
    try:
        value = node.declare_parameter(name, specification.default, _descriptor(specification))
    except (InvalidParameterTypeException, InvalidParameterValueException) as error:
        given = node._parameter_overrides[name].value  # rclpy's errors do not carry it
        hint = " (a word like y or on: put it in quotation marks)" if _is_word(kind, given) else ""
        raise ValueError(
            f"parameter {name} = {given!r} is not {specification.allowed}{hint}"
        ) from error
    if specification.choices or specification.above is not None:
        specification.checked(value.value)
    _declared.setdefault(node, {})[name] = specification
    return value.value


def declared(node: Node) -> Mapping[str, ParameterSpecification]:
    """Return what a node has declared here, by name."""
    return _declared.get(node, {})


def refuse_unknown(node: Node) -> None:
    """Refuse parameters that were given at start and that the node has not, which ROS passes over.

    To be called once all are declared.

    Raises:
        ValueError: names the first, and the nearest that there is.
    """
    # rclpy offers no public way to ask for the overrides of parameters that nobody declares.
    for given in node._parameter_overrides:
        if node.has_parameter(given) or given.startswith("qos_overrides."):
            continue
        raise ValueError(why_unknown(node, given))


def why_unknown(node: Node, name: str) -> str:
    """Say that a node has no parameter of a name, and the nearest that it has."""
    names = sorted(declared(node))
    listed = f"it has: {', '.join(names)}"
    if len(names) > MOST_NAMES:
        listed = f"docs/reference/parameters.md lists its {len(names)}"
    close = difflib.get_close_matches(name, names, n=1)
    hint = f"did you mean {close[0]}?" if close else listed
    return f"unknown parameter {name} for node {node.get_name()}: {hint}"


def _descriptor(specification: ParameterSpecification) -> ParameterDescriptor:
    """The same in ROS's own terms."""
    unit = specification.unit_text
    descriptor = ParameterDescriptor(
        description=specification.description + (f" [{unit}]" if unit else ""),
        read_only=specification.read_only,
    )
    if specification.choices:
        descriptor.additional_constraints = "one of: " + ", ".join(specification.choices)
    low, high = specification.minimum, specification.maximum
    if specification.above is not None:
        low = specification.above
        descriptor.additional_constraints = specification.allowed
    if specification.kind == "auto":
        descriptor.dynamic_typing = True
        descriptor.additional_constraints = specification.allowed
    elif low is None and high is None:
        return descriptor
    elif specification.kind == "int":
        descriptor.integer_range = [
            IntegerRange(
                from_value=-(2**63) if low is None else int(low),
                to_value=2**63 - 1 if high is None else int(high),
                step=1,
            )
        ]
    elif specification.kind == "float":
        descriptor.floating_point_range = [
            FloatingPointRange(
                from_value=float("-inf") if low is None else float(low),
                to_value=float("inf") if high is None else float(high),
                step=0.0,
            )
        ]
    return descriptor


def _is_word(kind: str, given: Any) -> bool:
    """Whether a file may have had a text where ROS read a boolean."""
    return kind == "str" and isinstance(given, bool)


def _boolean_as_text(node: Node, specification: ParameterSpecification) -> None:
    """Take `axis: y` from a parameter file as the text that it is: ROS reads it as true."""
    given = node._parameter_overrides.get(specification.name)
    if given is None or given.type_ != Parameter.Type.BOOL:
        return
    text = text_of_boolean(given.value, specification.choices)
    if text is not None:
        node._parameter_overrides[specification.name] = Parameter(specification.name, value=text)


def _whole_number_too(node: Node, name: str) -> None:
    """Take a whole number from a parameter file as the number it is: `zero: 5` for `zero: 5.0`."""
    given = node._parameter_overrides.get(name)
    if given is not None and given.type_ == Parameter.Type.INTEGER:
        node._parameter_overrides[name] = Parameter(name, value=float(given.value))
