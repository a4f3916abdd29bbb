"""Quality of service of the suite's topics.

Depths are deep on purpose: with a depth of 100 a publisher overwrote its queue in stalls of 50
to 120 ms at 1 kHz, with 2000 none was lost.

A process that stands still (stopped, swapped out) receives nothing, however deep its own queue is:
what it misses can only come from the publisher, if that keeps it and is asked to send it again.
So samples and estimates are offered RELIABLE and deep; who does not want old ones subscribes
BEST_EFFORT. What the rig publishes beside them (truth, wrench, joints, tip) is not: all of it
RELIABLE took 4 % of a core more, samples alone 1 to 2.
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

KEPT_DEPTH: Final = 8000
"""What publishers of streams keep for a recorder that stands still: eight seconds at 1 kHz."""

SAMPLE_QOS: Final = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=STREAM_DEPTH,
    reliability=ReliabilityPolicy.BEST_EFFORT,
    durability=DurabilityPolicy.VOLATILE,
)
"""To subscribe to sensor streams: a late sample is worth less than the next one. Also to publish
what stands beside the samples."""

SAMPLE_PUBLISHER_QOS: Final = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=KEPT_DEPTH,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.VOLATILE,
)
"""To publish samples: SAMPLE_QOS matches it, and a recorder gets every one."""

SERVO_QOS: Final = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=10,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.VOLATILE,
)
"""To publish what a device acts on at once: RELIABLE, for most drivers subscribe so and would get
nothing otherwise; shallow, for what is late is worth nothing."""

NEWEST_QOS: Final = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=1,
    reliability=ReliabilityPolicy.BEST_EFFORT,
    durability=DurabilityPolicy.VOLATILE,
)
"""To subscribe to what is acted on at once: a queue would be a delay in the loop."""

ESTIMATE_QOS: Final = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=KEPT_DEPTH,
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

SERVICE_QOS: Final = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=1000,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.VOLATILE,
)
"""Services, as rclpy's own for parameters. All clients share the queue of requests: with ROS's
usual 10, of a hundred asked at once 42 were answered, and who asked the others waited without an
end. A client has to keep as many answers, for it gets those to all others, too: ours do."""

FIXED_FRAMES_QOS: Final = CONFIGURATION_QOS
"""To subscribe to /tf_static, as tf2 does: who comes late gets what was told once."""

DIAGNOSTICS_QOS: Final = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=100,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.VOLATILE,
)
"""/diagnostics, as diagnostic_updater publishes it."""
