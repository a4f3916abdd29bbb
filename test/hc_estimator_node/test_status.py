"""What /diagnostics says of the channels: a value and its deviation, where the filter says them."""

from types import SimpleNamespace

import numpy as np
import pytest

from hc_estimator import create_estimator
from hc_estimator.ros.status import StatusReporter
from hc_estimator.stream.session import EstimationSession
from hc_msgs_py.diagnostics import Level

NOWHERE = SimpleNamespace(channels=(), problems=(), doubts=(), counters={}, undecodable=0)
LATE_MS = 20


def status_of(filter_name, recorder):
    """Values after ten seconds of a force that is late, from a zero of 0.05 N in the air."""
    session = EstimationSession(create_estimator(filter_name), recorder)
    session.start()
    reporter = StatusReporter(session)
    draw = np.random.default_rng(0)
    time = np.arange(0.0, 12.0, 0.002)
    since = np.maximum(time - 2.0, 0.0)
    swings = 1.2 * (1.0 - np.cos(5.0 * since)) + 0.8 * (1.0 - np.cos(13.7 * since))
    depth = np.where(time < 2.0, -3.0 + 2.0 * time, 1.0 + swings)
    force = 0.4 * np.maximum(depth, 0.0) ** 1.5
    late = (
        np.interp(time - 1e-3 * LATE_MS, time, force)
        + 0.05
        + 0.005 * draw.standard_normal(time.size)
    )
    place = depth + 0.002 * draw.standard_normal(time.size)
    for number, sample in enumerate(zip(time, place, late, strict=True)):
        session.process(10**18 + round(sample[0] * 1e9), number, *map(float, sample[1:]))
    return reporter.collect(NOWHERE, ()).values


def test_delay_and_zeros_are_said_with_their_deviations(recorder):
    values = status_of("self_tuning_ukf", recorder)
    assert abs(values["channel_delay"] - 1e-3 * LATE_MS) < 0.002
    assert 0.0 < values["channel_delay_std"] < 0.002
    assert abs(values["force_zero"] - 0.05) < 0.002
    assert 0.0 < values["force_zero_std"] < 0.005
    assert abs(values["contact_position"]) < 0.1


def test_a_filter_that_knows_nothing_of_them_says_nothing(recorder):
    values = status_of("ekf", recorder)
    assert "stiffness_std" in values
    assert not {"channel_delay_std", "force_zero_std", "contact_position_std"} & set(values)


@pytest.mark.parametrize("shift_s", [3600.0, -3600.0])
def test_a_jump_of_the_stamps_is_a_warning_once(recorder, plant, shift_s):
    """Regression: a sensor whose clock was set was in the log only, and "estimating" here."""
    session = EstimationSession(create_estimator("ukf"), recorder)
    session.start()
    reporter = StatusReporter(session)

    def status(first, count, shift_ns):
        for number in range(first, first + count):
            (reading,) = plant.samples(1, start=number)
            stamp_ns = 10**18 + number * 10**6 + shift_ns
            session.process(stamp_ns, number, *map(float, reading[1:]))
        return reporter.collect(NOWHERE, ())

    before = status(0, 300, 0)
    jumped = status(300, 300, round(shift_s * 1e9))
    after = status(600, 300, round(shift_s * 1e9))
    assert (before.level, before.message) == (Level.OK, "estimating")
    assert jumped.level == Level.WARN
    assert (
        jumped.message
        == f"stamps jumped by {shift_s + 1e-3:+.3f} s: the estimator was started afresh"
    )
    assert jumped.values["time_jumps"] == 1
    assert (after.level, after.message) == (Level.OK, "estimating")


@pytest.mark.parametrize("shift_s", [3600.0, -3600.0, 1.8e9])
def test_another_clock_does_not_stay_in_the_latencies_since_the_start(recorder, shift_s):
    """A publisher that came back an hour behind made latency_max_us_since_start 3.6e9 for good."""
    session = EstimationSession(create_estimator("ukf"), recorder)
    session.start()
    reporter = StatusReporter(session)
    values = []
    for shift_ns in (0, round(shift_s * 1e9), 0):
        for latency_ns in (300_000, 400_000, 2_000_000):
            reporter.add_latency(latency_ns + shift_ns)
        values.append(reporter.collect(NOWHERE, ()).values)
    assert [v["latency_max_us_since_start"] for v in values] == [2000.0] * 3
    assert values[1]["latency_max_us"] == pytest.approx(max(1e6 * shift_s + 2000.0, 0.0))
    assert values[2]["latency_max_us"] == 2000.0
    assert [v["foreign_stamps"] for v in values] == [0, 3, 3]
    assert values[2]["latency_p99_us_since_start"] < 2100.0


def test_a_node_that_stood_still_has_been_late(recorder):
    session = EstimationSession(create_estimator("ukf"), recorder)
    session.start()
    reporter = StatusReporter(session)
    reporter.add_latency(12 * 10**9)
    assert reporter.collect(NOWHERE, ()).values["latency_max_us_since_start"] == 12e6
