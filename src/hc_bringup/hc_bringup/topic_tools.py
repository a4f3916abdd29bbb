"""hc topic info, pub and bw: what ros2cli would do, which the wheels lack."""

from __future__ import annotations

import argparse
import time
from collections import deque
from collections.abc import Sequence
from typing import Any, Final

from hc_bringup.errors import FAILURE, WRONG_USE, UserError
from hc_bringup.options import natural, positive
from hc_msgs_py.plain_yaml import PlainYamlError, load_plain_yaml

_SILENCE_S: Final = 2.0
_NOBODY: Final = " (nobody publishes it)"
_NO_LONGER: Final = " (nobody publishes it any more)"
_LOOKED_AT: Final = 100
"""Messages; the last ones tell how often one is due."""


def configure(commands: Any) -> None:
    """Declare the options of the three actions."""
    info = commands.add_parser("info", help="type, publishers and subscribers of a topic")
    info.add_argument("topic", metavar="TOPIC")
    info.add_argument("-v", "--verbose", action="store_true", help="nodes and QoS of each")
    bandwidth = commands.add_parser("bw", help="measure the bytes a second of a topic")
    bandwidth.add_argument("topic", metavar="TOPIC")
    bandwidth.add_argument("--timeout", type=positive, metavar="S", help="end after S seconds")
    publish = commands.add_parser("pub", help="publish a message on a topic")
    publish.add_argument("topic", metavar="TOPIC")
    publish.add_argument("type", metavar="TYPE", help="for example std_msgs/msg/Float64")
    publish.add_argument("values", nargs="?", default="{}", metavar="VALUES", help="as YAML")
    often = publish.add_mutually_exclusive_group()
    often.add_argument("-1", "--once", action="store_true", help="one message")
    often.add_argument("-t", "--times", type=natural, metavar="N", help="so many messages")
    publish.add_argument(
        "-r", "--rate", type=positive, default=1.0, metavar="HZ", help="(default: 1)"
    )
    publish.add_argument(
        "-w",
        "--wait-matching-subscriptions",
        type=natural,
        metavar="N",
        help="wait for so many subscribers (default: 1 with --once or --times, else 0)",
    )


def info(arguments: argparse.Namespace) -> int:
    """Print who publishes and who subscribes."""
    from hc_bringup.graph import Graph, topic_name

    name = topic_name(arguments.topic)
    with Graph() as graph:
        # A busy machine tells of a subscriber long before it tells of the publisher.
        graph.settle(expected=lambda: graph.node.count_publishers(name) > 0)
        types = dict(graph.topics(hidden=True)).get(name)
        if types is None:
            raise UserError(f"there is no topic {name}; {graph.known_topics(name)}", FAILURE)
        publishers = graph.node.get_publishers_info_by_topic(name)
        subscribers = graph.node.get_subscriptions_info_by_topic(name)
    print(f"Type: {', '.join(types)}")
    for word, ends in (("Publisher", publishers), ("Subscription", subscribers)):
        print(f"{word} count: {len(ends)}")
        for end in sorted(ends, key=lambda e: (e.node_namespace, e.node_name)):
            if arguments.verbose:
                qos = end.qos_profile
                full = f"{end.node_namespace.rstrip('/')}/{end.node_name}"
                print(
                    f"  {full}: {qos.reliability.name}, {qos.durability.name}, "
                    f"history {qos.history.name} ({qos.depth})"
                )
    return 0


def bandwidth(arguments: argparse.Namespace) -> int:
    """Print bytes a second, once a second."""
    from hc_bringup.commands.topic import matching_qos
    from hc_bringup.graph import Graph
    from hc_msgs_py.interface_class import interface_class

    with Graph() as graph:
        topic, type_name = graph.require_topic(arguments.topic)
        sizes: list[int] = []
        arrivals: deque[float] = deque(maxlen=_LOOKED_AT)

        def take(data: bytes) -> None:
            sizes.append(len(data))
            arrivals.append(time.monotonic())

        graph.node.create_subscription(
            interface_class(type_name),
            topic,
            take,
            matching_qos(graph, topic),
            raw=True,
        )
        start = time.monotonic()
        while graph.spin(1.0):
            elapsed = time.monotonic() - start
            quiet = silence(graph, topic, list(arrivals))
            if quiet:
                print(quiet, flush=True)
            elif sizes:
                print(
                    f"{sum(sizes) / elapsed:.0f} B/s from {len(sizes)} messages; message size mean "
                    f"{sum(sizes) / len(sizes):.0f} B, min {min(sizes)} B, max {max(sizes)} B",
                    flush=True,
                )
            else:
                print(f"no message on {topic} yet", flush=True)
            if arguments.timeout is not None and elapsed >= arguments.timeout:
                break
    return 0


