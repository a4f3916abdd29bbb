"""Where the tip of the tool was sideways, as a bag tells it.

The rig says it on a topic of its own. A robot has a pose, or frames of /tf of which one is the
tool's; one component of it is the depth: the other two are sideways.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hc_bringup.errors import WRONG_USE, UserError
from hc_estimator.stream.contact_frame import Quaternion, Vector
from hc_logger.bag import Bag
from hc_logger.bag_frames import Frame, candidates, poses_of
from hc_logger.bag_sensors import moving_topics
from hc_logger.layout import REAL, records, stamps
from hc_logger.recording import Recording
from hc_logger.selection import full_name
from hc_logger.transforms import of_one_frame
from hc_logger.type_names import FRAMES_TYPE, POSE_TYPE, TRANSFORM_TYPE
from hc_msgs_py.topics import TIP
from hc_msgs_py.units import METRE_IN_MM, nanoseconds_from_stamp

Array = NDArray[np.float64]

TIP_FIELDS: Final = {
    "geometry_msgs/msg/PointStamped": "point.",
    POSE_TYPE: "pose.position.",
}
_KINDS: Final = (*TIP_FIELDS, TRANSFORM_TYPE, FRAMES_TYPE)
IS_DEPTH: Final = 0.999
"""Correlation of a component of a pose with the depth from which on it is the depth: one along an
oblique direction has other components that move with it."""
FEWEST: Final = 20


class TipPath(NamedTuple):
    """Where the tip was sideways.

    Attributes:
        time_s: times [s] of the run, (n,).
        position_mm: (n, 2).
        axes: which components of the positions that a bag tells these are, in this order.
    """

    time_s: Array
    position_mm: Array
    axes: str = "xy"


class TipSource(NamedTuple):
    """Where a bag has the tip's position.

    Attributes:
        topic: its topic; empty takes the rig's, or the bag's only pose, transform or frames; of
            frames the tool's may stand behind a colon (/tf:tool0).
        axes: its two components that are sideways.
    """

    topic: str = ""
    axes: str = "xy"

    @property
    def frame(self) -> str:
        """The tool's frame; empty takes the likeliest one."""
        return self.topic.partition(":")[2]


def tip_of(bag: Bag, recording: Recording, source: TipSource | None) -> TipPath | None:
    """Return where the tip was, None if the bag does not tell.

    Args:
        bag: open.
        recording: what was read of it.
        source: where the position is; None takes the rig's topic, or the only pose of which one
            component is the depth.

    Raises:
        UserError: if a topic was asked for that does not hold it.
        BagError: if it is damaged.
    """
    name = source.topic.partition(":")[0] if source is not None and source.topic else TIP
    topic = bag.topics.get(full_name(name, bag.namespace)) or bag.topics.get(full_name(name))
    if topic is None and name == TIP:
        if source is None:
            source = _pose_with_depth(bag, recording)
        elif len(poses := _poses(bag)) == 1:
            source = source._replace(topic=poses[0])
        if source is None:
            return None
        topic = bag.topics.get(source.topic.partition(":")[0])
    if topic is None or topic.definition.name not in _KINDS:
        if source is not None:
            kinds = " or ".join(kind.split("/")[-1] for kind in _KINDS)
            raise UserError(f"{bag.path} has no {kinds} on {full_name(name)}", WRONG_USE)
        return None
    source = source or TipSource()
    return _path(bag, recording, topic.name, source.axes, source.frame)


def _poses(bag: Bag) -> list[str]:
    """Return the topics of poses; where there is none, those of transforms, else of frames."""
    poses, transforms = (
        [t.name for t in bag.topics.values() if t.definition.name == kind]
        for kind in (POSE_TYPE, TRANSFORM_TYPE)
    )
    return poses or transforms or moving_topics(bag)


def _pose_with_depth(bag: Bag, recording: Recording) -> TipSource | None:
    """Return the bag's only pose, if it has one, and which of its components are sideways.

    Of frames it is the likeliest one of which a component is the depth: those that hang together
    rigidly differ by a constant only.
    """
    poses = _poses(bag)
    if len(poses) != 1:
        return None
    frames = [""]
    if bag.topics[poses[0]].definition.name == FRAMES_TYPE:
        frames = [frame.name for frame in candidates(bag, poses[0])]
    for frame in frames:
        path = _path(bag, recording, poses[0], "xyz", frame)
        sideways = _sideways(path, recording) if path is not None else ""
        if sideways:
            return TipSource(f"{poses[0]}:{frame}" if frame else poses[0], sideways)
    return None


