"""By how much a tool turned: of a node that runs by its topic of poses, and of a bag by its own."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from hc_bringup.frame_streams import FrameListener
from hc_bringup.graph import Graph
from hc_bringup.robot_streams import POSITIONS
from hc_bringup.turning import turned_deg
from hc_estimator.stream.frame_poses import FramePoses
from hc_logger.foreign import open_bag
from hc_logger.layout import REAL, records
from hc_logger.selection import full_name
from hc_logger.type_names import POSE_TYPE
from hc_msgs_py.interface_class import interface_class
from hc_msgs_py.qos import SAMPLE_QOS

_ATTITUDE: Final = [f"pose.orientation.{component}" for component in "xyzw"]


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


def bag_turn_deg(path: str | os.PathLike[str], topic: str = "") -> float:
    """Return by how much the tool of a bag turned [degree]; 0 where no single PoseStamped tells it.

    Args:
        path: a bag.
        topic: that of its poses; empty takes the only one.

    Raises:
        BagError: if it cannot be read.
    """
    with open_bag(path) as bag:
        names = [
            one.name
            for one in bag.topics.values()
            if one.definition.name == POSE_TYPE and (not topic or one.name == full_name(topic))
        ]
        if len(names) != 1:
            return 0.0
        definition = bag.topics[names[0]].definition
        table = records(definition, bag.columns(names[0]), dict.fromkeys(_ATTITUDE, REAL))
    return turned_deg(np.column_stack([table[field] for field in _ATTITUDE]))
