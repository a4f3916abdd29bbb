"""The sensor streams of a robot from the command line: what is there, how fast, recorded."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from hc_bringup.errors import FAILURE, UserError
from hc_bringup.graph import Graph
from hc_estimator.stream.sensor_setup import VectorReadings
from hc_msgs_py.interface_class import interface_class
from hc_msgs_py.qos import SAMPLE_QOS
from hc_msgs_py.topics import RECONSTRUCTED_WRENCH
from hc_msgs_py.units import METRE_IN_MM, nanoseconds_from_stamp

WRENCH = "geometry_msgs/msg/WrenchStamped"
POSITIONS = {
    "geometry_msgs/msg/PoseStamped": "pose",
    "geometry_msgs/msg/TransformStamped": "transform",
    "sensor_msgs/msg/JointState": "joint",
}
"""Types of position topics, and what the parameter input.position.type calls them; best first."""
_XYZ = ("x", "y", "z")


class Stream(NamedTuple):
    """A topic that may be a sensor.

    Attributes:
        topic: its full name.
        kind: wrench, pose, transform or joint.
        rate_hz: messages a second; 0 if none came.
        frame: frame of its messages.
    """

    topic: str
    kind: str
    rate_hz: float
    frame: str


def find_streams(graph: Graph, seconds: float) -> list[Stream]:
    """Return all topics that may be sensors, with their rates measured for a while."""
    graph.settle()
    kinds = {WRENCH: "wrench"} | POSITIONS
    counts: dict[str, list[Any]] = {}
    found, subscriptions = [], []
    for name, types in graph.topics():
        kind = next((kinds[t] for t in types if t in kinds), None)
        if kind is None or name.endswith(f"/{RECONSTRUCTED_WRENCH}"):
            continue
        heard: list[Any] = []
        counts[name] = heard
        subscriptions.append(
            graph.node.create_subscription(
                interface_class(types[0]), name, _keeper(heard), SAMPLE_QOS
            )
        )
        found.append((name, kind))
    graph.spin(seconds)
    for subscription in subscriptions:
        graph.node.destroy_subscription(subscription)
    streams = []
    for name, kind in found:
        arrivals = [arrival for arrival, _frame in counts[name]]
        apart = arrivals[-1] - arrivals[0] if len(arrivals) > 1 else 0.0
        rate = (len(arrivals) - 1) / apart if apart > 0.0 else float(bool(arrivals))
        streams.append(Stream(name, kind, rate, counts[name][-1][1] if arrivals else ""))
    return streams


def best(streams: list[Stream], kinds: tuple[str, ...]) -> Stream | None:
    """Return the stream of some kinds to propose: of the first kind that lives, the fastest."""
    for kind in kinds:
        alive = [s for s in streams if s.kind == kind and s.rate_hz > 0.0]
        if alive:
            return max(alive, key=lambda s: s.rate_hz)
    return None


class Recorder:
    """Records a force and a position stream into arrays."""

    def __init__(self, graph: Graph, force: Stream, position: Stream) -> None:
        self._graph = graph
        self._force: list[tuple[float, ...]] = []
        self._position: list[tuple[float, ...]] = []
        self._names: tuple[str, ...] = ()
        self._origin_ns: int | None = None
        types = {kind: name for name, kind in POSITIONS.items()}
        read: dict[str, Callable[[Any], tuple[float, ...] | None]] = {
            "pose": lambda m: _mm(m.pose.position),
            "transform": lambda m: _mm(m.transform.translation),
            "joint": self._joints,
        }
        for stream, kind, keep, values in (
            (force, WRENCH, self._force, _wrench),
            (position, types[position.kind], self._position, read[position.kind]),
        ):
            graph.node.create_subscription(
                interface_class(kind), stream.topic, self._taker(keep, values), SAMPLE_QOS
            )
        graph.wait_for(lambda: bool(self._force and self._position))

    def start(self) -> None:
        """Forget what was recorded so far."""
        self._force.clear()
        self._position.clear()
        self._origin_ns = None

    def spin(self, seconds: float, tell: Callable[[float], None]) -> None:
        """Record for a while; `tell` hears how many seconds are left.

        Raises:
            UserError: if a signal asks to end.
        """
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0.0:
            tell(left)
            if not self._graph.spin(min(left, 0.5)):
                raise UserError("interrupted", FAILURE)

    @property
    def elapsed_s(self) -> float:
        """Time from the first to the newest reading."""
        return max((row[0] for row in self._force[-1:]), default=0.0)

    def readings(self) -> tuple[VectorReadings, VectorReadings]:
        """Return what was recorded: force, and position.

        Raises:
            UserError: if one of them is missing.
        """
        for rows, what in ((self._force, "force"), (self._position, "position")):
            if not rows:
                raise UserError(f"no message of the {what} came", FAILURE)
        force, position = np.array(self._force), np.array(self._position)
        return (
            VectorReadings(force[:, 0], force[:, 1:], _XYZ),
            VectorReadings(position[:, 0], position[:, 1:], self._names or _XYZ),
        )

    def _taker(
        self, keep: list[tuple[float, ...]], values: Callable[[Any], tuple[float, ...] | None]
    ) -> Callable[[Any], None]:
        def take(message: Any) -> None:
            stamp_ns = nanoseconds_from_stamp(message.header.stamp)
            if self._origin_ns is None:
                self._origin_ns = stamp_ns
            row = values(message)
            if row is not None:
                keep.append(((stamp_ns - self._origin_ns) * 1e-9, *row))

        return take

    def _joints(self, message: Any) -> tuple[float, ...] | None:
        """Return the joints of a message; those of another set than the first are passed over."""
        if not self._names:
            self._names = tuple(message.name)
        if tuple(message.name) != self._names or len(message.position) != len(self._names):
            return None
        return tuple(p * METRE_IN_MM for p in message.position)


def _keeper(keep: list[Any]) -> Callable[[Any], None]:
    """Return what keeps the time of arrival and the frame of messages."""
    return lambda message: keep.append((time.monotonic(), str(message.header.frame_id)))


def _wrench(message: Any) -> tuple[float, ...]:
    force = message.wrench.force
    return force.x, force.y, force.z


def _mm(point: Any) -> tuple[float, ...]:
    return point.x * METRE_IN_MM, point.y * METRE_IN_MM, point.z * METRE_IN_MM
