"""Faults as a running node meets them."""

import random
import signal
import time

import pytest
from hc_msgs.msg import EstimatorEvent, IndenterSample

from hc_msgs_py.conversion import fill_sample, new_sample_message
from hc_msgs_py.qos import SAMPLE_QOS

pytestmark = pytest.mark.process


def counters(probe):
    """The newest diagnostic values, by key."""
    return {v.key: v.value for v in probe.statuses[-1].values}


def test_silence_is_stale_and_samples_that_come_again_recover(start_process, probe, plant):
    process = start_process(input__silence_timeout=0.2)
    probe.wait_ready()
    number = probe.stream(plant.samples(500))
    probe.wait(
        lambda: probe.statuses and probe.statuses[-1].level == b"\x03", 2.0, "a stale status"
    )
    assert "no usable sample for " in probe.statuses[-1].message
    assert "no message on indenter/sample from /probe" in probe.statuses[-1].message
    assert float(counters(probe)["silent_s"]) > 0.1
    probe.wait(lambda: EstimatorEvent.INPUT_SILENT in probe.kinds(), what="silence")
    # The source comes back, numbers anew, and has a few bad readings.
    samples = [
        (t, float("inf") if i % 50 == 7 else float("nan") if i % 50 == 9 else d, f)
        for i, (t, d, f) in enumerate(plant.samples(500, start=2000))
    ]
    probe.stream(samples)
    probe.wait(lambda: len(probe.estimates) == number + 500, what="all estimates")
    kinds = probe.kinds()
    assert EstimatorEvent.INPUT_RECOVERED in kinds
    assert EstimatorEvent.SOURCE_RESTARTED in kinds
    assert sum(m.rejected == m.NOT_FINITE for m in probe.estimates) == 10
    probe.wait(lambda: counters(probe)["rejected_not_finite"] == "10", what="the count")
    assert counters(probe)["without_displacement"] == "10"
    assert counters(probe)["lost"] == "0"
    assert process.poll() is None


def test_two_publishers_are_an_error_and_the_first_keeps_the_floor(start_process, probe, plant):
    start_process()
    probe.wait_ready()
    number = probe.stream(plant.samples(300))
    intruder = probe.node.create_publisher(IndenterSample, "indenter/sample", SAMPLE_QOS)
    probe.wait(lambda: EstimatorEvent.SOURCE_CONFLICT in probe.kinds(), what="the conflict")
    message = new_sample_message()

    def publish_both(stamp_ns, sequence, displacement, force):
        probe.publish(stamp_ns, sequence, displacement, force)
        fill_sample(message, stamp_ns + 300_000, sequence + 10**9, 1.0, 99.0)
        intruder.publish(message)

    probe.stream(plant.samples(500, start=300), first=number, publish=publish_both)
    probe.wait(lambda: len(probe.estimates) >= 800, what="estimates")
    assert all(m.force_measured < 90.0 for m in probe.estimates)
    probe.wait(
        lambda: probe.statuses and probe.statuses[-1].level == b"\x02", what="an error status"
    )
    assert "2 publishers on indenter/sample" in probe.statuses[-1].message
    probe.node.destroy_publisher(intruder)
    probe.wait(lambda: probe.statuses[-1].level != b"\x02", what="the end of the error")


@pytest.mark.slow
def test_a_node_that_was_held_up_skips_to_the_latest_and_counts(start_process, probe, plant):
    process = start_process(input__maximum_backlog=5)
    probe.wait_ready()
    number = probe.stream(plant.samples(300))
    process.send_signal(signal.SIGSTOP)
    number = probe.stream(plant.samples(800, start=300), first=number, in_step=False)
    process.send_signal(signal.SIGCONT)
    number = probe.stream(plant.samples(300, start=1100), first=number, in_step=False)
    probe.wait(lambda: probe.estimates[-1].sequence == number - 1, what="the last estimate")
    probe.wait(lambda: EstimatorEvent.SAMPLES_SKIPPED in probe.kinds(), what="the event")
    newest = len(probe.statuses)
    probe.wait(lambda: len(probe.statuses) >= newest + 2, what="a status of after that")
    values = {key: int(counters(probe)[key]) for key in ("samples", "skipped", "lost")}
    assert values["skipped"] > 0
    # Nothing is counted twice: what was skipped is not lost as well.
    assert sum(values.values()) == number


