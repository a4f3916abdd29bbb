"""QoS profiles of rclpy to and from the plain mappings that bags hold (rosbag2, version 9)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, HistoryPolicy, LivelinessPolicy, QoSProfile
from rclpy.qos import ReliabilityPolicy as Reliability

NANOSECONDS = 1_000_000_000


def _time(duration: Duration) -> dict[str, int]:
    seconds, rest = divmod(duration.nanoseconds, NANOSECONDS)
    return {"sec": seconds, "nsec": rest}


def mapping_from_profile(profile: QoSProfile) -> dict[str, Any]:
    """Return a profile as rosbag2 writes it."""
    return {
        "history": profile.history.name.lower(),
        "depth": profile.depth,
        "reliability": profile.reliability.name.lower(),
        "durability": profile.durability.name.lower(),
        "deadline": _time(profile.deadline),
        "lifespan": _time(profile.lifespan),
        "liveliness": profile.liveliness.name.lower(),
        "liveliness_lease_duration": _time(profile.liveliness_lease_duration),
        "avoid_ros_namespace_conventions": profile.avoid_ros_namespace_conventions,
    }


def subscription_profile(offered: Sequence[QoSProfile], depth: int) -> QoSProfile:
    """Return the strictest profile that all publishers of a topic can serve.

    Args:
        offered: what the publishers offer; at least one.
        depth: length of the queue.
    """
    reliable = all(p.reliability == Reliability.RELIABLE for p in offered)
    local = all(p.durability == DurabilityPolicy.TRANSIENT_LOCAL for p in offered)
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=Reliability.RELIABLE if reliable else Reliability.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if local else DurabilityPolicy.VOLATILE,
    )


def publisher_profile(recorded: Sequence[Mapping[str, Any]], depth: int) -> QoSProfile:
    """Return the profile with which a player publishes a topic.

    Reliability and durability are those of the recorded publishers (the strictest of several,
    which serves every subscriber); the queue is at least `depth` long. Older bags give numbers
    instead of words.
    """
    reliable = not recorded or any(
        _is(p.get("reliability"), "reliable", Reliability.RELIABLE) for p in recorded
    )
    local = any(
        _is(p.get("durability"), "transient_local", DurabilityPolicy.TRANSIENT_LOCAL)
        for p in recorded
    )
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=max([depth, *(_depth(p.get("depth")) for p in recorded)]),
        reliability=Reliability.RELIABLE if reliable else Reliability.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if local else DurabilityPolicy.VOLATILE,
        liveliness=LivelinessPolicy.AUTOMATIC,
    )


def _is(value: Any, word: str, number: int) -> bool:
    return bool(value == word or value == int(number))


def _depth(value: Any) -> int:
    return value if isinstance(value, int) and 0 < value <= 100_000 else 0
