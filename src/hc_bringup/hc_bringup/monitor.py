"""The runner's own node: listens to estimates and diagnostics, asks nodes, starts the source."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from hc_msgs.msg import HuntCrossleyEstimate
from rclpy.experimental import EventsExecutor
from rclpy.signals import SignalHandlerOptions
from std_srvs.srv import SetBool, Trigger

from hc_bringup.reach import speak_to_nodes
from hc_bringup.statistics import EstimateStatistics
from hc_msgs_py.clock_watch import ClockWatch
from hc_msgs_py.diagnostics import Level
from hc_msgs_py.qos import DIAGNOSTICS_QOS, ESTIMATE_QOS
from hc_msgs_py.topics import DIAGNOSTICS, ESTIMATE

NODE_NAME = "hc_monitor"
NOT_STARTED = "not started"
"""What missing() says of a node that does not offer ~/ready yet."""
_ERROR = str(int(Level.ERROR))
SERVICE_TIMEOUT_S = 5.0
REPEAT_S = 0.5


class Monitor:
    """Watches a run over ROS. Use as a context manager; everything happens inside spin()."""

    def __init__(self) -> None:
        self.statistics = EstimateStatistics()
        self.diagnostics: dict[str, dict[str, str]] = {}
        self.last_estimate_at = 0.0

    def __enter__(self) -> Monitor:
        speak_to_nodes()
        rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
        self._node = rclpy.create_node(NODE_NAME, enable_rosout=False)
        self._subscription = self._node.create_subscription(
            HuntCrossleyEstimate, ESTIMATE, self._on_estimate, ESTIMATE_QOS
        )
        self._node.create_subscription(
            DiagnosticArray, DIAGNOSTICS, self._on_diagnostics, DIAGNOSTICS_QOS
        )
        self._executor = EventsExecutor()
        self._executor.add_node(self._node)
        self._clients: dict[str, Any] = {}
        self._clock_watch = ClockWatch(self._executor, lambda: self._node.timers)
        self._clock_watch.__enter__()
        return self

    def __exit__(self, *_exception: object) -> None:
        self._clock_watch.__exit__()
        self._executor.remove_node(self._node)
        self._executor.shutdown()
        self._node.destroy_node()
        rclpy.try_shutdown()
        # The middleware's participant lives until nothing refers to the node any more, and with it
        # its sockets.
        del self._node, self._executor, self._subscription, self._clients, self._clock_watch
        gc.collect()

    def problems(self) -> dict[str, str]:
        """Return what nodes call an error in their diagnostics, by node name."""
        return {
            name: values["message"]
            for name, values in self.diagnostics.items()
            if values["level"] == _ERROR
        }

    def namesakes(self, node_name: str) -> int:
        """Return how many nodes of this name there are in the domain, outside namespaces."""
        return int(self._node.get_node_names_and_namespaces().count((node_name, "/")))

    def is_there(self, node_name: str) -> bool:
        """Return True once a node's ~/ready can be asked; does not wait."""
        client = self._client(Trigger, f"/{node_name}/ready")
        return bool(client.service_is_ready())

    def spin(self, duration_s: float) -> None:
        """Handle what arrives for a while."""
        end = time.monotonic() + duration_s
        while (left := end - time.monotonic()) > 0.0:
            self._executor.spin_once(timeout_sec=left)

    def estimates_connected(self) -> bool:
        """Return True once the estimator's publisher is matched."""
        return bool(self._node.count_publishers(ESTIMATE))

    def missing(self, node_name: str) -> str | None:
        """Ask a node's ~/ready; return None if it is ready, else what is missing.

        The answer for a node that is not there yet is NOT_STARTED.
        """
        response = self._call(Trigger, node_name, "ready", Trigger.Request(), timeout_s=1.0)
        if response is None:
            return NOT_STARTED
        return None if response.success else str(response.message)

    def set_running(self, node_name: str, running: bool) -> str | None:
        """Start or stop the source by its ~/run; return None, or why that failed."""
        request = SetBool.Request(data=running)
        response = self._call(SetBool, node_name, "run", request, timeout_s=SERVICE_TIMEOUT_S)
        if response is None:
            return "it does not answer its ~/run service"
        return None if response.success else str(response.message)

    def _call(
        self, kind: Any, node_name: str, service: str, request: Any, timeout_s: float
    ) -> Any | None:
        client = self._client(kind, f"/{node_name}/{service}")
        if not client.service_is_ready():
            self.spin(0.05)
            return None
        # A server that has not discovered this client yet answers into the void: ask again.
        futures: list[Any] = []
        end = time.monotonic() + timeout_s
        while time.monotonic() < end:
            futures.append(client.call_async(request))
            self._spin_until(lambda: any(f.done() for f in futures), REPEAT_S)
            for future in futures:
                if future.done():
                    return future.result()
        for future in futures:
            client.remove_pending_request(future)
        return None

    def _client(self, kind: Any, name: str) -> Any:
        client = self._clients.get(name)
        if client is None:
            client = self._clients[name] = self._node.create_client(kind, name)
        return client

    def _spin_until(self, condition: Callable[[], bool], timeout_s: float) -> None:
        end = time.monotonic() + timeout_s
        while not condition() and (left := end - time.monotonic()) > 0.0:
            self._executor.spin_once(timeout_sec=min(left, 0.05))

    def _on_estimate(self, message: Any) -> None:
        self.statistics.add(message)
        self.last_estimate_at = time.monotonic()

    def _on_diagnostics(self, message: Any) -> None:
        for status in message.status:
            values = {item.key: item.value for item in status.values}
            values["level"] = str(int.from_bytes(status.level, "little"))
            values["message"] = status.message
            self.diagnostics[status.name] = values
