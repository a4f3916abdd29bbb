"""The sensor streams of a robot from the command line: what is there, how fast, recorded."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from hc_bringup.errors import FAILURE, UserError
from hc_bringup.frame_streams import FRAMES, FrameListener, FrameSearch
from hc_bringup.graph import Graph
from hc_bringup.simulated_clock import ClockListener
from hc_bringup.turning import turned_deg
from hc_estimator.stream.arrival_stamps import INSTANT, TOGETHER
from hc_estimator.stream.frame_poses import FramePoses
from hc_estimator.stream.readings import FloatArray
from hc_estimator.stream.vector_readings import VectorReadings
from hc_msgs_py.interface_class import interface_class
from hc_msgs_py.qos import SAMPLE_QOS
from hc_msgs_py.topics import RECONSTRUCTED_WRENCH
from hc_msgs_py.units import METRE_IN_MM, nanoseconds_from_stamp

WRENCH = "geometry_msgs/msg/WrenchStamped"
JOINTS = "sensor_msgs/msg/JointState"
POSITIONS = {
    "geometry_msgs/msg/PoseStamped": "pose",
    "geometry_msgs/msg/TransformStamped": "transform",
    JOINTS: "joint",
}
"""Types of position topics, and what the parameter input.position.type calls them; best first."""
_NO_STAMP = "carries no time of measurement; let its driver publish the type "
_OTHER_TYPE = "is not read; let its driver publish "
_UNUSABLE = {
    "geometry_msgs/msg/Wrench": f"{_NO_STAMP}WrenchStamped",
    "geometry_msgs/msg/Pose": f"{_NO_STAMP}PoseStamped",
    "geometry_msgs/msg/Point": f"{_NO_STAMP}PoseStamped",
    "geometry_msgs/msg/Transform": f"{_NO_STAMP}TransformStamped",
    "geometry_msgs/msg/Vector3": f"{_NO_STAMP}WrenchStamped or PoseStamped",
    **{
        f"std_msgs/msg/{kind}": f"{_NO_STAMP}WrenchStamped or JointState"
        for kind in (
            *("Float64", "Float64MultiArray", "Float32", "Float32MultiArray", "Int32"),
            *("Int16", "UInt16", "UInt32"),
        )
    },
    "geometry_msgs/msg/Vector3Stamped": f"{_OTHER_TYPE}WrenchStamped or PoseStamped",
    "geometry_msgs/msg/PointStamped": f"{_OTHER_TYPE}PoseStamped",
    "geometry_msgs/msg/PoseWithCovarianceStamped": f"{_OTHER_TYPE}PoseStamped",
    "nav_msgs/msg/Odometry": f"{_OTHER_TYPE}PoseStamped",
}
"""Types of topics that somebody may take for a sensor, and what is in the way."""
_XYZ = ("x", "y", "z")
SILENT_S = 2.0
"""A sensor that sent nothing for so long is told to be silent."""
_KEPT_WHILE_IDLE = 20_000
_FEWEST_BURSTS = 4
"""Before that, messages that come at once are those of a stall."""


class Stream(NamedTuple):
    """A topic that may be a sensor.

    Attributes:
        topic: its full name.
        kind: wrench, pose, transform, tf or joint; effort for what the joints' motors push.
        rate_hz: messages a second; 0 if none came.
        frame: frame of its messages; of a frame of tf, the one that it is told in.
        child: of a frame of tf, its name.
    """

    topic: str
    kind: str
    rate_hz: float
    frame: str
    child: str = ""

    @property
    def name(self) -> str:
        """How it is called on the command line."""
        return f"{self.topic}:{self.child}" if self.child else self.topic


def find_streams(graph: Graph, seconds: float, patience_s: float = 0.0) -> list[Stream]:
    """Return all topics that may be sensors, with their rates.

    Args:
        graph: where to look.
        seconds: for so long rates are measured.
        patience_s: so long a live force and a live position are waited for: discovery takes
            seconds on a busy machine, and a driver that has just been started sends nothing yet.

    Raises:
        KeyboardInterrupt: if a signal asks to end.
    """
    graph.settle()
    kinds = {WRENCH: "wrench"} | POSITIONS
    counts: dict[str, list[Any]] = {}
    found: dict[str, str] = {}
    subscriptions = []
    searches: list[FrameSearch] = []
    now = time.monotonic()
    latest = now + max(patience_s, seconds)
    end = latest
    complete = False
    while (now := time.monotonic()) < end:
        for name, types in graph.topics():
            if FRAMES in types and not name.endswith("_static"):
                if name not in [search.topic for search in searches]:
                    searches.append(FrameSearch(graph, name, _frame_keeper(name, counts)))
                continue
            interface = next((t for t in types if t in kinds), None)
            if interface is None or name in found or name.endswith(f"/{RECONSTRUCTED_WRENCH}"):
                continue
            found[name] = kinds[interface]
            counts[name] = []
            subscriptions.append(
                graph.node.create_subscription(
                    interface_class(interface), name, _keeper(counts[name]), SAMPLE_QOS
                )
            )
        if not graph.spin(min(0.25, end - now)):
            raise KeyboardInterrupt
        alive = {found[name] for name in found if counts[name]}
        if any(search.heard for search in searches):
            alive.add("tf")
        if not complete and "wrench" in alive and alive & {"tf", *POSITIONS.values()}:
            complete = True
            end = min(latest, time.monotonic()) + seconds
    for subscription in subscriptions:
        graph.node.destroy_subscription(subscription)
    streams = []
    for name, kind in sorted(found.items()):
        heard = counts[name]
        streams.append(Stream(name, kind, _rate(heard), heard[-1].frame if heard else ""))
        if kind == "joint" and any(arrival.has_effort for arrival in heard):
            streams.append(streams[-1]._replace(kind="effort"))
    wrench_frames = [s.frame for s in streams if s.kind == "wrench" and s.rate_hz > 0.0]
    for search in searches:
        search.close()
        for frame, root, mover in search.candidates(wrench_frames):
            rate_hz = _rate(counts.get(f"{search.topic}:{mover}", []))
            streams.append(Stream(search.topic, "tf", rate_hz, root, frame))
    return streams


def unusable(graph: Graph) -> dict[str, str]:
    """Say of topics that look like sensors, by their names, why they cannot be proposed."""
    return {
        name: f"({kind}): {_UNUSABLE[kind]}"
        for name, types in graph.topics()
        for kind in types
        if kind in _UNUSABLE and name != "/tf_static"
    }


class Recorder:
    """Records a force and a position stream into arrays. Use as a context manager."""

    def __init__(self, graph: Graph, force: Stream, position: Stream) -> None:
        self._graph = graph
        self.topics = (force.topic, position.topic)
        self.is_joint = position.kind == "joint"
        self.has_effort = force.kind == "effort"
        self._arrived = [time.monotonic(), time.monotonic()]
        self._subscriptions: list[Any] = []
        self._frames: FrameListener | None = None
        self._force: list[tuple[float, ...]] = []
        self._position: list[tuple[float, ...]] = []
        self._attitudes: list[tuple[float, ...]] = []
        self._names: tuple[str, ...] = ()
        self._origin_ns: int | None = None
        self._clock = ClockListener(graph)
        types = {kind: name for name, kind in POSITIONS.items()}
        read: dict[str, Callable[[Any], tuple[float, ...] | None]] = {
            "pose": lambda m: self._place(m.pose.position, m.pose.orientation),
            "transform": lambda m: self._place(m.transform.translation, m.transform.rotation),
            "joint": self._joints,
        }
        if self.has_effort:  # both are in each message
            self._subscribe(JOINTS, force.topic, self._take_effort)
        else:
            self._subscribe(WRENCH, force.topic, self._taker(0, self._force, _wrench))
            if position.kind == "tf":
                poses = FramePoses(self._take_frame)
                poses.follow(position.child, position.frame)
                self._frames = FrameListener(graph, position.topic, poses)
            else:
                take = self._taker(1, self._position, read[position.kind])
                self._subscribe(types[position.kind], position.topic, take)
        graph.wait_for(lambda: bool(self._force and self._position))

    def _subscribe(self, kind: str, topic: str, take: Callable[[Any], None]) -> None:
        self._subscriptions.append(
            self._graph.node.create_subscription(interface_class(kind), topic, take, SAMPLE_QOS)
        )

    def __enter__(self) -> Recorder:
        return self

    def __exit__(self, *_exception: object) -> None:
        for subscription in self._subscriptions:
            self._graph.node.destroy_subscription(subscription)
        if self._frames is not None:
            self._frames.close()
        self._clock.close()

    def start(self) -> None:
        """Forget what was recorded so far."""
        self._force.clear()
        self._position.clear()
        self._attitudes.clear()
        self._origin_ns = None

    def spin(self, seconds: float, tell: Callable[[float], None] = lambda _left: None) -> None:
        """Record for a while; `tell` hears how many seconds are left.

        Raises:
            KeyboardInterrupt: if a signal asks to end.
        """
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0.0:
            tell(left)
            if not self._graph.spin(min(left, 0.25)):
                raise KeyboardInterrupt

    def idle(self, seconds: float) -> None:
        """Listen while a question waits for its answer: what is old is forgotten."""
        self.spin(seconds)
        for rows in (self._force, self._position, self._attitudes):
            del rows[:-_KEPT_WHILE_IDLE]

    def silent(self, seconds: float = SILENT_S) -> str:
        """Say which sensor has sent nothing for so long; nothing if both send."""
        now = time.monotonic()
        return "; ".join(
            f"{topic} has sent nothing for {now - arrived:.0f} s"
            for topic, arrived in zip(self.topics, self._arrived, strict=True)
            if now - arrived > seconds
        )

    def since(self, force: int, position: int) -> tuple[FloatArray, FloatArray]:
        """Return force [N] and position [mm] after so many rows, shapes (n, components)."""
        forces, places = np.array(self._force[force:]), np.array(self._position[position:])
        return (
            forces[:, 1:] if len(forces) else np.empty((0, 1 if self.has_effort else 3)),
            places[:, 1:] if len(places) else np.empty((0, 1)),
        )

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
        joints = self._names if self.has_effort else ()
        return (
            VectorReadings(force[:, 0], force[:, 1:], joints or _XYZ, bool(joints)),
            VectorReadings(position[:, 0], position[:, 1:], self._names or _XYZ, bool(self._names)),
        )

    def _taker(
        self,
        which: int,
        keep: list[tuple[float, ...]],
        values: Callable[[Any], tuple[float, ...] | None],
    ) -> Callable[[Any], None]:
        def take(message: Any) -> None:
            self._arrived[which] = time.monotonic()
            time_s = self._time_s(nanoseconds_from_stamp(message.header.stamp))
            row = values(message)
            if row is not None:
                keep.append((time_s, *row))

        return take

    def _time_s(self, stamp_ns: int) -> float:
        """Return the time since the first reading."""
        self._clock.stamped(stamp_ns)
        if self._origin_ns is None:
            self._origin_ns = stamp_ns
        return (stamp_ns - self._origin_ns) * 1e-9

    @property
    def turned_deg(self) -> float:
        """By how much the tool turned; 0 where nothing tells its attitude."""
        return turned_deg(self._attitudes)

    @property
    def follows_clock(self) -> bool:
        """Whether the sensors are stamped by /clock, not by the computer's."""
        return self._clock.is_followed

    def _place(self, point: Any, turned: Any) -> tuple[float, ...]:
        """Return a pose's place, and keep its attitude."""
        self._attitudes.append((turned.x, turned.y, turned.z, turned.w))
        return _mm(point)

    def _take_frame(self, stamp_ns: int, _base: str, place: Any, turned: Any) -> None:
        self._arrived[1] = time.monotonic()
        self._attitudes.append(tuple(turned))
        self._position.append((self._time_s(stamp_ns), *(METRE_IN_MM * c for c in place)))

    def _take_effort(self, message: Any) -> None:
        """Take position and effort of the joints out of one message."""
        self._arrived = [time.monotonic()] * 2
        row = self._joints(message)
        if row is not None and len(message.effort) == len(row):
            time_s = self._time_s(nanoseconds_from_stamp(message.header.stamp))
            self._position.append((time_s, *row))
            self._force.append((time_s, *message.effort))

    def _joints(self, message: Any) -> tuple[float, ...] | None:
        """Return the joints of a message; those of another set than the first are passed over."""
        if not self._names:
            self._names = tuple(message.name)
        if tuple(message.name) != self._names or len(message.position) != len(self._names):
            return None
        return tuple(p * METRE_IN_MM for p in message.position)


class _Arrival(NamedTuple):
    """A message that came: when, its stamp (both [s]), its frame, whether it tells an effort."""

    arrived_s: float
    stamp_s: float
    frame: str
    has_effort: bool


def _keeper(keep: list[Any]) -> Callable[[Any], None]:
    """Return what keeps an arrival for each message."""

    def take(message: Any) -> None:
        has_effort = len(getattr(message, "effort", ())) > 0
        keep.append(_arrival(message.header.stamp, str(message.header.frame_id), has_effort))

    return take


def _frame_keeper(topic: str, counts: dict[str, list[Any]]) -> Callable[[str, Any], None]:
    """Return what keeps an arrival for each transform, by the name of its frame."""

    def take(frame: str, stamp: Any) -> None:
        counts.setdefault(f"{topic}:{frame}", []).append(_arrival(stamp, "", False))

    return take


def _arrival(stamp: Any, frame: str, has_effort: bool) -> _Arrival:
    return _Arrival(time.monotonic(), nanoseconds_from_stamp(stamp) * 1e-9, frame, has_effort)


def _rate(heard: list[_Arrival]) -> float:
    """Return the rate [Hz] of a sensor: by its stamps, by arrivals where it stamps nothing.

    Messages that a busy machine hands out late come in one go: their arrivals tell its own rate.
    """
    for times in ([a.stamp_s for a in heard], [a.arrived_s for a in heard]):
        steps = np.diff(times)
        if 2 * np.count_nonzero(steps > 0.0) > len(heard):
            # Of bursts, from the beginning of one to that of another.
            pause = np.sort(steps)[-min(_FEWEST_BURSTS, len(steps))]
            begun = np.flatnonzero(steps > 0.5 * pause) + 1
            if np.mean(steps < INSTANT * pause) > TOGETHER and len(begun) > 1:
                return float((begun[-1] - begun[0]) / (times[begun[-1]] - times[begun[0]]))
            return float(1.0 / np.median(steps[steps > 0.0]))
    return float(bool(heard))


def _wrench(message: Any) -> tuple[float, ...]:
    force = message.wrench.force
    return force.x, force.y, force.z


def _mm(point: Any) -> tuple[float, ...]:
    return point.x * METRE_IN_MM, point.y * METRE_IN_MM, point.z * METRE_IN_MM
