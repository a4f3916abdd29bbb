"""From when the seconds of a bag are counted, by every command: from its first sample.

A recorder begins before there is anything to record: a bag may hold a minute of diagnostics before
a touch of six seconds. Whoever says "from second 2 on" means seconds as reports and findings tell
them, and these count from the first sample.
"""

from __future__ import annotations

from collections.abc import Collection

from hc_logger.bag import Bag
from hc_logger.type_names import FORCE_TYPE, POSITION_TYPES, SAMPLE_TYPE, SAMPLES_TYPE


def origin_ns(bag: Bag) -> int | None:
    """Return the log time (ns) from which seconds count; None for a bag without messages.

    It is that of the first sample; of a robot's bag, that from which on there are both force and
    position; of any other, that of the first message.
    """
    samples = _first(bag, (SAMPLE_TYPE, SAMPLES_TYPE))
    if samples is not None:
        return samples
    force, position = _first(bag, (FORCE_TYPE,)), _first(bag, POSITION_TYPES)
    if force is not None:
        return force if position is None else max(force, position)
    first = next(bag.messages(), None)
    return None if first is None else first.log_time


def _first(bag: Bag, kinds: Collection[str]) -> int | None:
    """Return the log time of the first message of these types."""
    topics = [topic.name for topic in bag.topics.values() if topic.definition.name in kinds]
    first = next(bag.messages(topics), None) if topics else None
    return None if first is None else first.log_time
