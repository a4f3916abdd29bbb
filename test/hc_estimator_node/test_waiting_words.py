"""What the node says of the topics that it waits for."""

from types import SimpleNamespace

from hc_estimator.ros.inputs import missing_publishers


def test_a_publisher_that_does_not_match_is_not_said_to_be_none():
    """Regression: "/wrench has 0 of 1 publishers" for as long as one waited, of a Twist."""
    wrench = SimpleNamespace(
        topic="/wrench",
        type_name="geometry_msgs/msg/WrenchStamped",
        publishers=0,
        publisher_names=["/arm (geometry_msgs/msg/Twist)"],
    )
    pose = SimpleNamespace(topic="/pose", type_name="", publishers=0, publisher_names=[])
    cell = SimpleNamespace(topic="/cell", type_name="", publishers=0, publisher_names=["/daq"])
    there = SimpleNamespace(topic="/joints", type_name="", publishers=1, publisher_names=["/arm"])
    assert missing_publishers([wrench, pose, cell, there], 1) == [
        "/wrench is geometry_msgs/msg/WrenchStamped here, but is published by "
        "/arm (geometry_msgs/msg/Twist)",
        "/pose has 0 of 1 publishers",
        "/cell is published by /daq with a quality of service that does not fit: "
        "qos_overrides./cell.subscription, and hc topic info /cell -v",
    ]