@pytest.mark.slow
def test_a_node_that_falls_behind_says_so_drops_display_and_catches_up(start_process, probe, plant):
    """All data come out, in order, on the same clock; of the wrench only the newest."""
    from geometry_msgs.msg import WrenchStamped

    from hc_msgs_py.qos import ESTIMATE_QOS

    begin_ns = time.time_ns()

    def stream(count, first, **options):
        """Samples of the motion as it is now: a busy machine leaves gaps, no jumps."""
        start = (time.time_ns() - begin_ns) // 1_000_000
        samples = plant.samples(count, start=start)
        return probe.stream(samples, first=first, start_ns=begin_ns + start * 1_000_000, **options)

    wrenches = []
    probe.node.create_subscription(
        WrenchStamped, "hc/reconstructed_wrench", wrenches.append, ESTIMATE_QOS
    )
    process = start_process(input__maximum_backlog=2000)
    probe.wait_ready()
    number = stream(300, 0)
    probe.wait(lambda: wrenches, what="a wrench")
    process.send_signal(signal.SIGSTOP)
    number = stream(1200, number, in_step=False)
    revisions = len(probe.configurations)
    process.send_signal(signal.SIGCONT)
    number = stream(300, number, in_step=False)
    probe.wait(lambda: probe.estimates[-1].sequence == number - 1, what="the last estimate")
    assert [m.sequence for m in probe.estimates] == list(range(number))
    assert [(m.sequence, m.rejected) for m in probe.estimates if m.rejected] == []
    assert len(probe.configurations) == revisions
    assert not {EstimatorEvent.TIME_JUMP, EstimatorEvent.RESET} & set(probe.kinds())
    assert any("cannot keep up" in status.message for status in probe.statuses)
    probe.wait(lambda: int(counters(probe)["wrenches_left_out"]) > 500, what="the count")
    assert len(wrenches) < number - 500
    # It runs in step again: the newest estimates are young.
    assert max(m.latency for m in probe.estimates[300:1500]) > 0.5
    assert min(m.latency for m in probe.estimates[-50:]) < 0.5
    assert counters(probe)["skipped"] == counters(probe)["lost"] == "0"


@pytest.mark.slow
def test_simulated_time_may_jump_back_and_latency_follows_it(start_process, probe, plant):
    from rosgraph_msgs.msg import Clock

    from hc_msgs_py.units import set_stamp

    start_process(use_sim_time=True)
    clock = probe.node.create_publisher(Clock, "/clock", 10)
    probe.wait_ready()
    probe.wait(lambda: clock.get_subscription_count() > 0, what="the clock's subscriber")

    def publish(stamp_ns, sequence, displacement, force):
        now = Clock()
        set_stamp(now.clock, stamp_ns)
        clock.publish(now)
        probe.publish(stamp_ns, sequence, displacement, force)

    number = probe.stream(plant.samples(400), start_ns=5 * 10**9, publish=publish)
    probe.wait(lambda: len(probe.estimates) == 400, what="estimates")
    # Stamps five seconds after 1970: the wall clock would give a latency of decades.
    assert all(abs(m.latency) < 1.0 for m in probe.estimates)
    probe.stream(plant.samples(400), first=number, start_ns=10**9, publish=publish)
    probe.wait(lambda: len(probe.estimates) >= 795, what="estimates after the jump")
    assert EstimatorEvent.TIME_JUMP in probe.kinds()
    assert probe.configurations[-1].cause == probe.configurations[-1].TIME_JUMP
    assert all(m.rejected == 0 for m in probe.estimates[-390:])


@pytest.mark.slow
def test_a_gap_that_is_allowed_while_it_runs_is_no_jump_of_the_clock(start_process, probe, plant):
    """The step of simulated time that is a jump stayed that of the start."""
    from rosgraph_msgs.msg import Clock

    from hc_msgs_py.units import set_stamp

    start_process(use_sim_time=True)
    clock = probe.node.create_publisher(Clock, "/clock", 10)
    probe.wait_ready()
    probe.wait(lambda: clock.get_subscription_count() > 0, what="the clock's subscriber")
    assert probe.set(input__maximum_gap=600.0)[0].successful

    def publish(stamp_ns, sequence, displacement, force):
        now = Clock()
        set_stamp(now.clock, stamp_ns)
        clock.publish(now)
        probe.publish(stamp_ns, sequence, displacement, force)

    number = probe.stream(plant.samples(200), start_ns=10**9, publish=publish)
    probe.stream(plant.samples(200), first=number, start_ns=200 * 10**9, publish=publish)
    probe.wait(lambda: len(probe.estimates) == 400, what="estimates")
    assert EstimatorEvent.TIME_JUMP not in probe.kinds()


