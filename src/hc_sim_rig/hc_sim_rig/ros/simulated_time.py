"""Simulated time for the nodes around the rig: /clock, and waiting for the estimator in lockstep.

Used by node.py when its parameter `time` is not `system`. Other nodes follow with use_sim_time.
"""

from __future__ import annotations

import threading
import time
from typing import Any

from hc_msgs.msg import HuntCrossleyEstimate, HuntCrossleyEstimates
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock as ClockMessage

from hc_msgs_py.estimates_reader import EstimatesReader
from hc_msgs_py.qos import ESTIMATE_QOS
from hc_msgs_py.topics import ESTIMATE, ESTIMATES
from hc_msgs_py.units import NANOSECONDS, set_stamp

CLOCK_QOS = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)
CLOCK_HZ = 200.0
"""Ticks of /clock per simulated second when it runs at a pace (in lockstep: one per sample)."""


class SimulatedTime:
    """Publishes /clock, sample by sample, and in lockstep waits for each sample's estimate."""

    def __init__(self, node: Node, rate_hz: float, lockstep: bool, timeout_s: float) -> None:
        """Begin at the present time.

        Args:
            node: the node that publishes.
            rate_hz: samples per simulated second [Hz].
            lockstep: wait for the estimate of each sample before the next one.
            timeout_s: how long to wait for it (wall time) [s].
        """
        self._period_ns = NANOSECONDS / rate_hz
        self._timeout_s = timeout_s
        self._tick = 1 if lockstep else max(1, round(rate_hz / CLOCK_HZ))
        # Not the node's own clock, which may be the one that is made here.
        self._origin_ns = time.time_ns()
        self._message = ClockMessage()
        self._publisher = node.create_publisher(ClockMessage, "/clock", CLOCK_QOS)
        self._answer = threading.Event()
        self._awaited = -1
        self._alone = False  # the last answer did not come: wait only while somebody could answer
        self._closing = False
        self.timeouts = 0
        self._subscription = None
        self._arrays = EstimatesReader()
        if lockstep:
            self._subscription = node.create_subscription(
                HuntCrossleyEstimate, ESTIMATE, self._on_estimate, ESTIMATE_QOS
            )
            node.create_subscription(
                HuntCrossleyEstimates, ESTIMATES, self._on_estimates, ESTIMATE_QOS, raw=True
            )
        wall = Clock(clock_type=ClockType.STEADY_TIME)
        self._waiting = node.create_timer(0.1, self._publish_origin, clock=wall)

    def _publish_origin(self) -> None:
        """Show the time at which everything begins until the first sample is taken."""
        set_stamp(self._message.clock, self._origin_ns)
        self._publisher.publish(self._message)

    def _on_estimate(self, message: Any) -> None:
        if message.sequence >= self._awaited:
            self._answer.set()

    def _on_estimates(self, data: bytes) -> None:
        for estimate in self._arrays.read(data):
            self._on_estimate(estimate)

    @property
    def undecodable(self) -> int:
        """Messages on hc/estimates that were none."""
        return self._arrays.undecodable

    def begin(self) -> None:
        """Stop showing the origin: samples move the clock from now on."""
        self._waiting.cancel()

    def missing(self) -> list[str]:
        """Return who is not there yet, for ~/ready."""
        if self._subscription is not None and self._subscription.get_publisher_count() == 0:
            return [f"{ESTIMATE} has no publisher, which lockstep waits for"]
        return []

    def move_to(self, sequence: int) -> int:
        """Move the clock to a sample and return its stamp [ns]."""
        stamp_ns: int = self._origin_ns + round(sequence * self._period_ns)
        if sequence % self._tick == 0:
            set_stamp(self._message.clock, stamp_ns)
            self._publisher.publish(self._message)
        self._awaited = sequence
        self._answer.clear()
        return stamp_ns

    def wait(self) -> None:
        """In lockstep, wait for the estimate of the sample that was just published."""
        if self._subscription is None or self._closing:
            return
        if self._alone and self.missing():
            return
        self._alone = not self._answer.wait(self._timeout_s)
        self.timeouts += self._alone

    def close(self) -> None:
        """Wait for nobody any more."""
        self._closing = True
        self._answer.set()
