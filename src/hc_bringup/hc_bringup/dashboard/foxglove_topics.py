"""The topics of the graph for programs that speak the Foxglove protocol; in the node's thread."""

from __future__ import annotations

import time
from functools import partial
from typing import Final

from rclpy.node import Node

from hc_bringup.dashboard.foxglove import Channel, FoxgloveServer
from hc_bringup.dashboard.server import DashboardServer
from hc_bringup.dashboard.taps import Arrival, Take, Taps
from hc_logger.definitions import installed_definition
from hc_msgs_py.interface_class import UnknownInterfaceError

LOOK_PERIOD_S: Final = 1.0
LEFT_OUT: Final = ("/parameter_events", "/rosout")


class FoxgloveTopics:
    """Keeps the channels equal to the graph, and taps what somebody is subscribed to."""

    def __init__(self, node: Node, taps: Taps) -> None:
        self._node, self._taps = node, taps
        self._wanted: frozenset[int] = frozenset()
        self._numbers: dict[tuple[str, str], int] = {}
        self._channels: dict[int, Channel] = {}
        self._unknown: set[str] = set()
        self._tapped: dict[int, tuple[str, Take]] = {}
        self._next_look = 0.0

    def want(self, numbers: frozenset[int]) -> None:
        """Take note of what somebody is subscribed to; called in the server's thread."""
        self._wanted = numbers

    def tick(self, server: DashboardServer, foxglove: FoxgloveServer) -> None:
        """Look at the graph now and then, and begin or end to listen."""
        now = time.monotonic()
        if now >= self._next_look:
            self._next_look = now + LOOK_PERIOD_S
            channels = self._look()
            if channels != self._channels:
                self._channels = channels
                server.call(foxglove.set_channels, list(channels.values()))
        wanted = self._wanted & self._channels.keys()
        for number in self._tapped.keys() - wanted:
            self._taps.release(*self._tapped.pop(number))
        for number in wanted - self._tapped.keys():
            channel = self._channels[number]
            take = partial(_hand_over, server, foxglove, number)
            self._taps.acquire(channel.topic, channel.type_name, take)
            self._tapped[number] = (channel.topic, take)

    def _look(self) -> dict[int, Channel]:
        """Return the channels by number; a topic keeps its number when it comes back."""
        channels = {}
        for topic, types in self._node.get_topic_names_and_types():
            hidden = any(part.startswith("_") for part in topic.split("/"))
            if hidden or topic in LEFT_OUT or len(types) != 1 or types[0] in self._unknown:
                continue
            if not self._taps.publishers(topic):
                continue
            try:
                schema = installed_definition(types[0]).text
            except UnknownInterfaceError:
                self._unknown.add(types[0])  # a type of others that is not installed here
                continue
            number = self._numbers.setdefault((topic, types[0]), len(self._numbers) + 1)
            channels[number] = Channel(number, topic, types[0], schema)
        return channels


def _hand_over(
    server: DashboardServer, foxglove: FoxgloveServer, number: int, arrivals: list[Arrival]
) -> None:
    server.call(foxglove.deliver, number, arrivals)
