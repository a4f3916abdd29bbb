"""What one side of the rig takes from the other: the newest, and nothing that is none."""

from __future__ import annotations

import math
from typing import Any

from geometry_msgs.msg import WrenchStamped
from sensor_msgs.msg import JointState

from hc_msgs_py.units import set_stamp
from hc_sim_rig.ros.remote_side import ANOTHER_CLOCK, RemoteSide

MS = 1_000_000
HOUR = 3600 * 10**9


class FakeRig:
    def __init__(self, side: str) -> None:
        self.side = side
        self.values: list[float] = []

    def receive(self, value: float) -> None:
        self.values.append(value)


class FakeNode:
    def create_subscription(self, kind: Any, topic: str, handler: Any, qos: Any) -> Any:
        self.handler = handler


def remote(side: str) -> tuple[Any, FakeRig, RemoteSide]:
    node, rig = FakeNode(), FakeRig(side)
    one = RemoteSide(node, rig, "")  # type: ignore[arg-type]
    return node.handler, rig, one


def joints(at_ns: int, names: list[str], positions: list[float]) -> JointState:
    message = JointState(name=names, position=positions)
    set_stamp(message.header.stamp, at_ns)
    return message


def wrench(at_ns: int, force_n: float) -> WrenchStamped:
    message = WrenchStamped()
    message.wrench.force.z = force_n
    set_stamp(message.header.stamp, at_ns)
    return message


def test_joint_states_without_a_position_of_the_master_are_left_out() -> None:
    """Regression: names without positions ended the node; others' joints hid the master's."""
    take, rig, side = remote("slave")
    take(joints(5 * MS, ["master"], []))
    take(joints(9 * MS, ["elbow"], [0.1]))
    take(joints(6 * MS, ["elbow", "master"], [0.1]))
    take(joints(6 * MS, ["elbow", "master"], [0.1, 0.002]))
    take(joints(7 * MS, ["master"], [math.nan]))
    assert rig.values == [2.0]
    assert (side.received, side.overtaken) == (2, 0)


def test_what_was_overtaken_is_left_out_and_counted() -> None:
    take, rig, side = remote("master")
    for at in (10, 12, 11, 11, 14, 13, 15):
        take(wrench(at * MS, float(at)))
    assert rig.values == [10.0, 12.0, 14.0, 15.0]
    assert side.overtaken == 3


def test_a_clock_that_was_set_back_is_followed() -> None:
    """Regression: a side that was started again after that was not heard for an hour."""
    take, rig, side = remote("master")
    for k in range(10):
        take(wrench(HOUR + k * MS, 1.0))
    for k in range(200):
        take(wrench(k * MS, 2.0))
    assert rig.values == [1.0] * 10 + [2.0] * (201 - ANOTHER_CLOCK)
    assert side.overtaken == ANOTHER_CLOCK - 1
    for k in range(200):  # in the wrong order they are no clock
        take(wrench((150 - k // 2) * MS, 3.0))
    assert 3.0 not in rig.values
