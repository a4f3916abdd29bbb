"""What a running node gives up is destroyed only when the executor has let go of it."""

import rclpy
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from std_msgs.msg import Int32

from hc_msgs_py.late_destruction import ROUNDS, LateDestruction


class LateNode(LateDestruction, Node):
    """A node that replaces its subscription and its publisher with every message."""

    def __init__(self, context):
        super().__init__("late", context=context, enable_rosout=False)
        self.received = 0
        self.listen()

    def listen(self):
        self.subscription = self.create_subscription(Int32, "number", self.take, 100)
        self.publisher = self.create_publisher(Int32, "echo", 100)

    def take(self, message):
        self.received += 1
        self.publisher.publish(message)
        self.destroy_subscription(self.subscription)
        self.destroy_publisher(self.publisher)
        self.listen()


def test_a_callback_may_destroy_its_own_subscription_while_messages_wait(ros_domain, monkeypatch):
    """With rclpy's own destruction the second message that waits raises InvalidHandle."""
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    context = rclpy.Context()
    rclpy.init(args=[], context=context, domain_id=ros_domain)
    executor = EventsExecutor(context=context)
    node = LateNode(context)
    source = rclpy.create_node("source", context=context, enable_rosout=False)
    numbers = source.create_publisher(Int32, "number", 100)
    executor.add_node(node)
    executor.add_node(source)
    most = 0
    for i in range(300):
        numbers.publish(Int32(data=i))
        if i % 3 == 2:
            for _ in range(4):
                executor.spin_once(timeout_sec=0.01)
            node.destroy_retired()
            most = max(most, node.retired)
    assert node.received > 50
    assert 0 < most < 60  # they do not pile up
    for _ in range(ROUNDS + 1):
        node.destroy_retired()
    assert node.retired == 0
    node.take(Int32(data=0))
    assert node.retired == 2
    executor.remove_node(node)
    executor.remove_node(source)
    for _ in range(3):
        executor.spin_once(timeout_sec=0.01)
    node.destroy_node()
    assert node.retired == 0
    source.destroy_node()
    executor.shutdown()
    context.try_shutdown()
