"""Where the tip of the tool was sideways, as a bag tells it.

The rig says it on a topic of its own. A robot has a pose, one of whose components is the depth: the
other two are sideways.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hc_bringup.errors import WRONG_USE, UserError
from hc_logger.bag import Bag
from hc_logger.layout import REAL, records, stamps
from hc_logger.recording import Recording
from hc_logger.selection import full_name
from hc_logger.transforms import of_one_frame
from hc_logger.type_names import POSE_TYPE, TRANSFORM_TYPE
from hc_msgs_py.topics import TIP
from hc_msgs_py.units import METRE_IN_MM, nanoseconds_from_stamp

Array = NDArray[np.float64]

TIP_FIELDS: Final = {
    "geometry_msgs/msg/PointStamped": "point.",
    POSE_TYPE: "pose.position.",
}
IS_DEPTH: Final = 0.999
"""Correlation of a component of a pose with the depth from which on it is the depth: one along an
oblique direction has other components that move with it."""
FEWEST: Final = 20


class TipPath(NamedTuple):
    """Where the tip was sideways: times [s] of the run, (n, 2) positions [mm]."""

    time_s: Array
    position_mm: Array


class TipSource(NamedTuple):
    """Where a bag has the tip's position.

    Attributes:
        topic: its topic; empty takes the rig's, or the bag's only pose or transform.
        axes: its two components that are sideways.
    """

    topic: str = ""
    axes: str = "xy"


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
    name = source.topic if source is not None and source.topic else TIP
    topic = bag.topics.get(full_name(name))
    if topic is None and name == TIP:
        if source is None:
            source = _pose_with_depth(bag, recording)
        elif len(poses := _poses(bag)) == 1:
            source = source._replace(topic=poses[0])
        if source is None:
            return None
        topic = bag.topics.get(source.topic)
    if topic is None or topic.definition.name not in (*TIP_FIELDS, TRANSFORM_TYPE):
        if source is not None:
            kinds = " or ".join(kind.split("/")[-1] for kind in (*TIP_FIELDS, TRANSFORM_TYPE))
            raise UserError(f"{bag.path} has no {kinds} on {full_name(name)}", WRONG_USE)
        return None
    return _path(bag, recording, topic.name, (source or TipSource()).axes)


def _poses(bag: Bag) -> list[str]:
    """Return the topics of poses; where there is none, those of transforms."""
    poses, transforms = (
        [t.name for t in bag.topics.values() if t.definition.name == kind]
        for kind in (POSE_TYPE, TRANSFORM_TYPE)
    )
    return poses or transforms


def _pose_with_depth(bag: Bag, recording: Recording) -> TipSource | None:
    """Return the bag's only pose, if it has one, and which of its components are sideways."""
    poses = _poses(bag)
    path = _path(bag, recording, poses[0], "xyz") if len(poses) == 1 else None
    if path is None:
        return None
    known = np.flatnonzero(np.isfinite(recording.displacement_mm))
    order = np.argsort(path.time_s, kind="stable")
    times = recording.time_s[known] - recording.time_s[0]
    inside = (times >= path.time_s[order[0]]) & (times <= path.time_s[order[-1]])
    if np.count_nonzero(inside) < FEWEST:
        return None
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
    if not related[best] > IS_DEPTH:
        return None
    return TipSource(poses[0], "xyz".replace("xyz"[best], ""))


def _path(bag: Bag, recording: Recording, name: str, axes: str) -> TipPath | None:
    """Return components of the positions on a topic; None without one.

    None for transforms of several frames too: which is the tool's, they do not say.
    """
    definition = bag.topics[name].definition
    if definition.name == TRANSFORM_TYPE:
        return _path_of_frame(bag, recording, name, axes)
    fields = [TIP_FIELDS[definition.name] + axis for axis in axes]
    table = records(definition, bag.columns(name), dict.fromkeys(fields, REAL))
    if not len(table):
        return None
    position = np.column_stack([table[field] for field in fields])
    times = (stamps(table) - int(recording.stamps[0])) * 1e-9
    return TipPath(np.asarray(times, np.float64), np.float64(METRE_IN_MM) * position)


def _path_of_frame(bag: Bag, recording: Recording, name: str, axes: str) -> TipPath | None:
    """Return components of the positions of the only frame that a topic of transforms tells."""
    messages = of_one_frame(bag, name)
    if not messages:
        return None
    stamp_ns = np.array([nanoseconds_from_stamp(m.header.stamp) for m in messages], np.int64)
    places = [[getattr(m.transform.translation, axis) for axis in axes] for m in messages]
    times = (stamp_ns - int(recording.stamps[0])) * 1e-9
    position_mm = np.float64(METRE_IN_MM) * np.array(places, np.float64)
    return TipPath(np.asarray(times, np.float64), position_mm)
