"""Requests to set parameters are answered in the suite's words, and no one ends the node.

rclpy lets the error of a value whose type does not exist, for one, through to the executor: a
client that asks for type 77 would end the node. Of a parameter that is not there it says
"Invalid access to undeclared parameter(s): []": without the name; of a whole number for another
one "Wrong parameter type, expected 'Type.DOUBLE' got 'Type.INTEGER'": it is taken here, as in a
parameter file. What a parameter may be is said with its name and its unit, whoever asks.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Final

from rcl_interfaces.msg import Parameter, SetParametersResult
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.exceptions import ParameterException
from rclpy.parameter import Parameter as Value

from hc_msgs_py.parameters import declared, why_unknown
from hc_msgs_py.specification import ParameterSpecification

_REFUSED = (ParameterException, ValueError, TypeError, AttributeError)
_TYPES: Final = {
    "bool": Value.Type.BOOL,
    "int": Value.Type.INTEGER,
    "float": Value.Type.DOUBLE,
    "str": Value.Type.STRING,
    "numbers": Value.Type.DOUBLE_ARRAY,
    "texts": Value.Type.STRING_ARRAY,
}
"""Of a kind of parameter; one of kind "auto" takes any."""


def answer_impossible_parameters(node: Any) -> None:
    """Let the parameter services of an rclpy.node.Node answer false where rclpy would raise."""
    for service in node.services:
        if service.srv_type is SetParameters:
            service.callback = _one_by_one(node, service.callback)
        elif service.srv_type is SetParametersAtomically:
            service.callback = _all_or_none(node, service.callback)


def _one_by_one(node: Any, ask: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    def answer(request: Any, response: Any) -> Any:
        for parameter in request.parameters:
            try:
                asked = _checked(node, [parameter])
                ask(SetParameters.Request(parameters=asked), response)
            except _REFUSED as error:
                response.results.append(_refusal(str(error)))
        return response

    return answer


def _all_or_none(node: Any, ask: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    def answer(request: Any, response: Any) -> Any:
        try:
            asked = _checked(node, request.parameters)
            return ask(SetParametersAtomically.Request(parameters=asked), response)
        except _REFUSED as error:
            response.result = _refusal(str(error))
            return response

    return answer


def _checked(node: Any, asked: Sequence[Parameter]) -> list[Parameter]:
    """Return parameters in the types of those of the node.

    Raises:
        ValueError: if one is not there, is fixed, or may not have its value; the text says which.
    """
    for one in asked:
        if not node.has_parameter(one.name):
            raise ValueError(why_unknown(node, one.name))
    specified = declared(node)
    return [
        _as_specified(specified[one.name], one) if one.name in specified else one for one in asked
    ]


def _as_specified(specification: ParameterSpecification, asked: Parameter) -> Parameter:
    """Return a parameter in its own type.

    Raises:
        ValueError: if it is fixed, has a type that ROS has not, or may not have its value.
    """
    name, given = asked.name, Value.from_parameter_msg(asked)
    if specification.read_only:
        raise ValueError(
            f"parameter {name} is read-only: give it when the node starts (hc run --param, or its "
            "file)"
        )
    if given.type_ == Value.Type.NOT_SET:
        raise ValueError(f"parameter {name} takes a value ({specification.allowed}), null is none")
    value = specification.checked(given.value)
    kind = _TYPES.get(specification.kind)
    return asked if kind is None else Value(name, kind, value).to_parameter_msg()


def _refusal(why: str) -> SetParametersResult:
    return SetParametersResult(successful=False, reason=" ".join(why.split()))
