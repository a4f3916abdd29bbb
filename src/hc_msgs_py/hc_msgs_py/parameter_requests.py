"""Requests to set parameters that rclpy cannot answer are answered: false, with the reason.

rclpy lets the error of a value whose type does not exist, for one, through to the executor: a
client that asks for type 77 would end the node. Of a parameter that is not there it says
"Invalid access to undeclared parameter(s): []": without the name.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from rcl_interfaces.msg import Parameter, SetParametersResult
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.exceptions import ParameterException

from hc_msgs_py.parameters import why_unknown

_REFUSED = (ParameterException, ValueError, TypeError, AttributeError)


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
            if why := _unknown(node, [parameter]):
                response.results.append(_refusal(why))
                continue
            try:
                ask(SetParameters.Request(parameters=[parameter]), response)
            except _REFUSED as error:
                response.results.append(_refusal(str(error)))
        return response

    return answer


def _all_or_none(node: Any, ask: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    def answer(request: Any, response: Any) -> Any:
        if why := _unknown(node, request.parameters):
            response.result = _refusal(why)
            return response
        try:
            return ask(request, response)
        except _REFUSED as error:
            response.result = _refusal(str(error))
            return response

    return answer


def _unknown(node: Any, asked: Sequence[Parameter]) -> str:
    """Say which parameter is not there; nothing if all are."""
    unknown = (one.name for one in asked if not node.has_parameter(one.name))
    return next((why_unknown(node, name) for name in unknown), "")


def _refusal(why: str) -> SetParametersResult:
    return SetParametersResult(successful=False, reason=" ".join(why.split()))
