"""The ~/ready service: every node says whether it has found whom it waits for.

Discovery is one-sided: a publisher that sees its subscriber may still lose the first message,
because the subscriber has not seen it yet. So both sides are asked before the first sample.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.node import Node
from std_srvs.srv import Trigger

from hc_msgs_py.qos import SERVICE_QOS


def add_ready_service(node: Node, missing: Callable[[], list[str]]) -> Any:
    """Offer ~/ready (std_srvs/Trigger): success when nothing is missing, else what is.

    Args:
        node: the node that offers the service.
        missing: returns a line for each partner that has not been found yet.
    """

    def answer(_request: Any, response: Any) -> Any:
        lines = missing()
        response.success = not lines
        response.message = "; ".join(lines) if lines else "ready"
        return response

    return node.create_service(Trigger, "~/ready", answer, qos_profile=SERVICE_QOS)
