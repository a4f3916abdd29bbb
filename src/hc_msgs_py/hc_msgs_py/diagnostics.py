"""Diagnostics of a node: one status a second on /diagnostics, as an aggregator expects it."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from enum import IntEnum
from typing import Any, NamedTuple

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.node import Node

from hc_msgs_py.qos import DIAGNOSTICS_QOS
from hc_msgs_py.topics import DIAGNOSTICS

PERIOD_S = 1.0
LAST_DELIVERY = Duration(seconds=1.0)
"""How long the last status may take to arrive."""


class Level(IntEnum):
    """Levels of diagnostic_msgs/DiagnosticStatus, which has them as bytes."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


class Status(NamedTuple):
    """What a node has to say of itself."""

    level: Level
    message: str
    values: Mapping[str, Any]


class DiagnosticsPublisher:
    """Publishes a node's status once a second."""

    def __init__(self, node: Node, hardware_id: str, collect: Callable[[], Status]) -> None:
        """Start publishing.

        Args:
            node: the node whose status it is.
            hardware_id: what the status is about, for example the sensor.
            collect: called once a second; returns the status.
        """
        self._node = node
        self._hardware_id = hardware_id
        self._collect = collect
        self._publisher = node.create_publisher(DiagnosticArray, DIAGNOSTICS, DIAGNOSTICS_QOS)
        self._used_s, self._at_s = time.process_time(), time.monotonic()
        # The steady clock: a status is due even while simulated time stands still.
        self._timer = node.create_timer(
            PERIOD_S, self.publish, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )

    def publish_last(self) -> None:
        """Publish the final status and wait until it has arrived, before the node is destroyed."""
        self.publish()
        self._publisher.wait_for_all_acked(LAST_DELIVERY)

    def publish(self) -> None:
        """Collect and publish the status now (the timer does so every second).

        Every node says its processor use since the last status, in percent of a core.
        """
        level, message, values = self._collect()
        used_s, at_s = time.process_time(), time.monotonic()
        if at_s > self._at_s:
            percent = 100.0 * (used_s - self._used_s) / (at_s - self._at_s)
            values = {**values, "cpu_percent": percent}
        self._used_s, self._at_s = used_s, at_s
        status = DiagnosticStatus(
            level=bytes([level]),
            name=self._node.get_name(),
            message=message,
            hardware_id=self._hardware_id,
            values=[KeyValue(key=key, value=_text(value)) for key, value in values.items()],
        )
        array = DiagnosticArray(status=[status])
        array.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(array)


def _text(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)
