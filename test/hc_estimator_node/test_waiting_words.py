"""What the node says of the topics that it waits for."""

from collections import defaultdict
from types import SimpleNamespace

from hc_estimator.ros.inputs import missing_publishers
from hc_estimator.ros.status import _reasons


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


def test_messages_of_which_no_sample_can_be_made_are_said_to_come():
    """Regression: stamps in milliseconds were "does anybody publish samples?"."""
    names = {"publisher_names": ["/arm"], "type_name": "", "publishers": 1}
    source = SimpleNamespace(
        channels=[SimpleNamespace(topic=topic, **names) for topic in ("/wrench", "/pose")]
    )
    since = defaultdict(int, {"/wrench": 1000, "/pose": 100})
    (reason,) = _reasons(since, source, 0, fruitless=True)
    assert reason.startswith("messages come on /wrench and /pose and make no sample")
    assert "--field header.stamp" in reason
    assert _reasons(since, source, 0, fruitless=False) == []  # it has just become active
    silent = defaultdict(int, {"/wrench": 1000})
    assert _reasons(silent, source, 0, fruitless=False) == ["no message on /pose from /arm"]
    refused = defaultdict(int, since | {"repeated_stamps": 7})
    assert _reasons(refused, source, 0, fruitless=True) == ["7 samples with one and the same stamp"]
