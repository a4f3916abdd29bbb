"""Whether another node has this one's name: its estimates go out on the same topics, mixed."""

from __future__ import annotations

import time

from rclpy.node import Node

from hc_msgs_py.diagnostics import Level, Status

LEASE_S = 25.0
"""The middleware lists a process that died for up to 20 s more, beside one started in its place."""


class Namesakes:
    """Looks for nodes of the same name in the same namespace."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._since_s: float | None = None

    def added_to(self, status: Status) -> Status:
        """Return a status, with a warning if the name has been there twice for some time."""
        node = self._node
        own = (node.get_name(), node.get_namespace())
        problem = self.judge(node.get_node_names_and_namespaces().count(own), time.monotonic())
        if not problem:
            return status
        level = max(Level(status.level), Level.WARN)
        return status._replace(level=level, message=f"{problem}; {status.message}")

    def judge(self, number: int, now_s: float) -> str:
        """Return what is wrong, nothing if it is not.

        Args:
            number: of nodes with this name, this one among them.
            now_s: steady time [s].
        """
        if number < 2:
            self._since_s = None
            return ""
        if self._since_s is None:
            self._since_s = now_s
        if now_s - self._since_s < LEASE_S:
            return ""
        name = self._node.get_fully_qualified_name()
        return (
            f"{number} nodes are called {name}, and what they publish is mixed: end the others, or "
            "give each a namespace (-r __ns:=/left) or a domain (ROS_DOMAIN_ID)"
        )
