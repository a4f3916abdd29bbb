"""hc topic list, echo, hz, and the actions of topic_tools: as ros2cli, which the wheels lack."""

from __future__ import annotations

import argparse
import itertools
import sys
import time
from collections import deque
from typing import Any

from hc_bringup import topic_tools
from hc_bringup.errors import FAILURE, UserError
from hc_bringup.options import natural, positive

HELP = "list topics, print and publish messages, measure rates"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    commands = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    listing = commands.add_parser("list", help="names of all topics")
    listing.add_argument("-t", "--show-types", action="store_true", help="types too")
    listing.add_argument("-c", "--count-topics", action="store_true", help="print the number only")
    listing.add_argument("--include-hidden-topics", action="store_true", help="hidden ones too")
    echo = commands.add_parser("echo", help="print the messages of a topic")
    echo.add_argument("topic", metavar="TOPIC")
    echo.add_argument("type", nargs="?", metavar="TYPE", help="only needed before it is published")
    echo.add_argument("--once", action="store_true", help="print one message and end")
    echo.add_argument(
        "--field", metavar="NAME", help="print this field only, for example header.stamp"
    )
    echo.add_argument("--csv", action="store_true", help="a line of comma-separated values each")
    echo.add_argument("--no-arr", action="store_true", help="only the length of arrays")
    echo.add_argument("--timeout", type=positive, metavar="S", help="end after S seconds")
    rate = commands.add_parser("hz", help="measure the rate of a topic")
    rate.add_argument("topic", metavar="TOPIC")
    rate.add_argument(
        "-w", "--window", type=natural, default=10_000, metavar="N", help="messages to average over"
    )
    rate.add_argument("--timeout", type=positive, metavar="S", help="end after S seconds")
    topic_tools.configure(commands)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    actions = {
        "list": _list,
        "echo": _echo,
        "hz": _hz,
        "info": topic_tools.info,
        "bw": topic_tools.bandwidth,
        "pub": topic_tools.publish,
    }
    return actions[arguments.action](arguments)


def _list(arguments: argparse.Namespace) -> int:
    from hc_bringup.graph import Graph

    with Graph() as graph:
        graph.settle()
        topics = graph.topics(hidden=arguments.include_hidden_topics)
    if arguments.count_topics:
        print(len(topics))
        return 0
    for name, types in topics:
        print(f"{name} [{', '.join(types)}]" if arguments.show_types else name)
    return 0


def _echo(arguments: argparse.Namespace) -> int:
    from hc_bringup.graph import Graph, topic_name
    from hc_bringup.message_text import as_csv, as_yaml, field
    from hc_msgs_py.interface_class import interface_class

    with Graph() as graph:
        if arguments.type is None:
            topic, type_name = graph.require_topic(arguments.topic)
        else:
            topic, type_name = topic_name(arguments.topic), arguments.type
        received: deque[Any] = deque()
        graph.node.create_subscription(
            interface_class(type_name),
            topic,
            lambda message: received.append(message),
            matching_qos(graph, topic),
        )
        end = None if arguments.timeout is None else time.monotonic() + arguments.timeout
        quiet = topic_tools.QuietTopic(graph, topic)
        while graph.spin(0.02):
            note = quiet.tell(len(received))
            if note:
                print(note, file=sys.stderr, flush=True)
            while received:
                message = received.popleft()
                value = message if arguments.field is None else field(message, arguments.field)
                if arguments.csv:
                    print(as_csv(value))
                else:
                    print(as_yaml(value, arrays=not arguments.no_arr) + "---")
                if arguments.once:
                    return 0
            sys.stdout.flush()
            if end is not None and time.monotonic() >= end:
                if arguments.once:
                    raise UserError(f"no message on {topic} in {arguments.timeout:g} s", FAILURE)
                return 0
    return 0


def _hz(arguments: argparse.Namespace) -> int:
    from hc_bringup.graph import Graph
    from hc_msgs_py.interface_class import interface_class

    with Graph() as graph:
        topic, type_name = graph.require_topic(arguments.topic)
        arrivals: deque[float] = deque(maxlen=max(2, arguments.window))
        graph.node.create_subscription(
            interface_class(type_name),
            topic,
            lambda _: arrivals.append(time.monotonic()),
            matching_qos(graph, topic),
            raw=True,
        )
        end = None if arguments.timeout is None else time.monotonic() + arguments.timeout
        while graph.spin(1.0):
            silence = topic_tools.silence(graph, topic, list(arrivals))
            if silence:
                print(silence, flush=True)
            else:
                _print_rate(topic, list(arrivals))
            if end is not None and time.monotonic() >= end:
                return 0
    return 0


def _print_rate(topic: str, arrivals: list[float]) -> None:
    if len(arrivals) < 2:
        print(f"no message on {topic} yet")
        return
    periods = [b - a for a, b in itertools.pairwise(arrivals)]
    mean = sum(periods) / len(periods)
    deviation = (sum((p - mean) ** 2 for p in periods) / len(periods)) ** 0.5
    print(
        f"average rate: {1.0 / mean:.3f}\n\tmin: {min(periods):.6f}s max: {max(periods):.6f}s "
        f"std dev: {deviation:.5f}s window: {len(arrivals)}",
        flush=True,
    )


def matching_qos(graph: Any, topic: str) -> Any:
    """Return a profile that matches every publisher of the topic, deep enough for 1 kHz."""
    from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

    from hc_msgs_py.qos import STREAM_DEPTH

    publishers = [i.qos_profile for i in graph.node.get_publishers_info_by_topic(topic)]

    def all_offer(attribute: str, value: Any) -> bool:
        return bool(publishers) and all(getattr(p, attribute) == value for p in publishers)

    reliable = all_offer("reliability", ReliabilityPolicy.RELIABLE)
    latched = all_offer("durability", DurabilityPolicy.TRANSIENT_LOCAL)
    return QoSProfile(
        depth=STREAM_DEPTH,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )
