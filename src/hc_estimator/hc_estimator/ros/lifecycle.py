"""A transition that is not possible now must be answered, not end the node.

rclpy's change_state service lets the error of its state machine through to the executor, so that
a client that activates an active node would end it.
"""

from __future__ import annotations

from typing import Any

from rclpy._rclpy_pybind11 import RCLError
from rclpy.lifecycle import LifecycleNode


def answer_impossible_transitions(node: LifecycleNode) -> None:
    """Let a managed node's change_state service answer false where rclpy would raise."""
    service = node._service_change_state
    change_state = service.callback

    def answer(request: Any, response: Any) -> Any:
        try:
            return change_state(request, response)
        except RCLError as error:
            node.get_logger().warning(" ".join(str(error).split()))
            response.success = False
            return response

    service.callback = answer
