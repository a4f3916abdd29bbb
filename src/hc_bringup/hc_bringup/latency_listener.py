"""A subscriber of hc/estimate, or hc/estimates, for a measurement, in a process of its own.

Usage: python -m hc_bringup.latency_listener FILE [arrays]. Says `ready` once it listens; takes
what has come some fifty times a second, without waking for every message; when its input is
closed it writes to FILE (.npz) the sequence of every estimate, its latency as the estimator told
it [s] and the time from the sample's stamp to the arrival of the message [s].
"""

from __future__ import annotations

import sys
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from numpy.typing import NDArray
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from hc_bringup.dashboard.parsing import EstimatesParser, RecordParser
from hc_bringup.dashboard.taps import Arrival, Taps
from hc_logger.type_names import ESTIMATE_TYPE, ESTIMATES_TYPE
from hc_msgs_py import realtime
from hc_msgs_py.middleware import set_defaults
from hc_msgs_py.topics import ESTIMATE, ESTIMATES

PERIOD_S = 0.02


class Collection:
    """Estimates that arrived."""

    def __init__(self, *, arrays: bool) -> None:
        self._parser = EstimatesParser() if arrays else RecordParser(ESTIMATE_TYPE)
        self._parts: list[tuple[NDArray[Any], ...]] = []

    def add(self, arrivals: list[Arrival]) -> None:
        """Take in what came."""
        table, stamps = self._parser.parse(arrivals)
        received = np.array([arrival.received_ns for arrival in arrivals], np.int64)
        if isinstance(self._parser, EstimatesParser):
            received = np.repeat(received, self._parser.counts)
        self._parts.append(
            (table["sequence"].copy(), table["latency"].copy(), (received - stamps) * 1e-9)
        )

    def save(self, file: Path) -> None:
        """Write all that came."""
        columns = [np.concatenate(part) for part in zip(*self._parts, strict=True)]
        sequence, latency, arrival = columns or [np.empty(0)] * 3
        np.savez(file, sequence=sequence, latency=latency, arrival=arrival)


def main() -> int:
    """Listen until the input is closed; returns the exit status."""
    file = Path(sys.argv[1])
    closed = threading.Event()

    def wait_for_end() -> None:
        sys.stdin.read()
        closed.set()

    set_defaults()
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    node = Node("latency_listener", enable_rosout=False, start_parameter_services=False)
    arrays = "arrays" in sys.argv[2:]
    taps, collection = Taps(node), Collection(arrays=arrays)
    topic, kind = (ESTIMATES, ESTIMATES_TYPE) if arrays else (ESTIMATE, ESTIMATE_TYPE)
    taps.acquire(node.resolve_topic_name(topic), kind, collection.add, local=False)
    threading.Thread(target=wait_for_end, daemon=True).start()
    realtime.enter(below=1)  # who only looks must not hold up what is measured
    print("ready", flush=True)
    while not closed.is_set():
        time.sleep(PERIOD_S)
        taps.drain()
    taps.drain()
    collection.save(file)
    node.destroy_node()
    rclpy.try_shutdown()
    return 0


if __name__ == "__main__":
    sys.exit(main())
