"""The node array_estimator, and the stream of a tactile array behind it."""

import threading

import numpy as np
import pytest
import rclpy
from hc_msgs.msg import TactileEstimate
from rclpy.executors import SingleThreadedExecutor
from rclpy.serialization import deserialize_message

from hc_estimator import EstimatorArray
from hc_estimator.ros.array_node import ArrayEstimatorNode
from hc_estimator.stream.array_status import ArrayHealth, Effort
from hc_estimator.stream.array_stream import ArrayStream
from hc_msgs_py.qos import ESTIMATE_QOS

COUNTS = ("received", "late", "strays", "restarts", "undecodable", "skipped")
START = 1_700_000_000_000_000_000
MS = 1_000_000


def make(taxels):
    return EstimatorArray("ekf", taxels)


@pytest.fixture
def stream():
    return ArrayStream(make, maximum_gap_s=60.0)


def readings(number, taxels=3):
    depth = 2.0 + np.sin(0.01 * number)
    return np.full(taxels, depth), 0.2 * np.arange(1, taxels + 1) * depth**1.5


def feed(stream, numbers, taxels=3, shift_ns=0):
    return [stream.take(START + shift_ns + n * MS, n, *readings(n, taxels)) for n in numbers]


def test_the_numbers_are_those_of_the_array_alone(stream):
    series = feed(stream, range(200))
    alone = make(3)
    for number, estimates in enumerate(series):
        expected = alone.step(number * MS * 1e-9, *readings(number))
        np.testing.assert_array_equal(estimates.parameters, expected.parameters)
    assert (stream.received, stream.used, stream.lost, stream.restarts) == (200, 200, 0, 0)


def test_losses_are_counted_and_late_samples_left_out(stream):
    feed(stream, [0, 1, 2, 7, 8])
    assert stream.lost == 4
    assert feed(stream, [6, 8]) == [None, None]
    assert (stream.late, stream.used) == (2, 5)


def test_samples_that_the_node_skipped_are_not_lost_as_well(stream):
    """Regression: each was counted twice, as skipped by the node and as lost by the stream."""
    feed(stream, [0, 1])
    stream.expect_gap(4)
    feed(stream, [6, 7])
    assert stream.lost == 0
    stream.expect_gap(1)
    feed(stream, [10, 13])
    assert stream.lost == 1 + 2


def test_late_samples_are_used_in_their_place_if_the_settings_say_so():
    """`reorder_window` did nothing: what came late was left out before the estimators saw it."""
    settings = {"missing_readings": True, "reorder_window": 0.2}
    stream = ArrayStream(lambda taxels: EstimatorArray("ekf", taxels, **settings), maximum_gap_s=9)
    feed(stream, [n for n in range(300) if n != 250])
    [late] = feed(stream, [250])
    assert (stream.late, stream.used, stream.restarts) == (0, 300, 0)
    alone = make(3)
    for number in range(300):
        expected = alone.step(number * MS * 1e-9, *readings(number))
    np.testing.assert_array_equal(late.parameters, expected.parameters)


@pytest.mark.parametrize("shift_s", [-30, 120])
def test_a_jump_of_the_stamps_starts_afresh(stream, shift_s):
    feed(stream, range(100))
    stray, estimates = feed(stream, [100, 101], shift_ns=shift_s * 10**9)
    assert stray is None
    assert "jumped" in stream.fresh.reason
    assert (stream.restarts, stream.strays) == (1, 1)
    expected = make(3).step(0.0, *readings(101))
    np.testing.assert_array_equal(estimates.parameters, expected.parameters)


def test_one_stamp_that_is_wrong_costs_one_sample(stream):
    """What was learnt under all taxels was forgotten, and again with the next stamp."""
    feed(stream, range(100))
    assert stream.take(0, 100, *readings(100)) is None
    [estimates] = feed(stream, [101])
    assert (stream.restarts, stream.strays, stream.fresh) == (0, 1, None)
    alone = make(3)
    for number in [*range(100), 101]:
        expected = alone.step(number * MS * 1e-9, *readings(number))
    np.testing.assert_array_equal(estimates.parameters, expected.parameters)


def test_another_number_of_taxels_starts_afresh(stream):
    feed(stream, range(10))
    [estimates] = feed(stream, [10], taxels=5)
    assert len(estimates) == stream.taxels == 5
    assert "5 taxels instead of 3" in stream.fresh.reason


def status_of(stream, health, **other):
    names = ("received", "late", "strays", "restarts")
    counts = {name: getattr(stream, name) for name in names}
    silent_s = other.pop("silent_s", 0.0)
    counts |= {"undecodable": 0, "skipped": 0} | other
    afresh = "" if stream.fresh is None else stream.fresh.reason
    found = health.problems(counts, silent_s=silent_s, afresh=afresh)
    health.begin_anew()
    return "; ".join(found)


def test_samples_left_out_lead_to_what_takes_less_time(stream):
    """Only "cannot keep up: 718 samples left out" was said."""
    counts = dict.fromkeys(COUNTS, 0) | {"skipped": 718}
    for plainer, ends in (("ukf", "take a plainer filter (ukf), more threads,"), ("", "take more")):
        effort = Effort(256, "self_tuning_ukf", 0.00234, plainer)
        [said] = ArrayHealth().problems(counts, silent_s=0.0, afresh="", effort=effort)
        assert said.startswith(
            "cannot keep up: 718 samples left out, for 256 taxels take 2.3 ms a sample with "
            f"self_tuning_ukf: {ends}"
        )


