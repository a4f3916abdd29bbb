"""The node's services (std_srvs/Trigger: reset, tare, find_surface, save, load).

Thin: each asks one thing of the node and answers with a line.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.node import Node
from std_srvs.srv import Trigger

from hc_msgs_py.qos import SERVICE_QOS


class NotPossibleError(Exception):
    """Why a service cannot do what it was asked for, in one line."""


def add_service(node: Node, name: str, act: Callable[[], str]) -> None:
    """Offer a Trigger service.

    Args:
        node: the node.
        name: name below the node, "reset" say.
        act: does it and returns what was done; may raise NotPossibleError.
    """

    def answer(_request: Any, response: Any) -> Any:
        try:
            response.message = act()
            response.success = True
        except NotPossibleError as error:
            response.message = str(error)
            response.success = False
        return response

    node.create_service(Trigger, f"~/{name}", answer, qos_profile=SERVICE_QOS)
