"""Jumps of the node's clock: a step back, a large step ahead, another source of time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.clock import JumpThreshold
from rclpy.duration import Duration
from rclpy.node import Node


def watch_jumps(node: Node, maximum_gap_s: float, on_jump: Callable[[str], None]) -> Any:
    """Call back with a line about every jump, as long as the returned handle is kept.

    Args:
        node: whose clock is watched.
        maximum_gap_s: steps ahead of up to this are none.
        on_jump: told what happened.
    """
    threshold = JumpThreshold(
        min_forward=Duration(seconds=maximum_gap_s),
        min_backward=Duration(nanoseconds=-1),
        on_clock_change=True,
    )

    def tell(jump: Any) -> None:
        on_jump(f"the clock jumped by {jump.delta.nanoseconds * 1e-9:+.3f} s")

    return node.get_clock().create_jump_callback(threshold, post_callback=tell)
