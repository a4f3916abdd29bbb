"""A look at the ROS graph from the command line, that waits for discovery before it answers.

Discovery takes a third of a second where hc_msgs_py/fast_dds.xml is in force, and up to 3 s
with nodes of others. A command that answered at once would say that a node does not exist which
only has not been seen yet. What is there is told within 3 s, on a machine that is busy within 9 s
(and that it waits is said); a node that is asked something may take longer.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from typing import Any, Final

import rclpy
from rclpy.exceptions import InvalidTopicNameException
from rclpy.executors import ExternalShutdownException
from rclpy.experimental import EventsExecutor
from rclpy.parameter_client import AsyncParameterClient
from rclpy.validate_full_topic_name import validate_full_topic_name

from hc_bringup.domain_lock import elsewhere_hint
from hc_bringup.errors import FAILURE, WRONG_USE, UserError
from hc_bringup.heartbeat import MARK, busy
from hc_bringup.reach import speak_to_nodes
from hc_bringup.stopped_processes import stopped_hint
from hc_msgs_py.nearest import hint
from hc_msgs_py.qos import SERVICE_QOS

_LEAST_WAIT_S: Final = 0.8
_QUIET_S: Final = 0.4
_MOST_WAIT_S: Final = 2.3
_BUSY_WAIT_S: Final = 8.0
"""On a machine that has more to do than processors: nodes announce themselves seconds late."""
_REPEAT_S: Final = 0.5
_ANSWER_S: Final = 10.0
"""For a node that is there to answer: a busy one takes seconds."""


class Graph:
    """A short-lived node of the command line. Use as a context manager."""

    _said_to_wait = False

    def __enter__(self) -> Graph:
        speak_to_nodes()
        rclpy.init(args=[])
        self._started = time.monotonic()
        self.node = rclpy.create_node(
            f"_hc_{os.getpid()}", enable_rosout=False, start_parameter_services=False
        )
        self._executor = EventsExecutor()
        self._executor.add_node(self.node)
        return self

    def __exit__(self, *_exception: object) -> None:
        self._executor.remove_node(self.node)
        self.node.destroy_node()
        rclpy.try_shutdown()

    def spin(self, duration_s: float) -> bool:
        """Handle what arrives for a while; return False once a signal asks to end."""
        end = time.monotonic() + duration_s
        try:
            while (left := end - time.monotonic()) > 0.0:
                self._executor.spin_once(timeout_sec=min(left, 0.1))
                if not rclpy.ok():
                    return False
        except ExternalShutdownException:
            return False
        return True

    def wait_for(self, condition: Callable[[], object], timeout_s: float | None = None) -> bool:
        """Spin until a condition holds; return whether it did in time.

        Args:
            condition: what is waited for.
            timeout_s: so long; None for as long as discovery takes.
        """
        end = time.monotonic() + (_MOST_WAIT_S if timeout_s is None else timeout_s)
        while not condition():
            if time.monotonic() >= end:
                if timeout_s is not None or not self._is_patient():
                    return False
                timeout_s = _BUSY_WAIT_S - _MOST_WAIT_S
                end += timeout_s
            if not self.spin(0.02):
                return False
        return True

    def _is_patient(self) -> bool:
        """Whether to wait for longer, for the machine is busy; say so once to who looks on."""
        note = busy()
        if note and not self._said_to_wait and sys.stderr.isatty():
            self._said_to_wait = True
            sys.stderr.write(f"{MARK}not seen yet; looking for up to {_BUSY_WAIT_S:g} s{note}\n")
        return bool(note)

    def settle(self, expected: Callable[[], bool] = lambda: True) -> None:
        """Spin until discovery has brought nothing new for a while.

        Args:
            expected: what is usually found; while it is not, the longest time is waited for it.

        Raises:
            KeyboardInterrupt: if a signal asks to end: what is known by then is not an answer.
        """
        seen, changed = None, time.monotonic()
        while True:
            now = time.monotonic()
            names = (self.node_names(hidden=True), self.topics(hidden=True))
            if names != seen:
                seen, changed = names, now
            waited = now - self._started
            if waited >= _BUSY_WAIT_S or (
                waited >= _MOST_WAIT_S and (names[0] or not self._is_patient())
            ):
                return
            quiet = waited >= _LEAST_WAIT_S and now - changed >= _QUIET_S
            if quiet and expected() and (names[0] or not busy()):
                return
            if not self.spin(0.05):
                raise KeyboardInterrupt

    def node_names(self, *, hidden: bool = False) -> list[str]:
        """Return full names of all nodes but this one; those that start with _ are hidden."""
        names = [
            f"{namespace.rstrip('/')}/{name}"
            for name, namespace in self.node.get_node_names_and_namespaces()
            if name != self.node.get_name() and (hidden or not name.startswith("_"))
        ]
        return sorted(names)

    def topics(self, *, hidden: bool = False) -> list[tuple[str, list[str]]]:
        """Return names and types of all topics that somebody publishes or subscribes."""
        return sorted(
            (name, types)
            for name, types in self.node.get_topic_names_and_types()
            if hidden or not any(part.startswith("_") for part in name.split("/"))
        )

    def require_node(self, name: str) -> str:
        """Return the full name of a node once it is discovered.

        Of two nodes with one name either may answer: standard error then says so.

        Raises:
            UserError: if it does not appear; the message lists the nodes that do.
        """
        full = absolute(name)
        if not self.wait_for(lambda: full in self.node_names(hidden=True)):
            known = hint(full, self.node_names(), "running nodes")
            raise UserError(f"there is no node {full}; {known}{self._why()}", FAILURE)
        count = self.node_names(hidden=True).count(full)
        if count > 1:
            sys.stderr.write(
                f"{count} nodes are called {full}, and any of them may answer: end one, or give it "
                "a namespace (one that was killed counts for some seconds more)\n"
            )
        return full

    def require_topic(self, name: str) -> tuple[str, str]:
        """Return the full name and the type of a topic once somebody publishes it.

        Raises:
            UserError: if nobody does; the message lists the topics that there are.
        """
        full = topic_name(name)

        def types() -> list[str]:
            return next((t for n, t in self.topics(hidden=True) if n == full), [])

        if not self.wait_for(lambda: self.node.count_publishers(full) > 0 and bool(types())):
            raise UserError(
                f"nobody publishes {full}; {self.known_topics(full)}{self._why()}", FAILURE
            )
        if len(types()) > 1:
            raise UserError(
                f"{full} is published with several types: {', '.join(types())}", FAILURE
            )
        return full, types()[0]

    def _why(self) -> str:
        """Return why nobody may be there: stopped processes, or a run in another domain."""
        return stopped_hint() + ("" if self.node_names() else elsewhere_hint())

    def known_topics(self, name: str) -> str:
        """Return "did you mean ...?" for the name of a topic, or the topics that there are."""
        return hint(name, (other for other, _ in self.topics() if other != name), "topics")

    def parameter_client(self, node_name: str) -> AsyncParameterClient:
        """Return a client for the parameters of a node that has been discovered.

        Raises:
            UserError: if the node offers no parameter services.
        """
        client = AsyncParameterClient(self.node, node_name, qos_profile=SERVICE_QOS)
        if not self.wait_for(client.services_are_ready):
            raise UserError(f"node {node_name} offers no parameters{stopped_hint()}", FAILURE)
        return client

    def call(self, send: Callable[[], Any], what: str) -> Any:
        """Send a request and return the answer; send it again while none comes.

        A server that has not discovered the client yet answers into the void, although the client
        sees the server already. Requests must therefore do no harm when they are repeated.

        Args:
            send: sends the request and returns its future.
            what: what is asked for, for the error.

        Raises:
            UserError: if no answer comes.
        """
        futures: list[Any] = []
        end = time.monotonic() + _ANSWER_S
        while time.monotonic() < end:
            futures.append(send())
            if self.wait_for(lambda: any(f.done() for f in futures), _REPEAT_S):
                return next(f for f in futures if f.done()).result()
        raise UserError(
            f"{what}: no answer within {_ANSWER_S:g} s"
            + (stopped_hint() or ": is the node stopped, or very busy?"),
            FAILURE,
        )


def absolute(name: str) -> str:
    """Return a topic or node name with its leading slash."""
    return name if name.startswith("/") else f"/{name}"


def topic_name(name: str) -> str:
    """Return the full name of a topic.

    Args:
        name: of a topic, or a pattern of several with * and ?.

    Raises:
        UserError: if no topic can be called so.
    """
    full = name if name.startswith("*") else absolute(name)
    try:
        validate_full_topic_name("/" + full.translate(str.maketrans("*?", "xx")).lstrip("/"))
    except InvalidTopicNameException as error:
        reason = str(error).split(":")[1].replace("topic name", "it").strip()
        raise UserError(f"{name!r} is no name of a topic: {reason}", WRONG_USE) from error
    return full