def silence(graph: Any, topic: str, arrivals: Sequence[float]) -> str:
    """Return that nothing comes on a topic any more; nothing while messages come as they did.

    Args:
        graph: where the topic is.
        topic: its full name.
        arrivals: times of the last messages, by the monotonic clock.
    """
    if not arrivals:
        return ""
    usual_s = (arrivals[-1] - arrivals[0]) / max(len(arrivals) - 1, 1)
    silent_s = time.monotonic() - arrivals[-1]
    if silent_s < max(_SILENCE_S, 3.0 * usual_s):
        return ""
    why = "" if graph.node.count_publishers(topic) else _NO_LONGER
    return f"no message on {topic} for {silent_s:.0f} s{why}"


class QuietTopic:
    """Says once that nothing comes on a topic, or comes any more: for who prints its messages."""

    def __init__(self, graph: Any, topic: str) -> None:
        """Begin to wait.

        Args:
            graph: where the topic is.
            topic: its full name.
        """
        self._graph, self._topic = graph, topic
        self._arrivals: deque[float] = deque(maxlen=_LOOKED_AT)
        self._since_s = time.monotonic()
        self._announced = False

    def tell(self, messages: int) -> str:
        """Return what to say; nothing while messages come as they did, or it was said already.

        Args:
            messages: so many came since the last call.
        """
        if messages:
            self._arrivals.extend([time.monotonic()] * messages)
            self._announced = False
        elif self._announced:
            return ""
        quiet = silence(self._graph, self._topic, list(self._arrivals))
        if not self._arrivals and time.monotonic() - self._since_s >= _SILENCE_S:
            somebody = self._graph.node.count_publishers(self._topic)
            quiet = f"no message on {self._topic} yet" + ("" if somebody else _NOBODY)
        self._announced = bool(quiet)
        return quiet


def publish(arguments: argparse.Namespace) -> int:
    """Publish until the wanted number is reached, or a signal."""
    from rclpy.qos import QoSProfile

    from hc_bringup.graph import Graph, topic_name
    from hc_bringup.message_text import as_yaml
    from hc_bringup.message_values import fill
    from hc_msgs_py.interface_class import interface_class

    topic = topic_name(arguments.topic)
    kind = interface_class(arguments.type)
    try:
        values = load_plain_yaml(arguments.values) or {}
    except PlainYamlError as error:
        raise UserError(f"{arguments.values} is not YAML: {error}", WRONG_USE) from error
    if not isinstance(values, dict):
        raise UserError(f"{arguments.values} is no fields with values like {{data: 1}}", WRONG_USE)
    message = kind()
    fill(message, values)
    wanted = 1 if arguments.once else arguments.times
    listeners = arguments.wait_matching_subscriptions
    if listeners is None:
        listeners = int(wanted is not None)
    with Graph() as graph:
        publisher = graph.node.create_publisher(kind, topic, QoSProfile(depth=10))

        def other_types() -> list[str]:
            types = dict(graph.topics(hidden=True)).get(topic, [])
            own = arguments.type.replace("/msg/", "/")
            return [name for name in types if name.replace("/msg/", "/") != own]

        graph.wait_for(
            lambda: publisher.get_subscription_count() >= listeners or bool(other_types()), 10.0
        )
        if other_types():
            raise UserError(
                f"{topic} carries {', '.join(other_types())}, and {arguments.type} on it would "
                "reach nobody",
                FAILURE,
            )
        if publisher.get_subscription_count() < listeners:
            raise UserError(
                f"{publisher.get_subscription_count()} of {listeners} subscribers on {topic} "
                "after 10 s; -w 0 waits for none",
                FAILURE,
            )
        graph.spin(0.3)  # a subscriber that is seen has not always seen us
        count = 0
        while wanted is None or count < wanted:
            publisher.publish(message)
            count += 1
            print(f"published {count}: {as_yaml(message).strip()}", flush=True)
            if not graph.spin(1.0 / arguments.rate if count != wanted else 0.3):
                break
    return 0
