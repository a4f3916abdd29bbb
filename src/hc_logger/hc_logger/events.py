"""What an estimator said in a bag: its events, and when its sensors were read otherwise."""

from __future__ import annotations

from typing import NamedTuple

from hc_estimator.stream.vocabulary import EventKind
from hc_logger.bag import Bag
from hc_logger.decoder import decoder
from hc_logger.selection import full_name
from hc_logger.type_names import EVENT_TYPE
from hc_msgs_py.topics import EVENTS
from hc_msgs_py.units import NANOSECONDS

READ_OTHERWISE = "input."
"""Begins the names of settings that say how sensors are read; a reset for them names them."""


class RecordedEvent(NamedTuple):
    """One hc_msgs/EstimatorEvent: stamp of the sample at which it happened, kind, one line."""

    stamp_ns: int
    kind: int
    reason: str


class ReadingChange(NamedTuple):
    """The sensors are read otherwise from here on.

    Attributes:
        stamp_ns: of the last sample that was read as before.
        settings: what they are from then on, as "input.force.zero = 1.2, ...".
    """

    stamp_ns: int
    settings: str


def events_of(bag: Bag) -> list[RecordedEvent] | None:
    """Return the events of a bag in the order of their arrival; None where none were recorded.

    Raises:
        BagError: if they are damaged.
    """
    topic = bag.topics.get(full_name(EVENTS, bag.namespace))
    if topic is None or topic.definition.name != EVENT_TYPE:
        return None
    decode = decoder(topic.definition)
    events = []
    for message in bag.messages({topic.name}):
        event = decode(message.data)
        stamp = event.header.stamp
        at = int(stamp.sec) * NANOSECONDS + int(stamp.nanosec)
        events.append(RecordedEvent(at, int(event.kind), str(event.reason)))
    return events


def reading_changes(events: list[RecordedEvent]) -> list[ReadingChange]:
    """Return when a tare, a search for the surface or a person changed how sensors are read."""
    changes = []
    for event in events:
        before, found, settings = event.reason.partition(READ_OTHERWISE)
        if event.kind == EventKind.RESET and found and before.endswith(": "):
            changes.append(ReadingChange(event.stamp_ns, found + settings))
    return changes
