"""Which pair of sensors `hc setup` proposes where there are several, and by whose clock they go."""

import time

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from rosgraph_msgs.msg import Clock

from hc_bringup.errors import UserError
from hc_bringup.robot_streams import Stream, _Arrival, _rate, unusable
from hc_bringup.sensor_choice import Choice, best
from hc_bringup.simulated_clock import ClockListener

FORCE, PLACE = ("wrench", "effort"), ("pose", "transform", "tf", "joint")
LEFT, RIGHT = (
    Stream(f"/{side}/ft/wrench", "wrench", 500.0, f"{side}_ft") for side in ("left", "right")
)


def frames(*names):
    return [Stream("/tf", "tf", 125.0, "base", name) for name in names]


@pytest.mark.parametrize("force", [LEFT, RIGHT])
def test_each_of_two_arms_gets_its_own_tool(force):
    """Regression: the wrench of the left arm was recorded beside the tool of the right one."""
    side = force.frame.removesuffix("_ft")
    told = best([LEFT, RIGHT, *frames("right_tool0", "left_tool0")], PLACE, force)
    assert told is not None
    assert told.child == f"{side}_tool0"
    rates = {"right": 125.0, "left": 90.0}
    poses = [Stream(f"/{s}/pose", "pose", rate, "world") for s, rate in rates.items()]
    told = best([*poses, force], PLACE, force)
    assert told is not None
    assert told.topic == f"/{side}/pose"
    told = best([LEFT, RIGHT], FORCE, poses[side == "left"])
    assert told is force


def test_where_no_name_tells_the_fastest_and_the_first_frame_are_proposed():
    wrench = Stream("/ft_sensor/wrench", "wrench", 500.0, "ft")
    poses = [Stream("/slow", "pose", 40.0, "base"), Stream("/fast", "pose", 500.0, "base")]
    assert best(poses, PLACE, wrench) == poses[1]
    assert best(poses, PLACE) == poses[1]
    of_tf = frames("tool0", "camera")
    assert best(of_tf, PLACE, wrench) == of_tf[0]
    assert best([poses[0]._replace(rate_hz=0.0)], PLACE, wrench) is None


def came(stamps, arrivals=None):
    pairs = zip(stamps, stamps if arrivals is None else arrivals, strict=True)
    return [_Arrival(arrived, stamp, "ft", False) for stamp, arrived in pairs]


def in_bursts(rate_hz, together, own_stamp, seconds=1.5):
    """Readings that are handed out so many at a time, each 20 us after the one before."""
    numbers = np.arange(int(rate_hz * seconds))
    last = numbers // together * together + together - 1
    arrivals = last / rate_hz + 20e-6 * (numbers % together)
    return came(arrivals if own_stamp else last / rate_hz, arrivals)


@pytest.mark.parametrize("own_stamp", [True, False])
@pytest.mark.parametrize(("rate_hz", "together"), [(1000, 8), (500, 4), (4000, 64), (125, 2)])
def test_the_rate_of_packets_is_that_of_their_readings(rate_hz, together, own_stamp):
    """Regression: `hc setup` told "/rob/wrench (wrench): 24385 Hz" of packets at 1 kHz."""
    assert _rate(in_bursts(rate_hz, together, own_stamp)) == pytest.approx(rate_hz, rel=0.01)


def test_the_rate_of_even_readings_is_told_through_stalls_and_losses():
    stamps = 0.002 * np.arange(750)
    arrivals = stamps.copy()
    arrivals[100:400] = np.maximum(stamps[100:400], stamps[399])  # handed out late, in one go
    assert _rate(came(stamps, arrivals)) == pytest.approx(500.0)
    assert _rate(came(np.r_[stamps[:200], stamps[500:]])) == pytest.approx(500.0)
    assert _rate(came(np.zeros(750), stamps)) == pytest.approx(500.0)
    assert _rate(came([1.0, 1.5, 2.0])) == pytest.approx(2.0)
    assert _rate(came([1.0])) == 1.0
    assert _rate([]) == 0.0


class OneSubscription:
    """A graph whose node hands out what listens."""

    def __init__(self):
        self.node = self
        self.take = None

    def create_subscription(self, _kind, topic, take, _qos):
        assert topic == "/clock"
        self.take = take
        return take

    def destroy_subscription(self, subscription):
        assert subscription == self.take
        self.take = None


@pytest.mark.parametrize(
    ("clock_s", "stamp_s", "simulated"),
    [
        (12.0, 12.004, True),  # a simulation that counts from its start
        (None, 12.004, False),  # the same, and nobody publishes /clock
        (12.0, "now", False),  # a driver that stamps by the computer's clock beside a simulation
        ("now", "now", False),  # a simulation at the computer's own time needs nothing
    ],
)
def test_what_is_stamped_by_the_clock_of_a_simulation(clock_s, stamp_s, simulated):
    graph, now_ns = OneSubscription(), time.time_ns()
    stamp_ns, clock_ns = (now_ns if s == "now" else int((s or 0) * 1e9) for s in (stamp_s, clock_s))
    listener = ClockListener(graph)
    listener.stamped(stamp_ns)
    if clock_s is not None:
        seconds, rest = divmod(clock_ns, 10**9)
        graph.take(Clock(clock=Time(sec=seconds, nanosec=rest)))
    listener.stamped(stamp_ns)
    assert listener.is_followed == simulated
    listener.close()
    assert graph.take is None


class OneTopic:
    """A graph in which a microcontroller publishes."""

    def topics(self):
        return [("/encoder", ("std_msgs/msg/Float32",)), ("/tf_static", ("std_msgs/msg/Int32",))]


def test_readings_without_a_time_are_named_with_what_helps():
    """Regression: "is the robot's driver running?", of topics that had just been listed."""
    others = unusable(OneTopic())
    assert list(others) == ["/encoder"]
    choice = Choice([], others)
    with pytest.raises(UserError, match="has a node that stamps them") as raised:
        choice.proposed(None, None)
    assert "driver running" not in str(raised.value)
    with pytest.raises(UserError, match=r"/encoder .*Float32.: carries no time"):
        choice.given("encoder", "position")
    with pytest.raises(UserError, match="is the robot's driver running"):
        Choice([], {}).proposed(None, None)
    with pytest.raises(UserError, match="there is no force topic /wrench; there are: /left/ft"):
        Choice([LEFT], others).given("wrench", "force")
