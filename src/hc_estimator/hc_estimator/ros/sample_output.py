"""Samples that the node makes of sensors, published on indenter/sample for recorders and plots.

A run whose first samples nobody recorded cannot be computed again from its bag: every estimate goes
back to the first sample. Sensors speak before a recorder has found the topic, so the first sample
waits for those who are expected.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any, Final

from hc_msgs.msg import IndenterSample
from rclpy.node import Node

from hc_msgs_py.qos import SAMPLE_PUBLISHER_QOS
from hc_msgs_py.topics import ESTIMATE, ESTIMATES, SAMPLE
from hc_msgs_py.wire import SampleEncoder

LONGEST_WAIT_S: Final = 5.0
"""From the first reading on; then the estimator begins, listened to or not."""


class SampleOutput:
    """Publisher of samples; `begin` says from when on they are to be handed on."""

    def __init__(self, node: Node, values: Mapping[str, Any]) -> None:
        """Make the publisher if the settings ask for one."""
        self._node = node
        self._encoder = SampleEncoder()
        self._expected = int(values["expected_estimate_subscribers"])
        self._estimate = ESTIMATES if values["output.estimates"] == "arrays" else ESTIMATE
        self._publisher = None
        if values["input.publish_samples"]:
            self._publisher = node.create_publisher(IndenterSample, SAMPLE, SAMPLE_PUBLISHER_QOS)
        self._begun = self._publisher is None or self._expected == 0
        self._first_s: float | None = None

    def begin(self) -> bool:
        """Return whether whoever is expected listens by now, or was waited for long enough."""
        if self._begun:
            return True
        now = time.monotonic()
        self._first_s = now if self._first_s is None else self._first_s
        self._begun = now - self._first_s > LONGEST_WAIT_S or (
            self._publisher is not None
            and self._publisher.get_subscription_count() > 0
            and self._node.count_subscribers(self._estimate) >= self._expected
        )
        return self._begun

    def set_frame(self, frame_id: str) -> None:
        """Name the frame of the samples that are published from now on."""
        self._encoder.set_frame(frame_id)

    def publish(self, stamp_ns: int, sequence: int, displacement_mm: float, force_n: float) -> None:
        """Publish a sample."""
        if self._publisher is not None:
            self._publisher.publish(
                self._encoder.encode(stamp_ns, sequence, displacement_mm, force_n)
            )

    def close(self) -> None:
        """Take the publisher away."""
        if self._publisher is not None:
            self._node.destroy_publisher(self._publisher)
            self._publisher = None
