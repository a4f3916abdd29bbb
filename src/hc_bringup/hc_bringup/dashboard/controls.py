"""What a page may ask for: look at parameters; with --control also change, reset, tare, record.

Requests come from the server's thread into a queue; `tick` serves them in the node's thread, so
that everything about ROS happens there. A request that no node answers fails after a while, it
never hangs.
"""

from __future__ import annotations

import concurrent.futures
import json
import queue
import time
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any, Final

from hc_msgs.msg import EstimatorEvent
from rcl_interfaces.msg import ParameterType
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient
from std_srvs.srv import Trigger

from hc_bringup.dashboard.feed import Feed
from hc_bringup.dashboard.recording import Recording
from hc_bringup.errors import UserError
from hc_msgs_py.conversion import LONGEST_REASON, fill_event
from hc_msgs_py.qos import CONFIGURATION_QOS, SERVICE_QOS
from hc_msgs_py.topics import EVENTS, NODE_ESTIMATOR, NODE_INDENTER
from hc_sim_rig.scenario import available_scenarios

READY_S: Final = 5.0
"""How long a server is waited for that is not there."""
ANSWER_S: Final = 15.0
"""How long an answer is waited for."""
REPEAT_S: Final = 1.0
SETTLE_S: Final = 1.0
"""From when a client sees its server until the server surely sees the client."""
SERVICES: Final = ("reset", "tare", "find_surface")
_HIDDEN_PARAMETERS: Final = ("use_sim_time", "start_type_description_service", "qos_overrides")
_MOST_CHANGES: Final = 200

Answer = dict[str, Any]


class WrongRequestError(Exception):
    """Why a request cannot be served, in one line for the page."""


