"""The other side of a teleoperation on another host: what arrives from it goes to the rig.

The slave listens to the master's joint states, the master to the wrench that the slave's sensor
reads: both are topics that the nodes publish anyway. Stamps serve as sequence numbers.
"""

from __future__ import annotations

import math
from typing import Any

from geometry_msgs.msg import WrenchStamped
from rclpy.node import Node
from sensor_msgs.msg import JointState

from hc_msgs_py.qos import SAMPLE_QOS
from hc_msgs_py.topics import JOINT_STATES, WRENCH
from hc_msgs_py.units import METRE_IN_MM, nanoseconds_from_stamp
from hc_sim_rig.rig import Rig

ANOTHER_CLOCK = 50
"""So many messages in a row whose stamps rise, all before the newest, are of a clock set back."""
DEFAULT_TOPICS = {"master": f"/slave/{WRENCH}", "slave": f"/master/{JOINT_STATES}"}


class RemoteSide:
    """Feeds one side of a teleoperation with what the other side sends."""

    def __init__(self, node: Node, rig: Rig, topic: str) -> None:
        """Subscribe to the other side.

        Args:
            node: the node of this side.
            rig: the rig of this side.
            topic: where the other side publishes; empty for DEFAULT_TOPICS.
        """
        self._rig = rig
        self.topic = topic or DEFAULT_TOPICS[rig.side]
        kind, handler = (
            (WrenchStamped, self._on_wrench)
            if rig.side == "master"
            else (JointState, self._on_joints)
        )
        self._newest_ns = self._earlier_ns = -1
        self._earlier = 0
        self.received = 0
        self.overtaken = 0
        self._subscription = node.create_subscription(kind, self.topic, handler, SAMPLE_QOS)

    def missing(self) -> list[str]:
        """Return who is not there yet, for ~/ready."""
        if self._subscription.get_publisher_count() == 0:
            return [f"{self.topic} has no publisher (the other side)"]
        return []

    def _is_new(self, message: Any) -> bool:
        """Count a message; whether it is newer than all before, by the clock that counts now."""
        self.received += 1
        stamp_ns = nanoseconds_from_stamp(message.header.stamp)
        if stamp_ns <= self._newest_ns:
            self._earlier = self._earlier + 1 if stamp_ns > self._earlier_ns else 1
            self._earlier_ns = stamp_ns
            if self._earlier < ANOTHER_CLOCK:
                self.overtaken += 1
                return False
        self._newest_ns, self._earlier_ns, self._earlier = stamp_ns, -1, 0
        return True

    def _on_joints(self, message: Any) -> None:
        place = message.name.index("master") if "master" in message.name else len(message.name)
        if place < len(message.position) and self._is_new(message):  # joints of others may be there
            self._take(message.position[place] * METRE_IN_MM)

    def _on_wrench(self, message: Any) -> None:
        if self._is_new(message):
            self._take(message.wrench.force.z)

    def _take(self, value: float) -> None:
        """Give a value to the rig; a reading that is none (a sensor's dropout) is left out."""
        if math.isfinite(value):
            self._rig.receive(value)
