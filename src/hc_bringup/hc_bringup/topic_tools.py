"""hc topic info, pub and bw: what ros2cli would do, which the wheels lack."""

from __future__ import annotations

import argparse
import time
from typing import Any

from hc_bringup.errors import FAILURE, WRONG_USE, UserError
from hc_bringup.nearest import hint
from hc_bringup.options import natural, positive
from hc_msgs_py.plain_yaml import PlainYamlError, load_plain_yaml


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
    from hc_bringup.graph import Graph, absolute

    with Graph() as graph:
        name = absolute(arguments.topic)
        # A busy machine tells of a subscriber long before it tells of the publisher.
        graph.settle(expected=lambda: graph.node.count_publishers(name) > 0)
        types = dict(graph.topics(hidden=True)).get(name)
        if types is None:
            known = hint(name, (n for n, _ in graph.topics()), "topics")
            raise UserError(f"there is no topic {name}; {known}", FAILURE)
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
        graph.node.create_subscription(
            interface_class(type_name),
            topic,
            lambda data: sizes.append(len(data)),
            matching_qos(graph, topic),
            raw=True,
        )
        start = time.monotonic()
        while graph.spin(1.0):
            elapsed = time.monotonic() - start
            if sizes:
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


def publish(arguments: argparse.Namespace) -> int:
    """Publish until the wanted number is reached, or a signal."""
    from rclpy.qos import QoSProfile

    from hc_bringup.graph import Graph, absolute
    from hc_bringup.message_text import as_yaml
    from hc_bringup.message_values import fill
    from hc_msgs_py.interface_class import interface_class

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
        topic = absolute(arguments.topic)
        publisher = graph.node.create_publisher(kind, topic, QoSProfile(depth=10))
        if not graph.wait_for(lambda: publisher.get_subscription_count() >= listeners, 10.0):
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
