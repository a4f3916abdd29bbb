"""Subscriptions whose queues are emptied, not called back: bytes, a thousand a second, cheaply.

Whoever wants a topic acquires it and releases it again; the subscription exists only in between,
so that nobody pays for a page that nobody looks at. Estimates are taken best effort: a slow page
must never make the estimator wait for an acknowledgement.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from hc_msgs_py.interface_class import interface_class
from hc_msgs_py.qos import STREAM_DEPTH

MOST_AT_ONCE: Final = 4000
LATCHED: Final = 100
"""Messages of a transient-local topic that are kept for who comes late."""


class Arrival(NamedTuple):
    """One message: its CDR bytes and when it was received [ns, system clock]."""

    data: bytes
    received_ns: int


Take = Callable[[list[Arrival]], None]


@dataclass
class _Tap:
    """One subscription and who takes from it."""

    subscription: Any
    latched: deque[Arrival] | None
    takers: list[Take] = field(default_factory=list)


class Taps:
    """All subscriptions of a node that are emptied by `drain`."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._taps: dict[tuple[str, int], _Tap] = {}
        self.hidden: frozenset[int] = frozenset()
        """Identities of the subscriptions that the executor must not serve."""

    def acquire(
        self,
        topic: str,
        type_name: str,
        take: Take,
        *,
        depth: int = STREAM_DEPTH,
        local: bool | None = None,
        reliable: bool = False,
    ) -> None:
        """Hand all messages of a topic to a taker from now on.

        Args:
            topic: full name.
            type_name: for example "hc_msgs/msg/HuntCrossleyEstimate".
            take: called by `drain`; at once with what a transient-local topic has kept.
            depth: length of the queue; 1 keeps the latest only.
            local: whether its publishers keep messages for who comes late; None looks.
            reliable: ask for what was lost on the way, where nothing else makes it so.

        Raises:
            hc_msgs_py.interface_class.UnknownInterfaceError: if the type is not installed.
        """
        tap = self._taps.get((topic, depth))
        if tap is None:
            local = self._is_transient_local(topic) if local is None else local
            profile = QoSProfile(
                history=HistoryPolicy.KEEP_LAST,
                depth=depth,
                # Transient-local messages of the past come to reliable subscribers only.
                reliability=(
                    ReliabilityPolicy.RELIABLE
                    if local or reliable
                    else ReliabilityPolicy.BEST_EFFORT
                ),
                durability=(
                    DurabilityPolicy.TRANSIENT_LOCAL if local else DurabilityPolicy.VOLATILE
                ),
            )
            subscription = self._node.create_subscription(
                interface_class(type_name), topic, _never_called, profile, raw=True
            )
            tap = _Tap(subscription, deque(maxlen=LATCHED) if local else None)
            self._taps[topic, depth] = tap
            self.hidden |= {id(subscription)}
        elif tap.latched:
            take(list(tap.latched))
        tap.takers.append(take)

    def release(self, topic: str, take: Take, *, depth: int = STREAM_DEPTH) -> None:
        """Hand no more messages of a topic to a taker."""
        tap = self._taps[topic, depth]
        tap.takers.remove(take)
        if not tap.takers:
            del self._taps[topic, depth]
            self._node.destroy_subscription(tap.subscription)
            self.hidden -= {id(tap.subscription)}

    def publishers(self, topic: str) -> int:
        """Return how many publish a topic."""
        return int(self._node.count_publishers(topic))

    def drain(self) -> None:
        """Take what has arrived on all topics and hand it to the takers."""
        for tap in list(self._taps.values()):
            arrivals = _taken(tap.subscription)
            if not arrivals:
                continue
            if tap.latched is not None:
                tap.latched.extend(arrivals)
            for take in list(tap.takers):
                take(arrivals)

    def _is_transient_local(self, topic: str) -> bool:
        offered = [e.qos_profile for e in self._node.get_publishers_info_by_topic(topic)]
        return bool(offered) and all(
            profile.durability == DurabilityPolicy.TRANSIENT_LOCAL for profile in offered
        )


def _taken(subscription: Any) -> list[Arrival]:
    handle, kind = subscription.handle, subscription.msg_type
    arrivals = []
    with handle:
        for _ in range(MOST_AT_ONCE):
            taken = handle.take_message(kind, True)
            if taken is None:
                break
            data, info = taken
            arrivals.append(Arrival(data, info["received_timestamp"]))
    return arrivals


def _never_called(_data: bytes) -> None:
    """Stand in for the callback that a subscription must have."""