@pytest.mark.slow
def test_a_subscriber_that_never_reads_does_not_hold_it_up(start_process, probe, plant, domain_id):
    import rclpy
    from hc_msgs.msg import HuntCrossleyEstimate

    from hc_msgs_py.qos import ESTIMATE_QOS

    start_process()
    context = rclpy.Context()
    rclpy.init(args=[], context=context, domain_id=domain_id)
    deaf = rclpy.create_node("deaf", context=context, enable_rosout=False)
    deaf.create_subscription(HuntCrossleyEstimate, "hc/estimate", lambda _m: None, ESTIMATE_QOS)
    probe.wait_ready()
    probe.wait(lambda: probe.node.count_subscribers("hc/estimate") == 2, what="both subscribers")
    probe.stream(plant.samples(2500))  # more than any queue holds
    probe.wait(lambda: len(probe.estimates) == 2500, what="2500 estimates")
    deaf.destroy_node()
    context.try_shutdown()


@pytest.mark.slow
def test_rates_from_100_hz_to_4_khz_in_one_run(start_process, probe, make_plant):
    start_process()
    probe.wait_ready()
    number, start_ns = 0, time.time_ns()
    for rate_hz, duration_s in ((1000.0, 0.5), (100.0, 0.5), (4000.0, 0.5)):
        plant = make_plant(rate_hz=rate_hz)
        samples = plant.samples(int(rate_hz * duration_s))
        number = probe.stream(samples, rate_hz=rate_hz, first=number, start_ns=start_ns)
        start_ns += round(duration_s * 1e9)
    probe.wait(lambda: len(probe.estimates) >= 0.99 * number, what="estimates")
    assert all(m.stiffness_std < 10.0 for m in probe.estimates[-100:])


@pytest.mark.slow
def test_two_rigs_in_one_domain_are_told_apart_though_their_samples_look_alike(
    start_process, probe, plant
):
    """Numbers and stamps of the two interleave as those of two `hc run` do."""
    process = start_process()
    probe.wait_ready()
    number = probe.stream(plant.samples(300))
    intruder = probe.node.create_publisher(IndenterSample, "indenter/sample", SAMPLE_QOS)
    probe.wait(lambda: intruder.get_subscription_count() > 0, what="the second match")
    message = new_sample_message()

    def publish_both(stamp_ns, sequence, displacement, force):
        probe.publish(stamp_ns, sequence, displacement, force)
        fill_sample(message, stamp_ns + 300_000, sequence + 3, 1.0, 99.0)
        intruder.publish(message)

    number = probe.stream(plant.samples(1500, start=300), first=number, publish=publish_both)
    probe.wait(lambda: len(probe.estimates) >= 1800, what="estimates")
    assert [m.sequence for m in probe.estimates] == list(range(1800))
    assert all(m.force_measured < 90.0 for m in probe.estimates)
    probe.wait(lambda: probe.statuses[-1].level == b"\x02", what="an error status")
    text = probe.statuses[-1].message
    assert (
        "2 publishers on indenter/sample (/probe, /probe): follows the one that was first" in text
    )
    assert "ROS_DOMAIN_ID" in text
    foreign = "messages of other publishers on indenter/sample"
    probe.wait(lambda: counters(probe)[foreign] == "1500", what="the count of the other's messages")
    assert counters(probe)["lost"] == counters(probe)["strays"] == "0"

    # The first one falls silent but stays: the other has the floor from then on.
    probe.spin(0.4)

    def publish_other(stamp_ns, sequence, displacement, force):
        fill_sample(message, stamp_ns, sequence + 3, displacement, force)
        intruder.publish(message)

    probe.stream(plant.samples(300, start=2200), first=number, publish=publish_other)
    probe.wait(lambda: len(probe.estimates) >= 2100, what="estimates of the other")
    assert process.poll() is None


