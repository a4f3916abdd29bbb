"""Requests to set parameters that rclpy cannot answer are answered: false, with the reason.

rclpy lets the error of a value whose type does not exist, for one, through to the executor: a
client that asks for type 77 would end the node.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.exceptions import ParameterException

_REFUSED = (ParameterException, ValueError, TypeError, AttributeError)


def answer_impossible_parameters(node: Any) -> None:
    """Let the parameter services of an rclpy.node.Node answer false where rclpy would raise."""
    for service in node.services:
        if service.srv_type is SetParameters:
            service.callback = _one_by_one(service.callback)
        elif service.srv_type is SetParametersAtomically:
            service.callback = _all_or_none(service.callback)


def _one_by_one(ask: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    def answer(request: Any, response: Any) -> Any:
        for parameter in request.parameters:
            try:
                ask(SetParameters.Request(parameters=[parameter]), response)
            except _REFUSED as error:
                response.results.append(_refusal(error))
        return response

    return answer


def _all_or_none(ask: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    def answer(request: Any, response: Any) -> Any:
        try:
            return ask(request, response)
        except _REFUSED as error:
            response.result = _refusal(error)
            return response

    return answer


def _refusal(error: Exception) -> SetParametersResult:
    return SetParametersResult(successful=False, reason=" ".join(str(error).split()))
