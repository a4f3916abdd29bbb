"""Which entry of a sensor_msgs/JointState is the joint that is meant."""

from __future__ import annotations

from typing import Any


def joint_index(message: Any, joint: str, *columns: str) -> int | None:
    """Index of a joint in a message; None if it, or one of the columns wanted, is not in it.

    Args:
        message: sensor_msgs/JointState. Many drivers publish their joints in several messages.
        joint: name; empty for the first.
        columns: "position", "velocity" or "effort": those that have to have the joint.
    """
    index = 0
    if joint:
        try:
            index = message.name.index(joint)
        except ValueError:
            return None
    return index if all(index < len(getattr(message, name)) for name in columns) else None