@pytest.mark.slow
def test_what_is_wrong_with_stamps_numbers_and_bytes_is_said(start_process, probe, plant):
    process = start_process(input__silence_timeout=0.2)
    probe.wait_ready()
    generator = random.Random(2)

    def told(words, publish, rounds=400):
        """Publish at 1 kHz until the status says the words."""
        known = len(probe.statuses)
        end = time.monotonic() + 30.0
        number = 0
        while not any(words in s.message for s in probe.statuses[known + 1 :]):
            assert time.monotonic() < end, (words, [s.message for s in probe.statuses[known:]])
            samples = plant.samples(rounds, start=number)
            number = probe.stream(samples, first=number, publish=publish, in_step=False)
        return next(s for s in probe.statuses[known + 1 :] if words in s.message)

    def undecodable(*_sample):
        probe.samples.publish(b"\0\1\0\0 this is no sample")

    def without_stamp(_stamp_ns, sequence, displacement, force):
        probe.publish(0, sequence, displacement, force)

    def random_stamp(_stamp_ns, sequence, displacement, force):
        probe.publish(generator.randrange(2**60), sequence, displacement, force)

    def one_stamp(_stamp_ns, sequence, displacement, force):
        probe.publish(1_700_000_000_000_000_000, sequence, displacement, force)

    def random_number(stamp_ns, _sequence, displacement, force):
        probe.publish(stamp_ns, generator.getrandbits(64), displacement, force)

    assert told("messages that cannot be decoded", undecodable).message.startswith(
        "waits for the first sample: "
    )
    probe.stream(plant.samples(300))
    status = told("messages that cannot be decoded", undecodable)
    assert (status.level, status.message[:20]) == (b"\x02", "no usable sample for")
    status = told("with stamp zero: let the source fill header.stamp", without_stamp)
    assert status.level == b"\x02"
    status = told("samples whose stamps jump (by up to ", random_stamp)
    assert status.level == b"\x02"
    told("samples with one and the same stamp", one_stamp)
    made = len(probe.estimates)
    status = told("the numbers of the samples are no count: losses cannot be told", random_number)
    assert status.level == b"\x01"
    assert int({v.key: v.value for v in status.values}["lost"]) < 5000
    assert len(probe.estimates) > made + 300
    assert process.poll() is None


@pytest.mark.slow
def test_a_topic_that_nobody_publishes_or_with_another_type_is_named(start_process, probe):
    start_process(
        input__source="sensors",
        input__force__topic="wrist",
        input__position__topic="arm",
        input__position__type="pose",
    )
    probe.wait(lambda: probe.statuses, what="a status")
    probe.node.create_publisher(IndenterSample, "arm", SAMPLE_QOS)
    probe.wait(
        lambda: (
            "nobody publishes wrist; arm is geometry_msgs/msg/PoseStamped here, but is "
            "published by /probe (hc_msgs/msg/IndenterSample)" in probe.statuses[-1].message
        ),
        what="the two reasons",
    )
    probe.wait(lambda: probe.statuses[-1].level == b"\x01", what="a warning")


@pytest.mark.slow
def test_a_force_that_pulls_for_push_is_told_in_status_and_events(start_process, probe, plant):
    start_process(filter="ukf")
    probe.wait_ready()
    samples = [(t, d, -f) for t, d, f in plant.samples(6000)]
    probe.stream(samples)
    probe.wait(lambda: EstimatorEvent.INPUT_SUSPECT in probe.kinds(), what="the suspicion")
    (event,) = [e for e in probe.events if e.kind == EstimatorEvent.INPUT_SUSPECT]
    assert "turn its sign (force.sign)" in event.reason
    assert any("turn its sign (force.sign)" in s.message for s in probe.statuses)


@pytest.mark.slow
def test_the_end_of_a_range_is_told_with_the_limit_until_that_is_set(start_process, probe, plant):
    """Regression of 2026-11-26: a force in steps was not seen to end, and K was wrong unsaid."""
    start_process(filter="ukf")
    probe.wait_ready()
    samples = [(t, d, round(min(f, 2.0), 3)) for t, d, f in plant.samples(6000)]
    number = probe.stream(samples)
    probe.wait(lambda: EstimatorEvent.INPUT_SUSPECT in probe.kinds(), what="the suspicion")
    (event,) = [e for e in probe.events if e.kind == EstimatorEvent.INPUT_SUSPECT]
    assert "the force stays at 2 N, its largest value, in " in event.reason
    assert event.reason.endswith("set force_limit 1.98, just below")
    assert "suspect: saturation of force" in counters(probe)
    assert probe.set(force_limit=1.98)[0].successful
    samples = [(t, d, round(min(f, 2.0), 3)) for t, d, f in plant.samples(8000, start=6000)]
    probe.stream(samples, first=number)
    probe.wait(lambda: "suspect: saturation of force" not in counters(probe), what="no doubt")
    refused = sum(f > 1.98 for _t, _d, f in samples)
    probe.wait(lambda: int(counters(probe)["rejected_out_of_range"]) >= refused, what="the count")
