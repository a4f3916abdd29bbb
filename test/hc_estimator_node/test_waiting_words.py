"""What the node says of the topics that it waits for."""

from types import SimpleNamespace

from hc_estimator.ros.inputs import missing_publishers


def test_a_topic_of_another_type_is_no_topic_without_a_publisher():
    """Regression: "/wrench has 0 of 1 publishers" for as long as one waited, of a Twist."""
    wrench = SimpleNamespace(
        topic="/wrench",
        type_name="geometry_msgs/msg/WrenchStamped",
        publishers=0,
        publisher_names=["/arm (geometry_msgs/msg/Twist)"],
    )
    pose = SimpleNamespace(topic="/pose", type_name="", publishers=0, publisher_names=[])
    there = SimpleNamespace(topic="/joints", type_name="", publishers=1, publisher_names=["/arm"])
    assert missing_publishers([wrench, pose, there], 1) == [
        "/wrench is geometry_msgs/msg/WrenchStamped here, but is published by "
        "/arm (geometry_msgs/msg/Twist)",
        "/pose has 0 of 1 publishers",
    ]
