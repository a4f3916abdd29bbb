"""Samples that are taken and made into bytes some milliseconds before they are due.

One call of the compiled rig serves several samples, one more fills their messages for all topics
(message_kernel.py), and at its deadline a sample has only to be published. What else belongs to
them goes out after the last of them, if none but a recorder listens (ros/outputs.py).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from geometry_msgs.msg import PointStamped, WrenchStamped
from hc_msgs.msg import IndenterSample, IndenterTruth
from numpy.typing import NDArray
from sensor_msgs.msg import JointState

from hc_msgs_py.topics import FRAME_INDENTER_TIP, JOINT_STATES, SAMPLE, TRUTH, WRENCH
from hc_msgs_py.wire_many import PatternMessages, Records, StampedMessages
from hc_sim_rig.layout import OUT_COLUMNS
from hc_sim_rig.message_kernel import fill_messages, fill_tips

AHEAD_S = 0.005
"""A setting that is changed takes so long to hold, at the most."""
MOST_AHEAD = 8
"""Messages of samples; the others go out in one piece, which must not delay the next sample."""

FRAME_STAGE = "stage"
"""Of the tip's position: x sideways, z up."""
JOINT_NAMES = ("master", "slave")
TIP_EVERY = 10
"""Samples between two positions of the tip: sideways it is slow."""

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


class RowsEncoder:
    """Makes messages of the compiled rig's rows."""

    def __init__(self) -> None:
        self._records: dict[str, Records] = {
            SAMPLE: StampedMessages(IndenterSample),
            TRUTH: StampedMessages(IndenterTruth),
            WRENCH: PatternMessages(1, _wrench),
            JOINT_STATES: PatternMessages(6, _joints),
        }
        self._tips = PatternMessages(2, _tip)
        self._places = np.empty(0, np.int64)

    def encode(
        self,
        stamps_ns: NDArray[np.int64],
        first_sequence: int,
        rows: NDArray[np.float64],
        topics: Collection[str],
    ) -> dict[str, list[bytes]]:
        """Return a message of each sample for each topic.

        Args:
            stamps_ns: of the samples [ns], shape (n,).
            first_sequence: of the first one.
            rows: what the rig gives, shape (n, OUT_COLUMNS).
            topics: those of IndenterSample, IndenterTruth, WrenchStamped and JointState that are
                wanted.
        """
        count = len(rows)
        tables = [
            records.table(count if topic in topics else 0)
            for topic, records in self._records.items()
        ]
        fill_messages(rows, stamps_ns, first_sequence, *tables)
        return {topic: self._records[topic].messages(count) for topic in topics}

    def tips(
        self, stamps_ns: NDArray[np.int64], first: int, rows: NDArray[np.float64]
    ) -> Iterable[tuple[int, bytes]]:
        """Return the index of some samples with the position of the tip, a PointStamped.

        Args:
            stamps_ns: of the samples [ns], shape (n,).
            first: number of the first sample among all of the rig.
            rows: what the rig gives, shape (n, OUT_COLUMNS).
        """
        if len(self._places) != len(rows):
            self._places = np.empty(len(rows), np.int64)
        table, places = self._tips.table(len(rows)), self._places
        count = fill_tips(rows, stamps_ns, first, TIP_EVERY, table, places)
        return zip(places[:count].tolist(), self._tips.messages(count), strict=True)

    def warm_up(self) -> None:
        """Compile the kernels, or load them from the cache."""
        rows, stamps_ns = np.zeros((1, OUT_COLUMNS)), np.zeros(1, np.int64)
        self.encode(stamps_ns, 0, rows, self._records)
        self.tips(stamps_ns, 0, rows)


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


def _joints(numbers: Sequence[float]) -> JointState:
    message = JointState(name=list(JOINT_NAMES))
    message.position, message.velocity, message.effort = numbers[:2], numbers[2:4], numbers[4:]
    return message
