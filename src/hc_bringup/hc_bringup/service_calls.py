"""Calls of services from the command line: discovered, asked once, answered or told why not.

A request is sent once, for it may do something that must not happen twice. A server that has not
discovered the client yet answers into the void, so the client waits a moment between finding the
server and asking it. On a busy machine that moment may be too short: what may happen twice is then
asked for again.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

from hc_bringup.errors import FAILURE, UserError
from hc_bringup.graph import Graph, absolute
from hc_bringup.stopped_processes import stopped_hint
from hc_msgs_py.diagnostics import FEELS
from hc_msgs_py.nearest import hint
from hc_msgs_py.qos import CONFIGURATION_QOS, DIAGNOSTICS_QOS, SERVICE_QOS
from hc_msgs_py.topics import DIAGNOSTICS, EVENTS, NODE_ESTIMATOR

SETTLE_S = 0.6
"""Three announcements of a participant: by then a server has discovered a new client."""
ANSWER_S = 10.0
AGAIN_S = 3.0
GONE_S = 3.0
"""A server that is not seen for so long has ended: on a busy machine one vanishes for a moment."""
HARMLESS = ("reset", "save", "load")
"""Done twice, they do what they do once: they are asked for again while no answer comes."""
_OF_EVERY_NODE = ("_parameters", "_atomically", "/get_parameter_types", "/get_type_description")


def services(graph: Graph, *, hidden: bool = False) -> list[tuple[str, list[str]]]:
    """Return names and types of all services."""
    return sorted(
        (name, types)
        for name, types in graph.node.get_service_names_and_types()
        if hidden or not any(part.startswith("_") for part in name.split("/"))
    )


def require_service(graph: Graph, name: str) -> tuple[str, str]:
    """Return the full name and the type of a service once it is discovered.

    Raises:
        UserError: if it does not appear; the message lists those that do.
    """
    full = absolute(name)

    def types() -> list[str]:
        return next((t for n, t in services(graph, hidden=True) if n == full), [])

    if not graph.wait_for(lambda: bool(types())):
        known = [n for n, _ in services(graph) if not n.endswith(_OF_EVERY_NODE)]
        raise UserError(
            f"there is no service {full}; {hint(full, known, 'services')}{stopped_hint()}", FAILURE
        )
    return full, types()[0]


class Client:
    """A client of one service, for one or more calls."""

    def __init__(self, graph: Graph, service_type: Any, name: str) -> None:
        """Find the server and let it find this client.

        Raises:
            UserError: if nobody offers the service.
        """
        self._graph = graph
        self._name = name
        self._client = graph.node.create_client(service_type, name, qos_profile=SERVICE_QOS)
        self._seen_s = time.monotonic()
        if not graph.wait_for(self._client.service_is_ready):
            raise UserError(f"nobody offers the service {name}{stopped_hint()}", FAILURE)
        graph.spin(SETTLE_S)

    def call(self, request: Any, timeout_s: float = ANSWER_S, again_s: float = math.inf) -> Any:
        """Send a request and return the answer.

        Args:
            request: what is asked for.
            timeout_s: so long an answer is waited for.
            again_s: so often the request is sent again meanwhile; by default it is sent once.

        Raises:
            UserError: if no answer comes in time, or the server ends before it answers.
        """
        futures: list[Any] = []
        end = time.monotonic() + timeout_s

        def answers() -> list[Any]:
            return [future for future in futures if future.done()]

        self._seen_s = time.monotonic()
        while (left := end - time.monotonic()) > 0.0:
            futures.append(self._client.call_async(request))
            self._graph.wait_for(lambda: answers() or self._is_gone(), min(left, again_s))
            if answers():
                return answers()[0].result()
            if self._is_gone():
                raise UserError(f"the node of {self._name} ended before it answered", FAILURE)
        raise UserError(
            f"{self._name} did not answer within {timeout_s:g} s"
            + (stopped_hint() or ": is its node busy or stopped?"),
            FAILURE,
        )

    def _is_gone(self) -> bool:
        """Whether the server has not been seen for a while."""
        now = time.monotonic()
        if self._client.service_is_ready():
            self._seen_s = now
        return now - self._seen_s > GONE_S


class EstimatorServices:
    """The Trigger services of an estimator node, and what it says of their outcome."""

    def __init__(self, graph: Graph, node: str) -> None:
        """Find the node.

        Raises:
            UserError: if there is no such node.
        """
        self._graph = graph
        self.node = graph.require_node(node)
        self._namespace = self.node.rpartition("/")[0]
        self._events: list[Any] = []
        self._speakers: set[bytes] = set()
        self._feels = ""

    def listen(self) -> None:
        """Listen to the node's events from now on."""
        from diagnostic_msgs.msg import DiagnosticArray
        from hc_msgs.msg import EstimatorEvent

        self._graph.node.create_subscription(
            EstimatorEvent,
            f"{self._namespace}/{EVENTS}",
            lambda event: self._events.append(event),
            CONFIGURATION_QOS,
        )
        self._graph.node.create_subscription(
            DiagnosticArray, DIAGNOSTICS, self._on_diagnostics, DIAGNOSTICS_QOS
        )
        self._graph.spin(SETTLE_S)  # events of before come at once, and are forgotten
        self._speakers = self._who_speaks()

    def _on_diagnostics(self, message: Any) -> None:
        name = self.node.rpartition("/")[2]
        for status in message.status:
            if status.name == name:
                self._feels = next((v.value for v in status.values if v.key == FEELS), "")

    def _who_speaks(self) -> set[bytes]:
        topic = f"{self._namespace}/{EVENTS}"
        endpoints = self._graph.node.get_publishers_info_by_topic(topic)
        return {bytes(endpoint.endpoint_gid) for endpoint in endpoints}

    def trigger(self, service: str) -> str:
        """Call a service; return what it says.

        Raises:
            UserError: if it refuses, with its reason, or does not answer.
        """
        from std_srvs.srv import Trigger

        client = Client(self._graph, Trigger, f"{self.node}/{service}")
        self._events.clear()
        again_s = AGAIN_S if service in HARMLESS else math.inf
        answer = client.call(Trigger.Request(), again_s=again_s)
        if not answer.success:
            raise UserError(answer.message, FAILURE)
        return str(answer.message)

    def outcome(
        self,
        wanted: Callable[[Any], bool],
        timeout_s: float | None,
        tell: Callable[[str], None] = lambda feels: None,
    ) -> Any:
        """Wait for an event, begun to listen to before.

        Args:
            wanted: whether a hc_msgs/EstimatorEvent is the one.
            timeout_s: how long; None waits until a signal.
            tell: hears once a second what the node feels meanwhile.

        Returns:
            The event; None if it did not come, or a signal did.

        Raises:
            UserError: if the node is gone: one that is started in its place knows of nothing.
        """
        end = None if timeout_s is None else time.monotonic() + timeout_s
        while end is None or time.monotonic() < end:
            for event in self._events:
                if wanted(event):
                    return event
            if not self._graph.spin(0.02):
                return None
            if self._feels:
                tell(self._feels)
                self._feels = ""
            if self._speakers and self._speakers.isdisjoint(self._who_speaks()):
                raise UserError(
                    f"{self.node} ended meanwhile, and what it was to do with it: ask again",
                    FAILURE,
                )
        return None

    def with_parameter(self, name: str, value: Any, act: Callable[[], Any]) -> Any:
        """Do something while a parameter of the node has a value, and put the old one back.

        If it has the value already, another client may have set it for a moment: it is left alone.

        Raises:
            UserError: if the node refuses the value.
        """
        from rclpy.parameter import Parameter, parameter_value_to_python

        client = self._graph.parameter_client(self.node)

        def change(to: Any) -> None:
            answer = self._graph.call(
                lambda: client.set_parameters([Parameter(name, value=to)]), name
            )
            if not answer.results[0].successful:
                raise UserError(f"{name} = {to}: {answer.results[0].reason}", FAILURE)

        got = self._graph.call(lambda: client.get_parameters([name]), name)
        before = parameter_value_to_python(got.values[0])
        if before == value:
            return act()
        change(value)
        try:
            return act()
        finally:
            change(before)


def add_node_option(parser: Any) -> None:
    """Declare which estimator is meant."""
    parser.add_argument(
        "--node",
        default=NODE_ESTIMATOR,
        metavar="NAME",
        help=f"the estimator node (default: {NODE_ESTIMATOR})",
    )


def trigger(node: str, service: str) -> int:
    """Call one of the estimator's services and print its answer; for a command's `run`."""
    with Graph() as graph:
        print(EstimatorServices(graph, node).trigger(service))
    return 0
