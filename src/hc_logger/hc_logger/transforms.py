"""Transforms of one frame, of a topic that may tell those of several."""

from __future__ import annotations

from itertools import islice
from typing import Any

from hc_logger.bag import Bag
from hc_logger.decoder import decoder


def of_one_frame(bag: Bag, topic: str, child: str = "", most: int | None = None) -> list[Any]:
    """Return the messages of a frame; none where the topic tells several and none is named.

    Args:
        bag: an open bag.
        topic: of TransformStamped messages.
        child: the frame; empty takes the only one.
        most: how many messages of the topic are looked at; None for all.
    """
    decode = decoder(bag.topics[topic].definition)
    found: dict[str, list[Any]] = {}
    for message in islice(bag.messages({topic}), most):
        transform = decode(message.data)
        found.setdefault(transform.child_frame_id, []).append(transform)
    if child:
        return found.get(child, [])
    return next(iter(found.values())) if len(found) == 1 else []