class Controls:
    """Serves the requests of the pages."""

    def __init__(self, node: Node, feed: Feed, recording: Recording, *, allowed: bool) -> None:
        """Set up the controls.

        Args:
            node: the dashboard's node.
            feed: what was heard last, for marks.
            recording: a recorder of the dashboard's own.
            allowed: whether anything may be changed.
        """
        self._node, self._feed, self._recording = node, feed, recording
        self._allowed = allowed
        self._queue: queue.SimpleQueue[tuple[dict[str, Any], concurrent.futures.Future[Answer]]]
        self._queue = queue.SimpleQueue()
        self._pending: list[_Pending] = []
        self._parameter_clients: dict[str, AsyncParameterClient] = {}
        self._triggers: dict[str, Any] = {}
        self._ready_since: dict[str, float] = {}
        if allowed:  # made before anybody clicks, so that the server knows them by then
            for service in SERVICES:
                self._trigger_client(NODE_ESTIMATOR, service)
        self._marks = node.create_publisher(EstimatorEvent, EVENTS, CONFIGURATION_QOS)

    def request(self, message: dict[str, Any]) -> concurrent.futures.Future[Answer]:
        """Queue a request; may be called in any thread."""
        future: concurrent.futures.Future[Answer] = concurrent.futures.Future()
        self._queue.put((message, future))
        return future

    def tick(self) -> None:
        """Begin what was asked for, and look after what is under way."""
        while not self._queue.empty():
            message, future = self._queue.get()
            try:
                self._serve(message, future)
            except (WrongRequestError, UserError) as error:
                _finish(future, {"ok": False, "message": str(error)})
        for service in self._triggers:
            self._settled(service)
        self._pending = [pending for pending in self._pending if not pending.look()]

    def _serve(self, message: dict[str, Any], future: concurrent.futures.Future[Answer]) -> None:
        _check_texts(message)
        operation = message.get("op")
        if operation == "settings":
            self._settings(_node_name(message), future)
            return
        if operation not in ("set", "call", "record", "mark", "clear_map"):
            raise WrongRequestError(f"no such request: {str(operation)[:40]}")
        if not self._allowed:
            raise WrongRequestError(
                "read-only: start the dashboard with --control to change things"
            )
        if operation == "set":
            self._set(_node_name(message), message.get("parameters"), future)
        elif operation == "call":
            self._call(_node_name(message), message.get("service"), future)
        elif operation == "record":
            _finish(future, {"ok": True, "message": self._record(message.get("on"))})
        elif operation == "mark":
            _finish(future, {"ok": True, "message": self._mark(message.get("text"))})
        else:
            self._feed.clear_map()
            _finish(future, {"ok": True, "message": "the map starts afresh"})

    # Parameters.

    def _settings(self, name: str, future: concurrent.futures.Future[Answer]) -> None:
        """Answer with all parameters of a node: value, range, description."""
        client = self._parameter_client(name)

        def described(names: list[str], values: list[Any], descriptors: list[Any]) -> None:
            entries = [
                _entry(parameter, value, descriptor)
                for parameter, value, descriptor in zip(names, values, descriptors, strict=True)
            ]
            _finish(future, {"ok": True, "node": name, "parameters": entries})

        def got(names: list[str], values: list[Any]) -> None:
            self._await(
                lambda: client.describe_parameters(names),
                lambda response: described(names, values, list(response.descriptors)),
                future,
                f"node {name} does not describe its parameters",
            )

        def listed(response: Any) -> None:
            names = [
                n for n in sorted(response.result.names) if not n.startswith(_HIDDEN_PARAMETERS)
            ]
            self._await(
                lambda: client.get_parameters(names),
                lambda answer: got(names, list(answer.values)),
                future,
                f"node {name} does not tell its parameters",
            )

        self._await(
            lambda: client.list_parameters([], 0),
            listed,
            future,
            f"node {name} does not answer: is it running?",
            ready=client.services_are_ready,
        )

    def _set(
        self, name: str, parameters: object, future: concurrent.futures.Future[Answer]
    ) -> None:
        """Set parameters of a node, all or none."""
        if not isinstance(parameters, dict) or not 0 < len(parameters) <= _MOST_CHANGES:
            raise WrongRequestError("no parameters given")
        client = self._parameter_client(name)
        names = list(parameters)

        def done(response: Any) -> None:
            result = response.result
            text = ", ".join(f"{key} = {value}" for key, value in parameters.items())
            message = text if result.successful else f"refused: {result.reason}"
            _finish(future, {"ok": bool(result.successful), "message": message})

        def typed(response: Any) -> None:
            try:
                messages = [
                    Parameter(key, value=_converted(key, parameters[key], old)).to_parameter_msg()
                    for key, old in zip(names, response.values, strict=True)
                ]
            except (WrongRequestError, TypeError, ValueError, OverflowError) as error:
                _finish(future, {"ok": False, "message": str(error)})
                return
            late = f"node {name} does not answer; it may still do what was asked"

            def change(_response: Any) -> None:
                send = partial(client.set_parameters_atomically, messages)
                self._await(send, done, future, late, repeat=False)

            # A change is sent once. That its answer will arrive is known from the answer to one
            # of nothing, which does no harm when it is repeated.
            self._await(partial(client.set_parameters_atomically, []), change, future, late)

        self._await(
            lambda: client.get_parameters(names),
            typed,
            future,
            f"node {name} does not answer: is it running?",
            ready=client.services_are_ready,
        )

    def _parameter_client(self, name: str) -> AsyncParameterClient:
        if name not in self._parameter_clients:
            client = AsyncParameterClient(self._node, name, qos_profile=SERVICE_QOS)
            self._parameter_clients[name] = client
        return self._parameter_clients[name]

    # Services, recording, marks.

    def _call(self, name: str, service: object, future: concurrent.futures.Future[Answer]) -> None:
        if service not in SERVICES:
            raise WrongRequestError(f"no such service; there are {', '.join(SERVICES)}")
        full, client = self._trigger_client(name, str(service))

        def done(response: Any) -> None:
            _finish(future, {"ok": bool(response.success), "message": str(response.message)})

        self._await(
            lambda: client.call_async(Trigger.Request()),
            done,
            future,
            f"{full} does not answer: is the node running?",
            ready=lambda: self._settled(full),
            repeat=False,
        )

    def _trigger_client(self, node: str, service: str) -> tuple[str, Any]:
        """Return the full name of a service of a node and its client."""
        full = f"{self._node.resolve_topic_name(node)}/{service}"
        if full not in self._triggers:
            client = self._node.create_client(Trigger, full, qos_profile=SERVICE_QOS)
            self._triggers[full] = client
        return full, self._triggers[full]

    def _settled(self, service: str) -> bool:
        """Whether a service has been there long enough to know its client."""
        if not self._triggers[service].service_is_ready():
            self._ready_since.pop(service, None)
            return False
        now = time.monotonic()
        return now - self._ready_since.setdefault(service, now) >= SETTLE_S

    def _record(self, on: object) -> str:
        try:
            return self._recording.start() if on else self._recording.stop()
        except OSError as error:
            raise WrongRequestError(str(error)) from error

    def _mark(self, text: object) -> str:
        """Publish an event of a person, at the latest sample, for the record."""
        line = " ".join(str(text or "").split())[:LONGEST_REASON] or "marked"
        message = EstimatorEvent()
        stamp = self._feed.last_stamp_ns or self._node.get_clock().now().nanoseconds
        revision = int(self._feed.rare.configuration.get("revision", 0))
        fill_event(message, EstimatorEvent.MARK, stamp, self._feed.last_sequence, revision, line)
        self._marks.publish(message)
        return f"marked: {line}"

    def _await(
        self,
        send: Callable[[], Any],
        use: Callable[[Any], None],
        future: concurrent.futures.Future[Answer],
        failure: str,
        *,
        ready: Callable[[], bool] = lambda: True,
        repeat: bool = True,
    ) -> None:
        pending = _Pending(send, use, future, failure, ready, repeat)
        if not pending.look():
            self._pending.append(pending)


