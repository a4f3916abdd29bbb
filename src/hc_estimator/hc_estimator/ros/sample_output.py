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

AS_OF_ESTIMATES: Final = -1
"""Subscribers of samples: one, where those of estimates are expected."""
LONGEST_WAIT_S: Final = 5.0
"""From the first reading on; then the estimator begins, listened to or not."""


class SampleOutput:
    """Publisher of samples; `begin` says from when on they are to be handed on."""

    def __init__(self, node: Node, values: Mapping[str, Any]) -> None:
        """Make the publisher if the settings ask for one."""
        self._node = node
        self._encoder = SampleEncoder()
        self._expected = int(values["expected_estimate_subscribers"])
        wanted = int(values["expected_sample_subscribers"])
        self._wanted = min(1, self._expected) if wanted == AS_OF_ESTIMATES else wanted
        self._waits_when_ready = wanted > 0
        self._estimate = ESTIMATES if values["output.estimates"] == "arrays" else ESTIMATE
        self._publisher = None
        if values["input.publish_samples"]:
            self._publisher = node.create_publisher(IndenterSample, SAMPLE, SAMPLE_PUBLISHER_QOS)
        self._begun = self._publisher is None or self._expected == self._wanted == 0
        self._first_s: float | None = None

    def begin(self) -> bool:
        """Return whether whoever is expected listens by now, or was waited for long enough."""
        if self._begun:
            return True
        now = time.monotonic()
        self._first_s = now if self._first_s is None else self._first_s
        self._begun = now - self._first_s > LONGEST_WAIT_S or (
            self._publisher is not None
            and self._publisher.get_subscription_count() >= self._wanted
            and self._node.count_subscribers(self._estimate) >= self._expected
        )
        return self._begun

    def missing(self) -> list[str]:
        """Return which subscribers of samples are not there that ~/ready is to wait for."""
        if self._publisher is None or not self._waits_when_ready:
            return []
        found = self._publisher.get_subscription_count()
        return (
            [f"{SAMPLE} has {found} of {self._wanted} subscribers"] if found < self._wanted else []
        )

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
