"""Parameters that the recorder is started with, all fixed from then on."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from rclpy.node import Node

from hc_logger import __version__
from hc_logger.selection import TopicSelection, full_name, is_pattern
from hc_logger.session import FLUSH_INTERVAL_S
from hc_msgs_py.node_main import NodeStartError
from hc_msgs_py.parameters import declare, refuse_unknown
from hc_msgs_py.qos import KEPT_DEPTH


class Options(NamedTuple):
    """What the recorder was started with.

    Attributes:
        output: folder of the new bag.
        is_numbered: record into NAME_2, NAME_3 and so on where it exists.
        removes_empty: remove the folder at the end if no message came.
        selection: of topics.
        named: topics that were named, no patterns: one that nobody publishes may be misspelt.
        expected: topics that ~/ready waits for.
        queue_depth: messages of a topic that may wait.
        flush_interval_s: how often all is handed to the system.
        fsync_interval_s: how often to the disk; 0: never.
        split: options of BagWriter that say when a new file begins.
        custom_data: texts for the metadata.
    """

    output: str
    is_numbered: bool
    removes_empty: bool
    selection: TopicSelection
    named: list[str]
    expected: list[str]
    queue_depth: int
    flush_interval_s: float
    fsync_interval_s: float
    split: dict[str, Any]
    custom_data: Mapping[str, str]


def declare_options(node: Node) -> Options:
    """Declare the parameters and return their values.

    Raises:
        NodeStartError: if there is no output, or they contradict each other.
        ValueError: if one is of the wrong type or out of range.
    """
    output = declare(node, "output", "", "folder of the new bag", read_only=True)
    when_exists = declare(
        node,
        "when_exists",
        "refuse",
        "what to do when the folder exists: refuse, or record into NAME_2, NAME_3 and so on",
        choices=("refuse", "number"),
        read_only=True,
    )
    removes_empty = declare(
        node,
        "remove_empty",
        False,
        "remove the folder at the end if not one message came",
        read_only=True,
    )
    topics = declare(
        node,
        "topics",
        ["*"],
        "topics to record: names or patterns with * and ?",
        read_only=True,
    )
    exclude = declare(
        node, "exclude", [""], "topics to leave out: names or patterns", read_only=True
    )
    expected = declare(
        node, "expected_topics", [""], "topics that ~/ready waits for", read_only=True
    )
    depth = declare(
        node,
        "queue_depth",
        KEPT_DEPTH,
        "messages that wait to be written, of each topic",
        minimum=1,
        maximum=100_000,
        read_only=True,
    )
    flush = declare(
        node,
        "flush_interval",
        FLUSH_INTERVAL_S,
        "a killed recorder loses at most this much, and 0.02 s more",
        minimum=0.01,
        maximum=10.0,
        unit="s",
        read_only=True,
    )
    fsync = declare(
        node,
        "fsync_interval",
        5.0,
        "a power cut loses at most this much; 0 leaves it to the system",
        minimum=0.0,
        maximum=3600.0,
        unit="s",
        read_only=True,
    )
    split = {
        "max_file_bytes": declare(
            node,
            "max_file_bytes",
            0,
            "begin a new file of the bag at this size; 0 for one file",
            minimum=0,
            read_only=True,
        ),
        "max_file_duration_s": declare(
            node,
            "max_file_duration",
            3600.0,
            "begin a new file of the bag after so long, which bounds memory; 0 for one file",
            minimum=0.0,
            unit="s",
            read_only=True,
        ),
    }
    custom = declare(
        node, "custom_data", [""], "texts for the bag's metadata, key=value", read_only=True
    )
    refuse_unknown(node)
    if not output:
        raise NodeStartError("parameter output is empty; give the folder of the new bag")
    namespace = node.get_namespace()
    expected_names = [full_name(name, namespace) for name in expected if name]
    selection = TopicSelection([*topics, *expected_names], exclude, namespace)
    for name in expected_names:
        if name not in selection:
            raise NodeStartError(f"{name} is among expected_topics and left out by exclude")
    return Options(
        output,
        when_exists == "number",
        removes_empty,
        selection,
        [full_name(name, namespace) for name in topics if not is_pattern(name)],
        expected_names,
        depth,
        flush,
        fsync,
        split,
        _custom_data(custom),
    )


def _custom_data(entries: list[str]) -> Mapping[str, str]:
    """Return the version of this software and what key=value texts say.

    Raises:
        NodeStartError: if one has no key.
    """
    result = {"hc_logger_version": __version__}
    for entry in entries:
        if not entry:
            continue
        key, separator, value = entry.partition("=")
        if not separator or not key:
            raise NodeStartError(f"custom_data entry {entry!r} is not key=value")
        result[key] = value
    return result
