"""By how much a tool turned: of a node that runs by its topic of poses, and of a bag by its own."""

from __future__ import annotations

import os
from collections.abc import Mapping
from itertools import islice
from typing import Any, Final

import numpy as np

from hc_bringup.frame_streams import FrameListener
from hc_bringup.graph import Graph
from hc_bringup.robot_streams import POSITIONS
from hc_bringup.turning import turned_deg, turning_line
from hc_estimator.stream.frame_poses import FramePoses
from hc_logger.bag import Bag
from hc_logger.bag_frames import candidates, poses_of
from hc_logger.bag_sensors import moving_topics
from hc_logger.foreign import open_bag
from hc_logger.layout import REAL, records
from hc_logger.selection import full_name
from hc_logger.transforms import of_one_frame
from hc_logger.type_names import POSE_TYPE, TRANSFORM_TYPE
from hc_msgs_py.interface_class import interface_class
from hc_msgs_py.qos import SAMPLE_QOS

_ATTITUDE: Final = [f"pose.orientation.{component}" for component in "xyzw"]
_MOST_MESSAGES: Final = 100_000
"""Of transforms of a bag, which are opened one by one: enough for a tool that turns."""


class TurnWatch:
    """Listens to the attitudes of the tool that a node reads along one axis of its sensors."""

    def __init__(self, graph: Graph, namespace: str, settings: Mapping[str, Any]) -> None:
        """Begin, where there is something to hear.

        Args:
            graph: where the topics are.
            namespace: of the node.
            settings: its input settings, by name below `input.`.
        """
        self._attitudes: list[tuple[float, ...]] = []
        kind = settings.get("position.type")
        topic = settings.get("position.topic", "")
        along_normal = settings.get("contact.frame") == "surface"
        if settings.get("source") != "sensors" or along_normal or not topic:
            return
        topic = full_name(topic, namespace)
        child = settings.get("position.child_frame", "")
        if kind == "tf":
            poses = FramePoses(lambda _ns, _base, _place, turned: self._keep(tuple(turned)))
            poses.follow(child, settings.get("position.base_frame", ""))
            FrameListener(graph, topic, poses)
        elif kind in ("pose", "transform"):
            name = next(name for name, short in POSITIONS.items() if short == kind)

            def take(message: Any) -> None:
                if kind == "transform" and child not in ("", message.child_frame_id):
                    return
                turned = message.pose.orientation if kind == "pose" else message.transform.rotation
                self._keep((turned.x, turned.y, turned.z, turned.w))

            graph.node.create_subscription(interface_class(name), topic, take, SAMPLE_QOS)

    def _keep(self, attitude: tuple[float, ...]) -> None:
        self._attitudes.append(attitude)

    @property
    def degrees(self) -> float:
        """By how much the tool turned; 0 where nothing tells its attitude."""
        return turned_deg(self._attitudes)


def bag_turn_deg(path: str | os.PathLike[str], topic: str = "", child: str = "") -> float:
    """Return by how much the tool of a bag turned [degree]; 0 where it is not told which it is.

    That is told by the only topic of poses or transforms, and else by frames of tf of which one
    alone may be the tool's.

    Args:
        path: a bag.
        topic: that of its poses or transforms; empty takes the only one.
        child: of transforms, the tool's frame; empty takes the only one.

    Raises:
        BagError: if it cannot be read.
    """
    with open_bag(path) as bag:
        kinds = {one.name: one.definition.name for one in bag.topics.values()}
        names = [name for name, kind in kinds.items() if kind in (POSE_TYPE, TRANSFORM_TYPE)]
        if topic:
            names = [name for name in names if name == full_name(topic)]
        if len(names) > 1:
            return 0.0
        if not names:
            return turned_deg(_of_frames(bag)) if not topic else 0.0
        definition = bag.topics[names[0]].definition
        if definition.name == TRANSFORM_TYPE:
            return turned_deg(_of_transforms(bag, names[0], child))
        table = records(definition, bag.columns(names[0]), dict.fromkeys(_ATTITUDE, REAL))
    return turned_deg(np.column_stack([table[field] for field in _ATTITUDE]))


def bag_turning_line(path: str | os.PathLike[str], sensors: Mapping[str, Any]) -> str:
    """Say of a bag that its tool turned, and what to do; empty if it did not.

    Args:
        path: a bag.
        sensors: how it is read, by name below `input.`.

    Raises:
        BagError: if it cannot be read.
    """
    tool = (sensors.get("position.topic", ""), sensors.get("position.child_frame", ""))
    return turning_line(bag_turn_deg(path, *tool))


def _of_transforms(bag: Bag, topic: str, child: str) -> list[tuple[float, ...]]:
    """Return the attitudes of a frame; none where a topic tells several and none is named."""
    found = of_one_frame(bag, topic, child, _MOST_MESSAGES)
    return [(t.x, t.y, t.z, t.w) for t in (message.transform.rotation for message in found)]


def _of_frames(bag: Bag) -> list[tuple[float, ...]]:
    """Return the attitudes of the only frame of tf that may be the tool's; none if it is open."""
    moving = moving_topics(bag)
    frames = candidates(bag, moving[0]) if len(moving) == 1 else []
    if len(frames) != 1:
        return []
    found: list[tuple[float, ...]] = []
    take = poses_of(
        bag, moving[0], frames[0], lambda _ns, _base, _place, turned: found.append(tuple(turned))
    )
    for message in islice(bag.messages({moving[0]}), _MOST_MESSAGES):
        take(message.data)
    return found
