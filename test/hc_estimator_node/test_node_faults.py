"""Faults as a running node meets them."""

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
    probe.wait(lambda: EstimatorEvent.INPUT_SILENT in probe.kinds(), what="silence")
    probe.wait(
        lambda: probe.statuses and probe.statuses[-1].level == b"\x03", what="a stale status"
    )
    # The source comes back, numbers anew, and has a few bad readings.
    samples = [
        (t, float("nan") if i % 50 == 7 else d, f)
        for i, (t, d, f) in enumerate(plant.samples(500, start=2000))
    ]
    probe.stream(samples)
    probe.wait(lambda: len(probe.estimates) == number + 500, what="all estimates")
    kinds = probe.kinds()
    assert EstimatorEvent.INPUT_RECOVERED in kinds
    assert EstimatorEvent.SOURCE_RESTARTED in kinds
    assert sum(m.rejected == m.NOT_FINITE for m in probe.estimates) == 10
    probe.wait(lambda: counters(probe)["rejected_not_finite"] == "10", what="the count")
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


def test_a_node_that_was_held_up_skips_to_the_latest_and_counts(start_process, probe, plant):
    process = start_process(input__maximum_backlog=5)
    probe.wait_ready()
    number = probe.stream(plant.samples(300))
    process.send_signal(signal.SIGSTOP)
    number = probe.stream(plant.samples(800, start=300), first=number, in_step=False)
    process.send_signal(signal.SIGCONT)
    number = probe.stream(plant.samples(300, start=1100), first=number, in_step=False)
    probe.wait(lambda: probe.estimates[-1].sequence == number - 1, what="the last estimate")
    assert EstimatorEvent.SAMPLES_SKIPPED in probe.kinds()
    newest = len(probe.statuses)
    probe.wait(lambda: len(probe.statuses) >= newest + 2, what="a status of after that")
    values = {key: int(counters(probe)[key]) for key in ("samples", "skipped", "lost")}
    assert values["skipped"] > 0
    # Nothing is counted twice: what was skipped is not lost as well.
    assert sum(values.values()) == number


def test_simulated_time_may_jump_back_and_latency_follows_it(start_process, probe, plant):
    from rosgraph_msgs.msg import Clock

    from hc_msgs_py.units import stamp_from_nanoseconds

    start_process(use_sim_time=True)
    clock = probe.node.create_publisher(Clock, "/clock", 10)
    probe.wait_ready()
    probe.wait(lambda: clock.get_subscription_count() > 0, what="the clock's subscriber")

    def publish(stamp_ns, sequence, displacement, force):
        clock.publish(Clock(clock=stamp_from_nanoseconds(stamp_ns)))
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