class _Pending:
    """A request on its way to a node.

    A server that has not discovered this client yet answers into the void, so a request that does
    no harm when it is repeated is sent again while no answer comes. One that must not happen twice
    is sent when the server is known to know this client.
    """

    def __init__(
        self,
        send: Callable[[], Any],
        use: Callable[[Any], None],
        future: concurrent.futures.Future[Answer],
        failure: str,
        ready: Callable[[], bool],
        repeat: bool,
    ) -> None:
        self._send, self._use, self._future = send, use, future
        self._failure, self._ready, self._repeat = failure, ready, repeat
        self._since = time.monotonic()
        self._sent: list[Any] = []
        self._next = 0.0

    def look(self) -> bool:
        """Go on with it; return whether it is over."""
        now = time.monotonic()
        for sent in self._sent:
            if sent.done():
                self._use(sent.result())
                return True
        if now > self._since + (ANSWER_S if self._sent else READY_S):
            _finish(self._future, {"ok": False, "message": self._failure})
            return True
        if now >= self._next and (self._repeat or not self._sent) and self._ready():
            self._sent.append(self._send())
            self._next = now + REPEAT_S
        return False


def _finish(future: concurrent.futures.Future[Answer], answer: Answer) -> None:
    if not future.done():
        future.set_result(answer)


def _check_texts(message: Mapping[str, Any]) -> None:
    """See that what a page sent can be sent on: JSON knows texts that are none (lone surrogates).

    Raises:
        WrongRequestError: if it cannot.
    """
    try:
        json.dumps(message, ensure_ascii=False).encode()
    except (UnicodeEncodeError, RecursionError):
        raise WrongRequestError("no such request: a text in it is no text") from None


def _node_name(message: Mapping[str, Any]) -> str:
    name = message.get("node", NODE_ESTIMATOR)
    if name not in (NODE_ESTIMATOR, NODE_INDENTER):
        raise WrongRequestError("no such node: estimator or indenter")
    return str(name)


def _entry(name: str, value: Any, descriptor: Any) -> dict[str, Any]:
    """Return what a page shows of a parameter."""
    entry: dict[str, Any] = {
        "name": name,
        "value": _plain(parameter_value_to_python(value)),
        "type": _TYPE_NAMES.get(value.type, "other"),
        "about": descriptor.description,
        "read_only": bool(descriptor.read_only),
    }
    if descriptor.dynamic_typing:  # a word or a number: the node finds out which
        entry |= {"value": str(entry["value"]), "type": "text"}
    for ranges in (descriptor.integer_range, descriptor.floating_point_range):
        for limits in ranges:
            entry["from"], entry["to"] = limits.from_value, limits.to_value
    constraint = descriptor.additional_constraints
    if constraint.startswith("one of: "):
        entry["choices"] = constraint.removeprefix("one of: ").split(", ")
    if name == "scenario":  # a file of one's own works too
        entry["suggestions"] = available_scenarios()
    return entry


_TYPE_NAMES: Final = {
    ParameterType.PARAMETER_BOOL: "bool",
    ParameterType.PARAMETER_INTEGER: "integer",
    ParameterType.PARAMETER_DOUBLE: "number",
    ParameterType.PARAMETER_STRING: "text",
    ParameterType.PARAMETER_DOUBLE_ARRAY: "numbers",
    ParameterType.PARAMETER_STRING_ARRAY: "texts",
}


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, Iterable) and not isinstance(value, str) else value


def _converted(name: str, value: Any, old: Any) -> Any:
    """Return a value from the page in the type that the parameter has.

    Raises:
        WrongRequestError: if it cannot have it.
    """
    kind = old.type
    if kind == ParameterType.PARAMETER_NOT_SET:
        raise WrongRequestError(f"there is no parameter {name[:60]}")
    number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if kind == ParameterType.PARAMETER_BOOL and isinstance(value, bool):
        return value
    if kind == ParameterType.PARAMETER_INTEGER and number and float(value).is_integer():
        if not -(2**63) <= int(value) < 2**63:
            raise WrongRequestError(f"{name}: {float(value):g} is too large")
        return int(value)
    if kind == ParameterType.PARAMETER_DOUBLE and number:
        return float(value)
    if kind == ParameterType.PARAMETER_STRING and isinstance(value, str):
        return value
    if kind == ParameterType.PARAMETER_DOUBLE and isinstance(value, str):
        return value  # the node refuses it, unless the parameter may be a word too
    if kind == ParameterType.PARAMETER_DOUBLE_ARRAY and isinstance(value, list):
        numbers = [item for item in value if type(item) in (int, float)]
        if len(numbers) == len(value):
            return [float(item) for item in numbers]
    if kind == ParameterType.PARAMETER_STRING_ARRAY and isinstance(value, list):
        return [str(item) for item in value]
    raise WrongRequestError(f"{name}: {value!r} is not {_TYPE_NAMES.get(kind, 'possible')}")
