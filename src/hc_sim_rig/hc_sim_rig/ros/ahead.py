"""Samples that are taken and made into bytes some milliseconds before they are due.

One call of the compiled rig and one of each encoder serve several samples, and at its deadline a
sample has only to be published. What else belongs to them goes out after the last of them, if none
but a recorder listens (ros/outputs.py).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from geometry_msgs.msg import PointStamped, WrenchStamped
from hc_msgs.msg import IndenterSample, IndenterTruth
from numpy.typing import NDArray
from sensor_msgs.msg import JointState

from hc_msgs_py.topics import FRAME_INDENTER_TIP
from hc_msgs_py.units import METRE_IN_MM
from hc_msgs_py.wire_many import PatternMessages, StampedMessages
from hc_sim_rig.records import RigSeries

AHEAD_S = 0.005
"""A setting that is changed takes so long to hold, at the most."""
MOST_AHEAD = 8
"""Messages of samples; the others go out in one piece, which must not delay the next sample."""

FRAME_STAGE = "stage"
"""Of the tip's position: x sideways, z up."""

Message = tuple[Any, bytes]
"""A publisher and what it is to send."""


def messages_ahead(rate_hz: float) -> int:
    """Return how many messages of samples are made at once; 1 where it is not worth while."""
    return max(1, min(MOST_AHEAD, round(rate_hz * AHEAD_S)))


class Block(NamedTuple):
    """What some samples have to say.

    Attributes:
        due: for each deadline how many samples there are and the messages to publish then.
        after: messages to publish after the last deadline.
    """

    due: deque[tuple[int, list[Message]]]
    after: list[tuple[Any, list[bytes]]]


class SeriesEncoder:
    """Makes messages of several samples."""

    def __init__(self, joint_names: Sequence[str]) -> None:
        self._samples = StampedMessages(IndenterSample)
        self._truths = StampedMessages(IndenterTruth)
        self._wrenches = PatternMessages(1, _wrench)
        self._tips = PatternMessages(2, _tip)
        self._joints = PatternMessages(6, lambda numbers: _joints(joint_names, numbers))

    def samples(
        self, stamps_ns: NDArray[np.int64], first_sequence: int, series: RigSeries
    ) -> list[bytes]:
        """Return an IndenterSample of each."""
        return self._samples.encode(
            stamps_ns,
            (
                ("sequence", first_sequence + series.sequence),
                ("displacement", series.displacement_mm / METRE_IN_MM),
                ("force", series.force_n),
            ),
        )

    def truths(
        self, stamps_ns: NDArray[np.int64], first_sequence: int, series: RigSeries
    ) -> list[bytes]:
        """Return an IndenterTruth of each."""
        truth = series.truth
        stiffness, damping, displacement_exponent, velocity_exponent = truth.parameters.T
        return self._truths.encode(
            stamps_ns,
            (
                ("sequence", first_sequence + series.sequence),
                ("displacement", truth.displacement_mm / METRE_IN_MM),
                ("velocity", truth.velocity_mm_s / METRE_IN_MM),
                ("force", truth.force_n),
                ("stiffness", stiffness),
                ("damping", damping),
                ("displacement_exponent", displacement_exponent),
                ("velocity_exponent", velocity_exponent),
                ("contact", truth.contact),
            ),
        )

    def wrenches(self, stamps_ns: NDArray[np.int64], series: RigSeries) -> list[bytes]:
        """Return a WrenchStamped of each."""
        return self._wrenches.encode(stamps_ns, (series.force_n,))

    def tips(
        self,
        stamps_ns: NDArray[np.int64],
        lateral_mm: NDArray[np.float64],
        depth_mm: NDArray[np.float64],
    ) -> list[bytes]:
        """Return a PointStamped of each: penetration is negative."""
        return self._tips.encode(stamps_ns, (lateral_mm / METRE_IN_MM, -depth_mm / METRE_IN_MM))

    def joints(self, stamps_ns: NDArray[np.int64], series: RigSeries) -> list[bytes]:
        """Return a JointState of each."""
        both = (series.master, series.slave)
        return self._joints.encode(
            stamps_ns,
            (
                *(joint.position_mm / METRE_IN_MM for joint in both),
                *(joint.velocity_mm_s / METRE_IN_MM for joint in both),
                *(joint.effort_n for joint in both),
            ),
        )


def _wrench(numbers: Sequence[float]) -> WrenchStamped:
    message = WrenchStamped()
    message.header.frame_id = FRAME_INDENTER_TIP
    (message.wrench.force.z,) = numbers
    return message


def _tip(numbers: Sequence[float]) -> PointStamped:
    message = PointStamped()
    message.header.frame_id = FRAME_STAGE
    message.point.x, message.point.z = numbers
    return message


def _joints(names: Sequence[str], numbers: Sequence[float]) -> JointState:
    message = JointState(name=list(names))
    message.position, message.velocity, message.effort = numbers[:2], numbers[2:4], numbers[4:]
    return message
