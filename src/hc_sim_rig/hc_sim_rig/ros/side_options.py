"""Parameters that master and slave nodes share: the link, and sections of a bilateral set-up."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Sequence
from typing import Any

from rclpy.node import Node

from hc_msgs_py.diagnostics import Level, Status
from hc_msgs_py.parameters import declare, declare_specified
from hc_sim_rig.bilateral.parts import Bilateral
from hc_sim_rig.bilateral.udp_link import Added, Clocks, UdpLink
from hc_sim_rig.schema import specification_of

PORTS = {"master": 47111, "slave": 47112}


# What of the feedback is the master's, and what the slave's. Method and impedance of the waves are
# told by the master; the filter is a node of its own.
MASTER_FEEDBACK = (
    "method",
    "position_stiffness",
    "position_damping",
    "wave_impedance",
    "update_rate_n_per_s",
    "update_time_s",
    "largest_stiffness",
    "largest_damping",
    "controller_damping",
    "tank_mj",
)
SLAVE_FEEDBACK = ("position_stiffness", "position_damping", "wave_stiffness")


def declare_settings(
    node: Node, sections: Sequence[str], feedback: Sequence[str] = MASTER_FEEDBACK
) -> Bilateral:
    """Declare every field of some sections as a parameter; return the set-up with their values.

    Args:
        node: the node.
        sections: names of fields of Bilateral, for example "slave".
        feedback: of section "feedback" only these fields.

    Raises:
        ScenarioError: a value cannot be.
        ValueError: a value is of the wrong type or out of range.
    """
    default = Bilateral()
    changed = {}
    for section in sections:
        part = getattr(default, section)
        values = {}
        for field in dataclasses.fields(part):
            if section == "feedback" and field.name not in feedback:
                continue
            given = specification_of(field)
            if given is None:
                continue
            text = f"{field.name.replace('_', ' ')} of the {section}"
            values[field.name] = declare_specified(
                node,
                dataclasses.replace(
                    given,
                    name=f"{section}.{field.name}",
                    description=f"{text}: {given.description}" if given.description else text,
                    read_only=True,
                ),
            )
        changed[section] = dataclasses.replace(part, **values)
    return dataclasses.replace(default, **changed)


def declare_link(node: Node, side: str, seed: int) -> UdpLink:
    """Declare the link's parameters and open it.

    Args:
        node: the node.
        side: "master" or "slave".
        seed: of delays and losses that are added.

    Raises:
        LinkError: an address cannot be, or the port is in use.
        ValueError: a value is of the wrong type or out of range.
    """
    other = "slave" if side == "master" else "master"

    def own(name: str, default: Any, text: str, **limits: Any) -> Any:
        return declare(node, f"link.{name}", default, text, read_only=True, **limits)

    port = {"minimum": 1, "maximum": 65535}
    added = {"minimum": 0.0, "maximum": 10.0, "unit": "s"}
    bind = own("bind", "127.0.0.1", "address of this host that the link listens on")
    free = {"minimum": 0, "maximum": 65535}
    here = own(
        "port", PORTS[side], "UDP port that the link listens on; 0: one that is free", **free
    )
    peer = own("peer", "127.0.0.1", f"host of the {other}; what comes from elsewhere is refused")
    there = own("peer_port", PORTS[other], f"UDP port of the {other}", **port)
    delay = own("added_delay", 0.0, "what is sent is held back so long", **added)
    jitter = own("added_jitter", 0.0, "standard deviation of the added delay", **added)
    loss = own("added_loss", 0.0, "share of what is sent that is dropped", minimum=0.0, maximum=1.0)
    number = 0 if side == "master" else 1
    added_here, clocks = Added(delay, jitter, loss), Clocks(time.time_ns, time.monotonic_ns)
    return UdpLink(number, bind, here, peer, there, added_here, seed, clocks)


class RefusalWatch:
    """Says in a status that datagrams were refused since the one before, and why."""

    def __init__(self, link: UdpLink) -> None:
        """Watch a link."""
        self._link, self._before = link, 0

    def reported_in(self, status: Status) -> Status:
        """Return a status with what there is to say of refusals, a warning at least."""
        new, self._before = self._link.refused - self._before, self._link.refused
        if not new:
            return status
        message = f"{status.message}; {new} datagrams refused: {self._link.why_refused}"
        return Status(max(status.level, Level.WARN), message, status.values)


def link_values(link: UdpLink, now_ns: int) -> dict[str, Any]:
    """What /diagnostics says of a link."""
    values: dict[str, Any] = {
        "link_sent": link.sent,
        "link_unsent": link.unsent,
        "link_received": link.received,
        "link_lost": link.lost,
        "link_overtaken": link.overtaken,
        "link_refused": link.refused,
        "link_restarts": link.restarts,
        "link_age_ms": 1e3 * link.age_s(now_ns),
        "round_trip_ms": 1e-6 * link.clock.round_trip_ns,
        "clock_exchanges": link.clock.exchanges,
        "clock_steps": link.clock.steps,
        "clock_offset_ms": 1e-6 * link.clock.offset_ns,
        "clock_offset_bound_ms": 1e-6 * link.clock.bound_ns(now_ns),
    }
    if link.why_refused:
        values["link_why_refused"] = link.why_refused
    return values
