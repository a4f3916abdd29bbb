"""What the node says of samples that it makes of sensors itself, and where a contact was."""

from types import SimpleNamespace

import numpy as np
import pytest

from hc_estimator import create_estimator
from hc_estimator.ros.channel import is_replayed
from hc_estimator.ros.inputs import publisher_conflict
from hc_estimator.ros.sample_flow import SampleFlow
from hc_estimator.ros.status import StatusReporter
from hc_estimator.stream.session import EstimationSession
from hc_estimator.stream.vocabulary import Cause, Revision
from hc_msgs_py.diagnostics import Level

ZEROS = {
    "input.force.zero": 1.5,
    "input.position.zero": 400.0,
    "input.position.frame_compliance": 0.002,
}


def node(source):
    """A node as far as a sample flows through it; keeps what it publishes."""
    flow = SampleFlow()
    flow.said, flow.ages = [], []
    flow._settings = SimpleNamespace(values={"input.source": source, **ZEROS})
    flow._session = SimpleNamespace(loaded=None, estimator=None)
    flow._outputs = SimpleNamespace(
        publish_configuration=lambda revision, estimator, zeros, loaded: flow.said.append(zeros)
    )
    flow._keeper = SimpleNamespace(hasten=lambda: None, on_trial=False)
    flow._status = SimpleNamespace(add_latency=lambda _: None)
    flow._suspicions = SimpleNamespace(
        add=lambda *_: None,
        add_latency=lambda _, live: flow.ages.append(live),
        looking=False,
    )
    flow._zeros = SimpleNamespace(add=lambda *_: None)
    flow._diagnostics = SimpleNamespace(due=False)
    return flow


@pytest.mark.parametrize(("source", "own"), [("sample", 0), ("sensors", 1), ("effort", 1)])
def test_zeros_that_were_taken_off_are_not_recorded_to_be_taken_off_again(source, own):
    """`hc estimate --verify` took them off a second time of samples made of a motor's effort."""
    flow = node(source)
    flow.on_revision(Revision(1, 0, 0, Cause.STARTED))
    # Samples that are less a compliance look like any others: it is said.
    already = {"input.position.frame_compliance.taken_off": 0.002}
    assert flow.said == [already if own else ZEROS]
    flow._settings.values |= {"input.position.held": True, "input.force.held": False}
    flow.on_revision(Revision(2, 0, 0, Cause.RESET))
    held = {"input.position.held": True} if source == "sensors" else {}
    assert flow.said[1] == (already | held if own else ZEROS)
    friction = {"input.force.dry_friction": 0.3, "input.force.presliding": 0.05}
    flow._settings.values |= friction
    flow.on_revision(Revision(3, 0, 0, Cause.RESET))
    less = {"input.force.dry_friction.taken_off": 0.3} if source == "sensors" else {}
    assert flow.said[2] == (already | less | held if own else ZEROS | friction)
    flow._add_latency(5)
    assert flow.ages == [bool(own)]  # sensors speak now, samples may come out of a bag


@pytest.mark.parametrize(
    ("names", "replayed"),
    [
        ((["/player"], ["/player"]), True),
        ((["/left/rosbag2_player"], []), True),
        ((["/player"], ["/ur_driver"]), False),
        ((["/ur_driver", "/player"],), False),
        ((["/media_player"],), False),
        ((["/player (std_msgs/msg/Float64)"],), False),
        (([], []), False),
    ],
)
def test_sensors_that_a_player_publishes_may_be_as_old_as_they_are(names, replayed):
    """Regression: during `hc replay` the samples were "366 s old: use PTP or chrony"."""
    channels = [SimpleNamespace(publisher_names=published) for published in names]
    assert is_replayed(channels) is replayed
    flow = node("sensors")
    flow._replayed = is_replayed(channels)
    flow._add_latency(5)
    assert flow.ages == [not replayed]


def test_a_contact_is_where_the_tool_first_touched(recorder):
    """It was where the tool had slid to by the time that the contact counted, 50 ms later."""
    flow = node("sensors")
    flow._session = EstimationSession(create_estimator("ekf"), recorder)
    flow._session.start()
    for k in range(400):
        depth_mm = 0.02 * (k - 200)
        flow._input = SimpleNamespace(position=((1e-4 * k, 0.0, 0.0), "base"), channels=())
        flow.on_sample(10**18 + 10**6 * k, k, depth_mm, 0.3 * max(depth_mm, 0.0) ** 1.5)
    contact = flow._session.contacts.current
    assert contact is not None
    assert contact.position_frame_id == "base"
    first = contact.first_sequence
    assert contact.position_m[0] == pytest.approx(1e-4 * first)
    assert abs(first - 200) < 5


class Topic:
    """A channel with publishers, and messages that came on it."""

    topic, maximum_backlog, speaking, most_waiting = "arm", 3, 2, 1
    publisher_names = ("/a", "/b")
    lines = SimpleNamespace(foreign=0, lost=0)

    def __init__(self, *, crowded=False, received=0):
        self.publishers, self.crowded, self.received = 2, crowded, received


def source_of(channel, **counters):
    return SimpleNamespace(
        channels=(channel,), problems=(), doubts=(), counters=counters, undecodable=0
    )


@pytest.fixture
def reporter(recorder):
    session = EstimationSession(create_estimator("ekf"), recorder)
    session.start()
    return StatusReporter(session)


def test_an_input_that_gave_way_to_another_leaves_no_negative_counts(reporter):
    """Another topic was named: "-50 messages without the joint"."""
    reporter.collect(source_of(Topic(received=50), joint_missing=50), ())
    status = reporter.collect(source_of(Topic(received=2), joint_missing=2), ())
    assert "2 messages without the joint" in status.message
    assert "-" not in status.message


def test_a_message_that_is_dealt_with_at_once_is_no_backlog(reporter, recorder):
    """Where three may wait, every single message was "cannot keep up"."""
    for k, force in enumerate(np.linspace(0.1, 0.2, 20)):
        reporter._session.process(10**18 + 10**6 * k, k, 1.0 + 0.01 * k, float(force))
    channel = Topic(received=20)
    assert reporter.collect(source_of(channel), ()).message == "estimating"
    channel.most_waiting = 2
    assert "cannot keep up" in reporter.collect(source_of(channel), ()).message


@pytest.mark.parametrize(("count", "told"), [(7, True), (1, False)])
def test_forces_that_are_no_numbers_are_called_that(reporter, count, told):
    """Regression: "the force comes at 333.4 Hz on average ...: readings are lost or late"."""
    for k, force in enumerate(np.linspace(0.1, 0.2, 20)):
        reporter._session.process(10**18 + 10**6 * k, k, 1.0 + 0.01 * k, float(force))
    status = reporter.collect(source_of(Topic(received=20), force_not_finite=count), ())
    assert (f"{count} forces that are no numbers (NaN): the sensor" in status.message) is told


@pytest.mark.parametrize("crowded", [False, True])
def test_several_publishers_are_told_where_one_is_followed(reporter, crowded):
    """Of /tf everybody is heard, and it has many: that is no conflict."""
    channel = Topic(crowded=crowded)
    status = reporter.collect(source_of(channel), ())
    assert ("2 publishers on arm" in status.message) is crowded
    assert (status.level == Level.ERROR) is crowded
    assert bool(publisher_conflict([channel])) is crowded
