"""The runner's own node: listens to estimates and diagnostics, asks nodes, starts the source."""

from __future__ import annotations

import gc
import math
import os
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from hc_msgs.msg import EstimatorEvent
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from std_srvs.srv import SetBool, Trigger

from hc_bringup.dashboard.parsing import RecordParser
from hc_bringup.dashboard.security import TOKEN_VARIABLE
from hc_bringup.dashboard.taps import Arrival, Taps
from hc_bringup.estimate_listener import EstimateListener
from hc_bringup.reach import speak_to_nodes
from hc_bringup.statistics import PARAMETERS, EstimateStatistics
from hc_msgs_py.clock_watch import ClockWatch
from hc_msgs_py.diagnostics import Level, number_said
from hc_msgs_py.qos import CONFIGURATION_QOS, DIAGNOSTICS_QOS, SERVICE_QOS
from hc_msgs_py.topics import (
    DIAGNOSTICS,
    EVENTS,
    NODE_DASHBOARD,
    NODE_ESTIMATOR,
    NODE_RECORDER,
    TRUTH,
)

NODE_NAME = "hc_monitor"
NOT_STARTED = "not started"
"""What missing() says of a node that does not offer ~/ready yet."""
_ERROR = str(int(Level.ERROR))
SERVICE_TIMEOUT_S = 5.0
REPEAT_S = 0.5


class _MonitorNode(Node):  # type: ignore[misc]  # rclpy ships no types
    """A node with subscriptions that are emptied now and then."""

    taps: Taps

    def __init__(self) -> None:
        super().__init__(NODE_NAME, enable_rosout=False)
        self.taps = Taps(self)

    @property
    def subscriptions(self) -> Iterator[Any]:
        """Subscriptions that an executor serves; Node.__init__ asks for them already."""
        hidden = self.taps.hidden if hasattr(self, "taps") else frozenset()
        return (s for s in super().subscriptions if id(s) not in hidden)


