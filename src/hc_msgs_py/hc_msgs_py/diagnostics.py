"""Diagnostics of a node: one status a second on /diagnostics, as an aggregator expects it."""

from __future__ import annotations

import math
import struct
import time
from collections.abc import Callable, Mapping
from enum import IntEnum
from typing import Any, NamedTuple

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.node import Node

from hc_msgs_py.cdr import ENCAPSULATION, HEAD
from hc_msgs_py.qos import DIAGNOSTICS_QOS
from hc_msgs_py.topics import DIAGNOSTICS
from hc_msgs_py.units import NANOSECONDS
from hc_msgs_py.wire import publish_bytes

PERIOD_S = 1.0
PATIENCE_S = 0.05
"""So long a status waits for a pause between two samples."""
FEELS = "zeros are looked for"
"""Key of what an estimator feels while it looks for zeros, in words."""
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
    """Publishes a node's status once a second.

    A node whose thread has samples to deal with lets it wait for a pause and do it in two parts:
    what is `due` it does with `go_on`, and what found no pause with `publish_overdue`.
    """

    def __init__(
        self,
        node: Node,
        hardware_id: str,
        collect: Callable[[], Status],
        *,
        in_parts: bool = False,
    ) -> None:
        """Start publishing.

        Args:
            node: the node whose status it is.
            hardware_id: what the status is about, for example the sensor.
            collect: called once a second; returns the status.
            in_parts: leave it to the node to publish what is due.
        """
        self._node = node
        self._hardware_id = hardware_id
        self._collect = collect
        self._publisher = node.create_publisher(DiagnosticArray, DIAGNOSTICS, DIAGNOSTICS_QOS)
        self._used_s, self._at_s = time.process_time(), time.monotonic()
        self._due_since_s: float | None = None
        self._collected: Status | None = None
        # The steady clock: a status is due even while simulated time stands still.
        self._timer = node.create_timer(
            PERIOD_S,
            self._fall_due if in_parts else self.publish,
            clock=Clock(clock_type=ClockType.STEADY_TIME),
        )

    @property
    def due(self) -> bool:
        """Whether a status waits for a pause."""
        return self._due_since_s is not None

    def _fall_due(self) -> None:
        if self._due_since_s is None:
            self._due_since_s = time.monotonic()

    def go_on(self) -> None:
        """Do a part of the status that is due: collect it, and the next time send it."""
        if self._collected is None:
            self._collected = self._collect()
        else:
            self._send(self._collected)

    def publish_overdue(self) -> None:
        """Publish what has been due for a while: nothing comes after which there were a pause."""
        due_since_s = self._due_since_s
        if due_since_s is not None and time.monotonic() - due_since_s > PATIENCE_S:
            while self.due:
                self.go_on()

    def publish_last(self) -> None:
        """Publish the final status and wait until it has arrived, before the node is destroyed."""
        self.publish()
        self._publisher.wait_for_all_acked(LAST_DELIVERY)

    def publish(self) -> None:
        """Collect and publish the status now (the timer does so every second).

        Every node says its processor use since the last status, in percent of a core.
        """
        if self._collected is not None:  # what was counted until then is in it
            self._send(self._collected)
        self._send(self._collect())

    def _send(self, status: Status) -> None:
        self._due_since_s = self._collected = None
        level, message, values = status
        used_s, at_s = time.process_time(), time.monotonic()
        if at_s > self._at_s:
            percent = 100.0 * (used_s - self._used_s) / (at_s - self._at_s)
            values = {**values, "cpu_percent": percent}
        self._used_s, self._at_s = used_s, at_s
        stamp_ns = self._node.get_clock().now().nanoseconds
        name = self._node.get_fully_qualified_name().lstrip("/")  # two may differ in it alone
        texts = (name, message, self._hardware_id)
        publish_bytes(self._publisher, (encode(stamp_ns, level, texts, values),))


def encode(
    stamp_ns: int, level: int, texts: tuple[str, str, str], values: Mapping[str, Any]
) -> bytes:
    """Return a serialised DiagnosticArray of one status.

    As messages, sixty values and the checks of each field took a millisecond of the thread that
    makes the estimates, once a second.

    Args:
        stamp_ns: of the header.
        level: of the status.
        texts: name, message and hardware_id of the status.
        values: its values, by key.
    """
    data = bytearray(ENCAPSULATION)
    data += struct.pack("<iI", *divmod(stamp_ns, NANOSECONDS))
    _add(data, "")  # frame_id
    _align(data)
    data += struct.pack("<IB", 1, level)
    for text in texts:
        _add(data, text)
    _align(data)
    data += struct.pack("<I", len(values))
    for key, value in values.items():
        _add(data, key)
        _add(data, _text(value))
    return bytes(data)


def _align(data: bytearray) -> None:
    data += bytes(-(len(data) - HEAD) % 4)


def _add(data: bytearray, text: str) -> None:
    """Add a text: its length with the closing zero, and its bytes.

    The name of a file, which may hold any bytes, is readable all the same.
    """
    content = text.encode(errors="backslashreplace")
    _align(data)
    data += (len(content) + 1).to_bytes(4, "little")
    data += content
    data += b"\0"


def _text(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def number_said(values: Mapping[str, str], name: str, missing: float = 0.0) -> float:
    """Return a number of a status; `missing` where it says none, or none that is finite.

    A node of somebody else may go by the name of ours, and say anything.
    """
    try:
        number = float(values[name])
    except (KeyError, ValueError):
        return missing
    return number if math.isfinite(number) else missing