def _sideways(path: TipPath, recording: Recording) -> str:
    """Return the two components of a path beside the one that is the depth; empty if none is."""
    known = np.flatnonzero(np.isfinite(recording.displacement_mm))
    order = np.argsort(path.time_s, kind="stable")
    times = recording.time_s[known] - recording.time_s[0]
    inside = (times >= path.time_s[order[0]]) & (times <= path.time_s[order[-1]])
    if np.count_nonzero(inside) < FEWEST:
        return ""
    depth = recording.displacement_mm[known][inside]
    moved = [
        np.interp(times[inside], path.time_s[order], column[order]) for column in path.position_mm.T
    ]
    related = [
        abs(float(np.corrcoef(column, depth)[0, 1]))
        if np.ptp(column) > 0.0 < np.ptp(depth)
        else 0.0
        for column in moved
    ]
    best = int(np.argmax(related))
    return "xyz".replace("xyz"[best], "") if related[best] > IS_DEPTH else ""


def _path(bag: Bag, recording: Recording, name: str, axes: str, frame: str = "") -> TipPath | None:
    """Return components of the positions on a topic; None without one.

    None for transforms of several frames too: which is the tool's, they do not say.
    """
    definition = bag.topics[name].definition
    if definition.name == FRAMES_TYPE:
        return _path_in_tree(bag, recording, name, axes, frame)
    if definition.name == TRANSFORM_TYPE:
        return _path_of_frame(bag, recording, name, axes)
    fields = [TIP_FIELDS[definition.name] + axis for axis in axes]
    table = records(definition, bag.columns(name), dict.fromkeys(fields, REAL))
    if not len(table):
        return None
    position = np.column_stack([table[field] for field in fields])
    times = (stamps(table) - int(recording.stamps[0])) * 1e-9
    return TipPath(np.asarray(times, np.float64), np.float64(METRE_IN_MM) * position, axes)


def _path_in_tree(
    bag: Bag, recording: Recording, name: str, axes: str, wanted: str
) -> TipPath | None:
    """Return components of the positions of a frame of tf in its root; the likeliest one's.

    Raises:
        UserError: if one was asked for that cannot be the tool's.
    """
    frames = candidates(bag, name)
    found = next((frame for frame in frames if wanted in ("", frame.name)), None)
    if found is None and wanted:
        there = ", ".join(f"{name}:{frame.name}" for frame in frames) or "no frame moves"
        raise UserError(f"{bag.path}: {wanted} is no tool's frame of {name} ({there})", WRONG_USE)
    return None if found is None else _path_of_tool(bag, recording, name, axes, found)


def _path_of_tool(
    bag: Bag, recording: Recording, name: str, axes: str, frame: Frame
) -> TipPath | None:
    """Return components of the positions of a frame of tf."""
    poses: list[tuple[int, Vector]] = []

    def keep(stamp_ns: int, _base: str, place: Vector, _turned: Quaternion) -> None:
        poses.append((stamp_ns, place))

    take = poses_of(bag, name, frame, keep)
    for message in bag.messages({name}):
        take(message.data)
    if not poses:
        return None
    times = (np.array([stamp for stamp, _ in poses], np.int64) - int(recording.stamps[0])) * 1e-9
    places = np.array([place for _, place in poses], np.float64)
    position_mm = np.float64(METRE_IN_MM) * places[:, ["xyz".index(axis) for axis in axes]]
    return TipPath(np.asarray(times, np.float64), position_mm, axes)


def _path_of_frame(bag: Bag, recording: Recording, name: str, axes: str) -> TipPath | None:
    """Return components of the positions of the only frame that a topic of transforms tells."""
    messages = of_one_frame(bag, name)
    if not messages:
        return None
    stamp_ns = np.array([nanoseconds_from_stamp(m.header.stamp) for m in messages], np.int64)
    places = [[getattr(m.transform.translation, axis) for axis in axes] for m in messages]
    times = (stamp_ns - int(recording.stamps[0])) * 1e-9
    position_mm = np.float64(METRE_IN_MM) * np.array(places, np.float64)
    return TipPath(np.asarray(times, np.float64), position_mm, axes)
