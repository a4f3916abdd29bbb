"""What the suite says once a second or less, for the page: events, contacts, settings, health.

It is listened to whether or not somebody looks, so that a page that is opened has the past.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any, Final

from diagnostic_msgs.msg import DiagnosticArray
from hc_msgs.msg import ContactSummary, EstimatorConfiguration, EstimatorEvent
from rclpy.node import Node
from rclpy.serialization import deserialize_message

from hc_bringup.dashboard.server import DashboardServer
from hc_bringup.dashboard.taps import Arrival, Taps
from hc_msgs_py.conversion import configuration_from_message
from hc_msgs_py.topics import CONFIGURATION, CONTACTS, DIAGNOSTICS, EVENTS
from hc_msgs_py.units import METRE_IN_MM, nanoseconds_from_stamp

MOST_EVENTS: Final = 300
MOST_CONTACTS: Final = 300


class RareMessages:
    """Listens to what comes now and then.

    Attributes:
        diagnostics: the last status of each node by its name, and when it arrived.
        configuration: filter, state space, contact model and revision in force; empty at first.
        settings: all settings of that revision by name.
    """

    def __init__(
        self,
        node: Node,
        taps: Taps,
        server: DashboardServer,
        on_contact: Callable[[dict[str, Any]], None],
    ) -> None:
        """Listen from now on.

        Args:
            node: whose namespace the topics are in.
            taps: its subscriptions.
            server: who shows events and contacts.
            on_contact: gets each contact, as the page gets it.
        """
        self._server, self._on_contact = server, on_contact
        self._own = node.get_namespace().strip("/") + "/"  # nodes of it are called without it
        self.diagnostics: dict[str, dict[str, Any]] = {}
        self.configuration: dict[str, Any] = {}
        self.settings: dict[str, Any] = {}
        self._events: deque[dict[str, Any]] = deque(maxlen=MOST_EVENTS)
        self._contacts: deque[dict[str, Any]] = deque(maxlen=MOST_CONTACTS)
        for topic, type_name, take, local in (
            (EVENTS, "hc_msgs/msg/EstimatorEvent", self._on_events, True),
            (CONTACTS, "hc_msgs/msg/ContactSummary", self._on_contacts, True),
            (CONFIGURATION, "hc_msgs/msg/EstimatorConfiguration", self._on_configurations, True),
            (DIAGNOSTICS, "diagnostic_msgs/msg/DiagnosticArray", self._on_diagnostics, False),
        ):
            taps.acquire(node.resolve_topic_name(topic), type_name, take, depth=100, local=local)

    def forget_node(self, name: str) -> None:
        """Leave out a node that has ended as it was asked to: it is not silent."""
        self.diagnostics.pop(name, None)

    def health(self, now_s: float) -> dict[str, dict[str, Any]]:
        """Level, message, hardware, values and age [s] of each node's last status."""
        return {
            name: {
                "level": status["level"],
                "message": status["message"],
                "hardware": status["hardware"],
                "values": status["values"],
                "age_s": now_s - status["arrived"],
            }
            for name, status in self.diagnostics.items()
        }

    def _on_events(self, arrivals: list[Arrival]) -> None:
        for message in _decoded(arrivals, EstimatorEvent):
            self._events.append(
                {
                    "time": nanoseconds_from_stamp(message.header.stamp) * 1e-9,
                    "kind": message.kind,
                    "sequence": message.sequence,
                    "reason": message.reason,
                }
            )
        self._server.publish_text("events", {"items": list(self._events)})

    def _on_contacts(self, arrivals: list[Arrival]) -> None:
        for message in _decoded(arrivals, ContactSummary):
            contact = _contact(message)
            self._contacts.append(contact)
            self._on_contact(contact)
        self._server.publish_text("contacts", {"items": list(self._contacts)})

    def _on_configurations(self, arrivals: list[Arrival]) -> None:
        for message in _decoded(arrivals, EstimatorConfiguration):
            configuration = configuration_from_message(message)
            self.settings = configuration.parameters
            self.configuration = {
                "filter": configuration.filter,
                "state_space": configuration.state_space,
                "contact_model": configuration.contact_model,
                "revision": configuration.revision,
                "software_version": configuration.software_version,
            }

    def _on_diagnostics(self, arrivals: list[Arrival]) -> None:
        for message in _decoded(arrivals, DiagnosticArray):
            for status in message.status:
                self.diagnostics[status.name.removeprefix(self._own)] = {
                    "level": int.from_bytes(status.level, "little"),
                    "message": status.message,
                    "hardware": status.hardware_id,
                    "values": {item.key: item.value for item in status.values},
                    "arrived": time.monotonic(),
                }


def _decoded(arrivals: Sequence[Arrival], kind: Any) -> list[Any]:
    return [deserialize_message(arrival.data, kind) for arrival in arrivals]


def _contact(message: Any) -> dict[str, Any]:
    return {
        "number": message.contact,
        "start": nanoseconds_from_stamp(message.start) * 1e-9,
        "end": nanoseconds_from_stamp(message.header.stamp) * 1e-9,
        "revision": message.configuration_revision,
        "parameters": [
            message.stiffness,
            message.damping,
            message.displacement_exponent,
            message.velocity_exponent,
        ],
        "std": [
            message.stiffness_std,
            message.damping_std,
            message.displacement_exponent_std,
            message.velocity_exponent_std,
        ],
        "stiffness_exponent_covariance": message.covariance[2],
        "peak_force": message.peak_force,
        "peak_depth": message.peak_displacement * METRE_IN_MM,
        "force_rmse": message.force_rmse,
        "position": [
            p * METRE_IN_MM for p in (message.position_x, message.position_y, message.position_z)
        ],
        "mismatch": bool(message.model_mismatch),
    }
