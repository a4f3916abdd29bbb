"""Quality of service of the suite's topics.

Depths are deep on purpose: with a depth of 100 a publisher overwrote its queue in stalls of 50
to 120 ms at 1 kHz, with 2000 none was lost (../shared/BAGS_AND_PICTURES.md).
"""

from __future__ import annotations

from typing import Final

from rclpy.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    QoSProfile,
    ReliabilityPolicy,
)

STREAM_DEPTH: Final = 2000
"""Queue of every stream with one message a sample: two seconds at 1 kHz."""

SAMPLE_QOS: Final = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=STREAM_DEPTH,
    reliability=ReliabilityPolicy.BEST_EFFORT,
    durability=DurabilityPolicy.VOLATILE,
)
"""Sensor streams: a late sample is worth less than the next one, so nothing is sent twice."""

ESTIMATE_QOS: Final = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=STREAM_DEPTH,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.VOLATILE,
)
"""Estimates and what is derived from them: delivered, in order."""

CONFIGURATION_QOS: Final = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=100,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
"""Configurations: who comes late still gets those in force."""

DIAGNOSTICS_QOS: Final = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=100,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.VOLATILE,
)
"""/diagnostics, as diagnostic_updater publishes it."""
