"""Bags made of others: a part of one, several in one, one in parts, as `ros2 bag convert` does it.

Messages keep their bytes, times and order. What a late subscriber would have got from a publisher
with durability transient_local (the configuration of an estimator, say) stands at the beginning of
a part that was cut out of the middle as well: without it the rest could not be understood.
"""

from __future__ import annotations

import heapq
import math
import os
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from operator import attrgetter
from pathlib import Path

from hc_logger.bag import Bag, Message
from hc_logger.convert import Progress, nothing
from hc_logger.definitions import TypeDefinition, same_definition
from hc_logger.errors import BagError, BagExistsError
from hc_logger.foreign import open_bag
from hc_logger.origin import origin_ns
from hc_logger.selection import TopicSelection
from hc_logger.writer import BagWriter, os_errors
from hc_msgs_py.nearest import hint
from hc_msgs_py.units import NANOSECONDS


class _Part:
    """A new bag with topics of others."""

    def __init__(self, path: Path, bags: Sequence[Bag], topics: Sequence[str]) -> None:
        common = set.intersection(*(set(bag.custom_data.items()) for bag in bags))
        self.writer = BagWriter(path, custom_data=dict(sorted(common)))
        self.count = 0
        self._numbers: dict[str, int] = {}
        for name in topics:
            topic = next(bag.topics[name] for bag in bags if name in bag.topics)
            self._numbers[name] = self.writer.add_topic(
                name,
                topic.definition.name,
                qos_profiles=topic.qos_profiles,
                definition=topic.definition,
            )

    def write(self, message: Message, log_time_ns: int | None = None) -> None:
        """Write a message, at another log time if one is given."""
        self.writer.write(
            self._numbers[message.topic],
            message.log_time if log_time_ns is None else log_time_ns,
            message.data,
            message.publish_time,
            message.sequence,
        )
        self.count += 1


MOST_PARTS = 1000
"""Of a bag that is split: each is a folder, and few want more beside one another."""


def filter_bag(
    source: str | os.PathLike[str],
    target: str | os.PathLike[str],
    *,
    selection: TopicSelection | None = None,
    start_s: float = 0.0,
    duration_s: float = math.inf,
    progress: Progress = nothing,
) -> tuple[int, list[str]]:
    """Copy some topics, or some seconds, of a bag.

    Args:
        source: bag of any kind; stays as it is.
        target: folder of the new bag; must not exist.
        selection: topics to take; None takes all.
        start_s: seconds from the first sample (origin.py); 0 takes what lies before it as well.
        duration_s: seconds to take from there.
        progress: told the done share.

    Returns:
        Number of messages, and one line for each part of the source that could not be read.

    Raises:
        BagError: if it begins behind the end, there is no such topic, or the target exists.
    """
    with open_bag(source) as bag:
        topics = _chosen(bag, selection)
        first, last = bag.time_range() or (0, 0)
        origin = origin_ns(bag) or first
        length_s = (last - origin) / NANOSECONDS
        if start_s > length_s:
            since = "" if origin == first else " from its first sample on"
            raise BagError(f"{source} is {length_s:.3f} s long{since}: nothing is left")
        begin = origin + round(start_s * NANOSECONDS)
        end = last if duration_s > length_s else begin + round(duration_s * NANOSECONDS)
        if start_s == 0.0:
            begin = first
        with os_errors(f"cannot write {target}"):
            part = _Part(Path(target), [bag], topics)
            with part.writer:
                latched = _Latched(bag)
                carried = False
                for message in bag.messages(topics):
                    if message.log_time > end:
                        break
                    progress((message.log_time - first) / max(end - first, 1))
                    if message.log_time < begin:
                        latched.take(message)
                        continue
                    if not carried:
                        latched.give(part, begin)
                        carried = True
                    part.write(message)
        return part.count, bag.problems


def merge_bags(
    sources: Sequence[str | os.PathLike[str]],
    target: str | os.PathLike[str],
    *,
    progress: Progress = nothing,
) -> tuple[int, list[str]]:
    """Write the messages of several bags into one in the order of their log times.

    Returns:
        Number of messages, and one line for each part of a source that could not be read.

    Raises:
        BagError: if two bags have a topic with different types, a bag is given twice, or the
            target exists.
    """
    known: dict[str, str | os.PathLike[str]] = {}
    for source in sources:
        place = os.path.realpath(source)
        if place in known:
            raise BagError(
                f"{source} is given twice: its messages would be doubled, leave one away"
            )
        known[place] = source
    with ExitStack() as stack:
        bags = [stack.enter_context(open_bag(source)) for source in sources]
        kinds: dict[str, TypeDefinition] = {}
        for source, bag in zip(sources, bags, strict=True):
            for name, topic in bag.topics.items():
                first_kind, kind = kinds.setdefault(name, topic.definition), topic.definition
                if not same_definition(first_kind, kind):
                    what = "another definition of it" if kind.name == first_kind.name else kind.name
                    raise BagError(
                        f"{name} is {first_kind.name} in one bag and {what} in {source}: leave it "
                        "out of one with hc bag filter"
                    )
        spans = [span for bag in bags if (span := bag.time_range()) is not None]
        first = min((span[0] for span in spans), default=0)
        length = max(max((span[1] for span in spans), default=0) - first, 1)
        streams = [bag.messages(list(bag.topics)) for bag in bags]
        with os_errors(f"cannot write {target}"):
            part = _Part(Path(target), bags, list(kinds))
            with part.writer:
                for message in heapq.merge(*streams, key=attrgetter("log_time")):
                    part.write(message)
                    if part.count % 10_000 == 0:
                        progress((message.log_time - first) / length)
        problems = [
            f"{source}: {problem}"
            for source, bag in zip(sources, bags, strict=True)
            for problem in bag.problems
        ]
        return part.count, problems