def feed_to(health, stream, numbers, spoil=lambda depth, force: None, **options):
    for number in numbers:
        depth, force = readings(number, options.get("taxels", 3))
        spoil(depth, force)
        stamp_ns = options.get("stamp_ns", START + number * MS)
        series = stream.take(stamp_ns, number, depth, force)
        if series is not None:
            health.add(series.rejected)


def test_what_is_wrong_with_the_stream_is_said_and_only_while_it_is(stream):
    """Regression: "estimating", with stamps of zero, messages of no use, or nothing at all."""
    health = ArrayHealth()
    assert health.problems(dict.fromkeys(COUNTS, 0), silent_s=None, afresh="") == []
    feed_to(health, stream, range(100))
    assert status_of(stream, health) == ""
    feed_to(health, stream, range(100, 200), stamp_ns=0)
    assert status_of(stream, health).startswith("100 samples left out, whose stamps are zero")
    assert "7 samples that cannot be read" in status_of(stream, health, undecodable=7)
    assert "no sample for 3 s" in status_of(stream, health, undecodable=7, silent_s=3.0)
    for number in range(200, 301):
        feed_to(health, stream, [number], taxels=3 + number % 2)
    assert "started afresh 100 times since the last status (3 taxels instead of 4)" in status_of(
        stream, health, undecodable=7
    )
    feed_to(health, stream, range(301, 400))
    assert status_of(stream, health, undecodable=7) == ""


def test_taxels_without_a_reading_are_named(stream):
    def spoil(depth, force):
        force[1] = np.nan
        depth[2] = 1e300

    def mend_one(depth, force):
        depth[2] = 1e300

    health = ArrayHealth()
    feed_to(health, stream, range(50), spoil)
    assert health.without_reading == 2
    assert "2 of 3 taxels give no reading" in status_of(stream, health)
    feed_to(health, stream, range(50, 99), spoil)
    feed_to(health, stream, [99], mend_one)
    assert "1 of 3 taxels give no reading (NaN, infinite or beyond the limits): 2, cou" in (
        status_of(stream, health)
    )


@pytest.fixture
def executor(ros_domain, monkeypatch):
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    rclpy.init(args=[], domain_id=ros_domain)
    yield SingleThreadedExecutor()
    rclpy.try_shutdown()


def test_the_node_answers_while_the_filter_is_compiled(executor, monkeypatch):
    compiled = threading.Event()
    monkeypatch.setattr(EstimatorArray, "warm_up", lambda _array: compiled.wait(60.0))
    node = ArrayEstimatorNode()
    try:
        executor.add_node(node)
        for _ in range(5):  # looks whether it is done
            node._begin()
        assert node._missing() == ["starting: compiling the filter, 0 of 1 done"]
        assert node._collect().message == node._missing()[0]
        assert node.count_subscribers("tactile/sample") == 0
        compiled.set()
        node._compilation.wait()
        while node._channel is None:
            executor.spin_once(timeout_sec=0.1)
        assert node._missing() == ["tactile/sample has 0 of 1 publishers"]
        assert node.count_subscribers("tactile/sample") == 1
    finally:
        compiled.set()
        node.close()
        node.destroy_node()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["settings:=[force_noise=0.1]"], "parameter force_noise = 0.1 is unknown here"),
        (["settings:=[force_noise_std=-1.0]"], "force_noise_std = -1.0"),
    ],
)
def test_what_cannot_be_is_refused_before_anything_is_compiled(
    words, said, ros_domain, monkeypatch
):
    monkeypatch.setattr(EstimatorArray, "__init__", lambda *_, **__: pytest.fail("compiles"))
    arguments = ["--ros-args", *(part for word in words for part in ("-p", word))]
    rclpy.init(args=arguments, domain_id=ros_domain)
    try:
        with pytest.raises(ValueError, match=said):
            ArrayEstimatorNode()
    finally:
        rclpy.try_shutdown()


@pytest.mark.slow
@pytest.mark.process
def test_the_rig_and_the_node_find_the_lump(start_process, end_process, probe):
    estimates = []
    probe.node.create_subscription(
        TactileEstimate,
        "tactile/estimate",
        lambda data: estimates.append(deserialize_message(data, TactileEstimate)),
        ESTIMATE_QOS,
        raw=True,
    )
    node = start_process("hc_estimator.ros.array_node", filter="ekf")
    rig = start_process("hc_sim_rig.node", scenario="taxels")
    probe.wait(lambda: len(estimates) > 1500, 90.0, "estimates of taxels")
    message = estimates[-1]
    assert len(message.stiffness) == 64
    assert (message.columns, message.header.frame_id) == (8, "tactile_pad")
    force = np.array(message.force_reconstructed).reshape(8, 8)
    assert np.unravel_index(force.argmax(), force.shape) in [(3, 4), (3, 5)]
    stiffness = np.array(message.stiffness).reshape(8, 8)
    assert stiffness[3, 4] > 2.0 * stiffness[7, 0]
    assert end_process(rig) == (0, "", "")
    assert end_process(node)[0] == 0
