"""Declaration of ROS parameters with type, range, unit, description and read-only mark.

rclpy checks ranges and the read-only mark itself; a choice among words is text only to it
(additional_constraints), so the node's on-set callback must enforce that one.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.node import Node
from rclpy.parameter import Parameter


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
    number_or_word: str = "",
) -> Any:
    """Declare a parameter of a node and return its value (a parameter file may override it).

    Args:
        node: the node.
        name: the parameter's name.
        default: value without a parameter file; its type is the parameter's type.
        description: one sentence for the user.
        minimum: smallest allowed number; None for no limit.
        maximum: largest allowed number; None for no limit.
        choices: allowed words of a string parameter.
        unit: unit of a number, appended to the description.
        read_only: True if it can only be set at start.
        number_or_word: for a parameter that may be a number or a text, what is allowed, in words;
            ROS then takes any type for it, and the caller checks the value.

    Raises:
        ValueError: if the value given at start is of the wrong type, out of range or not among
            the choices; names the parameter, the value and what is allowed.
    """
    descriptor = ParameterDescriptor(
        description=f"{description} [{unit}]" if unit else description, read_only=read_only
    )
    if choices:
        descriptor.additional_constraints = "one of: " + ", ".join(choices)
    if number_or_word:
        descriptor.dynamic_typing = True
        descriptor.additional_constraints = number_or_word
    number = isinstance(default, (int, float)) and not isinstance(default, bool)
    if number and not number_or_word and (minimum is not None or maximum is not None):
        if isinstance(default, int):
            descriptor.integer_range = [
                IntegerRange(
                    from_value=-(2**63) if minimum is None else int(minimum),
                    to_value=2**63 - 1 if maximum is None else int(maximum),
                    step=1,
                )
            ]
        else:
            descriptor.floating_point_range = [
                FloatingPointRange(
                    from_value=float("-inf") if minimum is None else float(minimum),
                    to_value=float("inf") if maximum is None else float(maximum),
                    step=0.0,
                )
            ]
    if isinstance(default, float) and not number_or_word:
        _whole_number_too(node, name)
    try:
        value = node.declare_parameter(name, default, descriptor).value
    except (InvalidParameterTypeException, InvalidParameterValueException) as error:
        given = node._parameter_overrides[name].value  # rclpy's errors do not carry it
        allowed = _allowed(default, minimum, maximum)
        raise ValueError(f"parameter {name} = {given!r} is not {allowed}") from error
    if choices and value not in choices:
        raise ValueError(f"parameter {name} = {value!r} is not one of {', '.join(choices)}")
    return value


def _whole_number_too(node: Node, name: str) -> None:
    """Take a whole number from a parameter file as the number it is: `zero: 5` for `zero: 5.0`."""
    given = node._parameter_overrides.get(name)
    if given is not None and given.type_ == Parameter.Type.INTEGER:
        node._parameter_overrides[name] = Parameter(name, value=float(given.value))


def _allowed(default: Any, minimum: float | None, maximum: float | None) -> str:
    """Return in words what a parameter may be."""
    if isinstance(default, bool):
        return "true or false"
    if isinstance(default, str):
        return "a text"
    if not isinstance(default, (int, float)):
        return "a list of values like " + repr(list(default))
    word = "an integer" if isinstance(default, int) else "a number with a decimal point"
    low = "" if minimum is None else f" from {minimum:g}"
    high = "" if maximum is None else f" to {maximum:g}"
    return word + low + high