def split_bag(
    source: str | os.PathLike[str],
    target: str | os.PathLike[str],
    seconds: float,
    *,
    progress: Progress = nothing,
) -> tuple[list[tuple[Path, int]], list[str]]:
    """Cut a bag into parts of some seconds each: TARGET_0, TARGET_1 and so on.

    Returns:
        Folder and number of messages of each part (seconds without a message make no part), and
        one line for each part of the source that could not be read.

    Raises:
        BagError: if a target exists, there is no message, or there would be too many parts.
    """
    with open_bag(source) as bag:
        span = bag.time_range()
        if span is None:
            raise BagError(f"{source} holds no message")
        first, last = span
        length = max(1, round(min(seconds, 1.0 + (last - first) / NANOSECONDS) * NANOSECONDS))
        stem = Path(target)
        if stem.name in ("", ".."):
            raise BagError(f"{target} is no name that parts can have: give one, for example part")
        count = (last - first) // length + 1
        if count > MOST_PARTS:
            least_s = (last - first) / NANOSECONDS / (MOST_PARTS - 1)
            raise BagError(
                f"{source} is {(last - first) / NANOSECONDS:.3f} s long: parts of {seconds:g} s "
                f"would be {count} folders, and {MOST_PARTS} are the most: "
                f"--every {math.ceil(least_s * 1e3) / 1e3:g}, say"
            )
        for index in range(count):
            path = stem.with_name(f"{stem.name}_{index}")
            if path.exists():
                raise BagExistsError(f"{path} exists already and is not overwritten")
        made: list[tuple[Path, int]] = []
        latched = _Latched(bag)
        with os_errors(f"cannot write {target}"):
            for index, messages in _by_time(bag, first, length):
                path = stem.with_name(f"{stem.name}_{index}")
                part = _Part(path, [bag], list(bag.topics))
                with part.writer:
                    if index:
                        latched.give(part, first + index * length)
                    for message in messages:
                        latched.take(message)
                        part.write(message)
                made.append((path, part.count))
                progress((index + 1) * length / max(last - first, length))
        return made, bag.problems


def _by_time(bag: Bag, first: int, length: int) -> Iterator[tuple[int, Iterator[Message]]]:
    """Yield the number of each part with its messages; each part is to be read to its end."""
    messages = bag.messages(list(bag.topics))
    waiting = next(messages, None)

    def part(index: int) -> Iterator[Message]:
        nonlocal waiting
        while waiting is not None and (waiting.log_time - first) // length == index:
            message, waiting = waiting, None
            yield message
            waiting = next(messages, None)

    while waiting is not None:
        index = (waiting.log_time - first) // length
        yield index, part(index)


class _Latched:
    """The last message of every topic whose publisher keeps it for late subscribers."""

    def __init__(self, bag: Bag) -> None:
        self._topics = {
            name
            for name, topic in bag.topics.items()
            if any(p.get("durability") in ("transient_local", 1) for p in topic.qos_profiles)
        }
        self._last: dict[str, Message] = {}

    def take(self, message: Message) -> None:
        """Remember a message if its topic is one of these."""
        if message.topic in self._topics:
            self._last[message.topic] = message

    def give(self, part: _Part, log_time_ns: int) -> None:
        """Write what is remembered at the beginning of a part."""
        for message in self._last.values():
            part.write(message, log_time_ns)


def _chosen(bag: Bag, selection: TopicSelection | None) -> list[str]:
    for name in selection.names() if selection is not None else ():
        if name not in bag.topics:
            raise BagError(f"{bag.path} has no topic {name}; {hint(name, bag.topics, 'it has')}")
    topics = [name for name in bag.topics if selection is None or name in selection]
    if not topics and selection is not None and any(map(selection.leaves_out, bag.topics)):
        raise BagError(f"{bag.path}: nothing is left of its topics, {', '.join(bag.topics)}")
    if not topics:
        raise BagError(f"{bag.path} has no such topic; it has {', '.join(bag.topics) or 'none'}")
    return topics