class Monitor:
    """Watches a run over ROS. Use as a context manager; everything happens inside spin().

    Attributes:
        statistics: of the estimates, those of the first estimator.
        listeners: to the estimates of each estimator, by its name.
        diagnostics: what each node said last of itself, by name.
        dropped: messages that the recorder did not get, by the bag that it said it made.
    """

    def __init__(
        self,
        *,
        with_estimates: bool = True,
        with_truth: bool = False,
        estimators: Sequence[str] = (NODE_ESTIMATOR,),
    ) -> None:
        self._with_estimates = with_estimates
        self._with_truth = with_truth
        self.listeners = {name: EstimateListener(name) for name in estimators or (NODE_ESTIMATOR,)}
        self._first = next(iter(self.listeners.values()))
        self.diagnostics: dict[str, dict[str, str]] = {}
        self.dropped: dict[str, int] = {}
        self.answer = ""
        self._truth: list[float] | None = None
        self._heard_at: dict[str, float] = {}

    def __enter__(self) -> Monitor:
        speak_to_nodes()
        rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
        self._node = _MonitorNode()
        if self._with_estimates:
            for listener in self.listeners.values():
                listener.listen(self._node, self._node.taps)
        self._node.create_subscription(
            DiagnosticArray, DIAGNOSTICS, self._on_diagnostics, DIAGNOSTICS_QOS
        )
        if self._with_truth:
            # Of a thousand truths a second one is wanted now and then: no callback for each.
            self._node.taps.acquire(
                self._node.resolve_topic_name(TRUTH),
                "hc_msgs/msg/IndenterTruth",
                partial(self._on_truth, RecordParser("hc_msgs/msg/IndenterTruth")),
                depth=1,
                local=False,
            )
        self._marks = {
            name: self._node.create_publisher(
                EstimatorEvent, listener.full_name(EVENTS), CONFIGURATION_QOS
            )
            for name, listener in self.listeners.items()
        }
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
        del self._node, self._executor, self._clients, self._marks
        del self._clock_watch
        gc.collect()

    @property
    def statistics(self) -> EstimateStatistics:
        """Of the estimates of the first estimator."""
        return self._first.statistics

    @property
    def last_estimate_at(self) -> float:
        """When the last estimate of any estimator came, by time.monotonic; 0 before it."""
        return max(listener.last_at for listener in self.listeners.values())

    def problems(self) -> dict[str, str]:
        """Return what nodes call an error in their diagnostics, by node name."""
        return {
            name: values["message"]
            for name, values in self.diagnostics.items()
            if values["level"] == _ERROR
        }

    def has_finished(self, source: str) -> bool:
        """Whether a source said that it has come to its end; its process ends a little later."""
        said = self.diagnostics.get(source, {})
        return said.get("message", "").endswith("finished") and said["level"] != _ERROR

    def silent_s(self) -> float:
        """Return the time since the last estimate; NaN before the first one."""
        return self._first.silent_s()

    def mute_s(self, node_name: str) -> float:
        """Return the time since a node said anything of itself; NaN before it has."""
        return time.monotonic() - self._heard_at.get(node_name, math.nan)

    def namesakes(self, node_name: str) -> int:
        """Return how many nodes of this name there are in the domain, in the same namespace."""
        space, _, name = node_name.rpartition("/")
        return int(self._node.get_node_names_and_namespaces().count((name, f"/{space}")))

    def is_there(self, node_name: str) -> bool:
        """Return True once a node's ~/ready can be asked; does not wait."""
        client = self._client(Trigger, f"/{node_name}/ready")
        return bool(client.service_is_ready())

    def spin(self, duration_s: float) -> None:
        """Handle what arrives for a while."""
        end = time.monotonic() + duration_s
        while (left := end - time.monotonic()) > 0.0:
            self._executor.spin_once(timeout_sec=left)
        self._node.taps.drain()

    def truth(self) -> list[float] | None:
        """Return the rig's true K, B, n, p as of the last `spin`; None where nobody tells them."""
        return self._truth

    def page(self) -> str:
        """Return the address of the live page with its token; empty as long as there is none."""
        pages = (v for n, v in self.diagnostics.items() if n.split("/")[-1] == NODE_DASHBOARD)
        address = next(pages, {}).get("address", "")
        token = os.environ.get(TOKEN_VARIABLE, "")
        return f"{address}#token={token}" if address and token else ""

    def ask(self, what: str, estimator: str) -> None:
        """Ask an estimator for something that a key stands for.

        `answer` says what became of it, and of several estimators whose answer it is.
        """
        whose = f"{estimator}: " if len(self.listeners) > 1 else ""
        if what == "mark":
            self.answer = whose + self._mark(estimator)
            return
        said = f"{whose}{what.replace('_', ' ')}"
        client = self._client(Trigger, f"/{estimator}/{what}")
        if not client.service_is_ready():
            self.answer = f"{said}: the estimator does not answer"
            return
        self.answer = f"{said} …"
        future = client.call_async(Trigger.Request())
        future.add_done_callback(partial(self._on_answer, said))

    def _on_answer(self, said: str, future: Any) -> None:
        self.answer = f"{said}: {future.result().message}"

    def _mark(self, estimator: str) -> str:
        """Publish an event of a person at the latest sample; return what is said of it."""
        latest = self.listeners[estimator].statistics.latest
        if latest is None:
            return "nothing to mark yet"
        stamp = latest.header.stamp
        message = EstimatorEvent(
            kind=EstimatorEvent.MARK, reason="marked", sequence=latest.sequence
        )
        message.header.stamp.sec, message.header.stamp.nanosec = stamp.sec, stamp.nanosec
        message.configuration_revision = latest.configuration_revision
        self._marks[estimator].publish(message)
        return f"marked sample {latest.sequence}"

    def _on_truth(self, parser: RecordParser, arrivals: list[Arrival]) -> None:
        table, _stamps = parser.parse(arrivals)
        if len(table):
            self._truth = [float(table[name][-1]) for name in PARAMETERS]

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
            client = self._clients[name] = self._node.create_client(
                kind, name, qos_profile=SERVICE_QOS
            )
        return client

    def _spin_until(self, condition: Callable[[], bool], timeout_s: float) -> None:
        end = time.monotonic() + timeout_s
        while not condition() and (left := end - time.monotonic()) > 0.0:
            self._executor.spin_once(timeout_sec=min(left, 0.05))

    def _on_diagnostics(self, message: Any) -> None:
        for status in message.status:
            values = {item.key: item.value for item in status.values}
            values["level"] = str(int.from_bytes(status.level, "little"))
            values["message"] = status.message
            self.diagnostics[status.name] = values
            self._heard_at[status.name] = time.monotonic()
            if status.name == NODE_RECORDER and "bag" in values:
                self.dropped[values["bag"]] = int(number_said(values, "dropped"))
