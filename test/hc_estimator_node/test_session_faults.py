"""What a session does with a stream that is not as it should be, without ROS."""

import math
import time

import numpy as np
import pytest

from hc_estimator import create_estimator
from hc_estimator.stream.session import EstimationSession
from hc_estimator.stream.vocabulary import Cause, EventKind, SessionSettings

START = 1_700_000_000_000_000_000
MS = 1_000_000


@pytest.fixture
def session(recorder):
    session = EstimationSession(create_estimator("ukf"), recorder)
    session.start()
    return session


def feed(session, samples, first=0, shift_ns=0):
    """Feed (time, displacement, force); return the number of the next sample."""
    number = first
    for number, (time_s, displacement, force) in enumerate(samples, first):
        session.process(START + shift_ns + round(time_s * 1e9), number, displacement, force)
    return number + 1


def test_estimates_are_those_of_the_estimator_alone(session, recorder, plant):
    samples = list(plant.samples(500))
    feed(session, samples)
    times, displacements, forces = np.array(samples).T
    alone = create_estimator("ukf").run(np.round(times * 1e9) * 1e-9, displacements, forces)
    parameters = [estimate.parameters for _stamp, _number, estimate in recorder.estimates]
    np.testing.assert_array_equal(parameters, alone.parameters)


def test_the_first_revision_is_told_again_with_its_time_origin(session, recorder, plant):
    assert recorder.revisions == [(1, 0, 0, Cause.STARTED)]
    feed(session, plant.samples(3), first=40)
    assert recorder.revisions[1:] == [(1, 40, START, Cause.STARTED)]


def test_reconfiguration_holds_from_the_next_sample_on(session, recorder, plant):
    feed(session, plant.samples(10))
    session.reconfigure({"outlier_gate": 9.0})
    assert recorder.revisions[-1] == (2, 10, START, Cause.RECONFIGURED)
    assert recorder.kinds()[-1] == EventKind.RECONFIGURED
    assert session.estimator.configuration["outlier_gate"] == 9.0


def test_a_refused_reconfiguration_changes_nothing(session, recorder, plant):
    feed(session, plant.samples(10))
    before = session.estimator.configuration
    with pytest.raises(ValueError, match="outlier_gate"):
        session.reconfigure({"force_noise_std": 0.5, "outlier_gate": -1.0})
    assert session.estimator.configuration == before
    assert recorder.revisions[-1].number == 1


def test_silence_is_told_once_and_so_is_recovery_and_the_uncertainty_grows(
    session, recorder, plant
):
    number = feed(session, plant.samples(1000))
    before = session.last_estimate
    now = time.perf_counter_ns()
    assert not session.check_silence(now)
    assert session.check_silence(now + 600 * MS)
    assert session.check_silence(now + 700 * MS)
    assert recorder.kinds().count(EventKind.INPUT_SILENT) == 1
    feed(session, plant.samples(1, start=3000), first=number)
    assert recorder.kinds()[-1] == EventKind.INPUT_RECOVERED
    assert not session.check_silence(time.perf_counter_ns())
    # Two seconds of random walk without data, less what one sample can tell.
    assert np.all(session.last_estimate.parameters_std[2:] >= before.parameters_std[2:])
    feed(session, plant.samples(500, start=3001), first=number + 1)
    np.testing.assert_allclose(session.last_estimate.parameters, plant.parameters, rtol=0.1)


def test_not_a_number_is_rejected_counted_and_leaves_no_trace(session, recorder, plant):
    samples = list(plant.samples(400))
    spoilt = [
        (t, math.nan, f) if i % 20 == 3 else (t, d, math.inf) if i % 20 == 7 else (t, d, f)
        for i, (t, d, f) in enumerate(samples)
    ]
    feed(session, spoilt)
    assert session.counters.rejected[1] == 40
    assert session.counters.accepted == 360
    assert np.isfinite(session.last_estimate.parameters).all()
    assert EventKind.REJECTION_BURST not in recorder.kinds()


def test_a_burst_of_rejections_is_one_event_with_its_reason(session, recorder, plant):
    number = feed(session, plant.samples(100))
    times = [0.1 + i * 1e-3 for i in range(200)]
    number = feed(session, [(t, math.nan, 1.0) for t in times], first=number)
    bursts = [e for e in recorder.events if e.kind == EventKind.REJECTION_BURST]
    assert len(bursts) == 1
    assert "not_finite" in bursts[0].reason
    assert any("200 samples rejected in a row" in alarm for alarm in session.watch.alarms)
    feed(session, plant.samples(10, start=300), first=number)
    assert session.watch.alarms == []


def test_spikes_are_rejected_and_the_estimate_stays_in_place(session, plant):
    number = feed(session, plant.samples(2000))
    before = session.last_estimate.parameters.copy()
    generator = np.random.default_rng(3)
    spiked = [
        (t, d, f + 50.0) if generator.random() < 0.02 else (t, d, f)
        for t, d, f in plant.samples(1000, start=2000)
    ]
    feed(session, spiked, first=number)
    assert session.counters.rejected[4] >= 10
    np.testing.assert_allclose(session.last_estimate.parameters, before, rtol=0.02)


def test_readings_beyond_the_range_are_refused_and_told_as_saturation(recorder, plant):
    session = EstimationSession(create_estimator("ukf", force_limit=5.0), recorder)
    feed(session, [(t, d, 6.0) for t, d, _f in plant.samples(100)])
    assert session.counters.rejected[5] == 100
    assert recorder.kinds().count(EventKind.INPUT_SATURATED) == 1


def test_a_frozen_reading_is_an_event_and_an_alarm_until_it_moves(session, recorder, plant):
    number = feed(session, plant.samples(100))
    frozen = [(0.1 + i * 1e-3, d, 1.25) for i, (_t, d, _f) in enumerate(plant.samples(300))]
    number = feed(session, frozen, first=number)
    assert recorder.kinds().count(EventKind.INPUT_FROZEN) == 1
    assert "force frozen at 1.25 N" in session.watch.alarms
    feed(session, plant.samples(10, start=400), first=number)
    assert not any("frozen" in alarm for alarm in session.watch.alarms)


def test_a_force_of_zero_in_free_motion_is_not_frozen(session, recorder):
    feed(session, [(i * 1e-3, -1.0 - i * 1e-4, 0.0) for i in range(500)])
    assert EventKind.INPUT_FROZEN not in recorder.kinds()


@pytest.mark.parametrize("shift_s", [-3600.0, 3600.0])
def test_a_time_jump_starts_afresh_and_loses_no_sample(session, recorder, plant, shift_s):
    number = feed(session, plant.samples(300))
    second = list(plant.samples(300, start=300))
    feed(session, second, first=number, shift_ns=round(shift_s * 1e9))
    assert recorder.kinds().count(EventKind.TIME_JUMP) == 1
    assert len(recorder.estimates) == 600
    origin = START + round((0.3 + shift_s) * 1e9)
    assert recorder.revisions[-1] == (2, 300, origin, Cause.TIME_JUMP)
    alone = create_estimator("ukf")
    after = [alone.step(t - 0.3, d, f) for t, d, f in second]
    np.testing.assert_allclose(after[-1].parameters, session.last_estimate.parameters, rtol=1e-6)
    assert all(e.rejected == 0 for _s, n, e in recorder.estimates if n >= 300)


def test_a_jump_of_the_clock_itself_starts_afresh(session, recorder, plant):
    number = feed(session, plant.samples(300))
    session.time_jumped("the clock jumped by -1000.000 s")
    feed(session, plant.samples(300, start=300), first=number, shift_ns=-(10**12))
    assert recorder.kinds().count(EventKind.TIME_JUMP) == 1
    assert len(recorder.estimates) == 600


def test_a_restarted_source_goes_on_without_a_reset(session, recorder, plant):
    feed(session, plant.samples(500))
    feed(session, plant.samples(500, start=600))  # numbered from 0 again, time goes on
    assert recorder.kinds().count(EventKind.SOURCE_RESTARTED) == 1
    assert recorder.revisions[-1].cause == Cause.STARTED
    assert len(recorder.estimates) == 1000
    np.testing.assert_allclose(session.last_estimate.parameters, plant.parameters, rtol=0.1)


@pytest.mark.parametrize("rate_hz", [100.0, 4000.0])
def test_other_rates_than_one_kilohertz_work(recorder, make_plant, rate_hz):
    session = EstimationSession(create_estimator("ukf"), recorder)
    plant = make_plant(rate_hz=rate_hz)
    feed(session, plant.samples(int(4 * rate_hz)))
    np.testing.assert_allclose(session.last_estimate.parameters, plant.parameters, rtol=0.2)
    assert session.counters.accepted >= 0.99 * 4 * rate_hz


def test_the_rate_may_change_while_it_runs(session, make_plant):
    number, begin = 0, 0.0
    for rate_hz in (1000.0, 100.0, 4000.0, 1000.0):
        plant = make_plant(rate_hz=rate_hz)
        times = [begin + i / rate_hz for i in range(int(1.5 * rate_hz))]
        number = feed(session, [(t, *plant.readings(t)) for t in times], first=number)
        begin = times[-1] + 1 / rate_hz
    np.testing.assert_allclose(session.last_estimate.parameters, plant.parameters, rtol=0.1)
    assert session.guard.lost == session.guard.strays == 0


def test_a_reset_forgets_the_samples_and_keeps_the_settings(session, recorder, plant):
    session.reconfigure({"outlier_gate": 9.0})
    number = feed(session, plant.samples(1000))
    session.reset()
    assert recorder.kinds()[-1] == EventKind.RESET
    ((time_s, displacement, force),) = plant.samples(1, start=2000)
    feed(session, [(time_s, displacement, force)], first=number)
    assert session.estimator.configuration["outlier_gate"] == 9.0
    assert recorder.revisions[-1] == (3, 1000, START + 2 * 10**9, Cause.RESET)
    first = recorder.estimates[-1][2]
    fresh = create_estimator("ukf", outlier_gate=9.0).step(0.0, displacement, force)
    np.testing.assert_array_equal(first.covariance, fresh.covariance)


def test_settings_of_the_session_change_while_it_runs(session, recorder, plant):
    session.apply_settings(SessionSettings(rejection_burst=3))
    feed(session, [(t, math.nan, f) for t, _d, f in plant.samples(4)])
    assert recorder.kinds().count(EventKind.REJECTION_BURST) == 1


def test_samples_skipped_one_by_one_are_one_event_with_their_number(
    session, recorder, plant, monkeypatch
):
    number = feed(session, plant.samples(100))
    now = [time.perf_counter_ns()]
    monkeypatch.setattr("hc_estimator.stream.session.time.perf_counter_ns", lambda: now[0])

    def told():
        return [e.reason for e in recorder.events if e.kind == EventKind.SAMPLES_SKIPPED]

    for _ in range(40):
        session.skip(1)
        now[0] += 10 * MS
        session.check_silence(now[0])
        number = feed(session, plant.samples(1, start=number + 1), first=number + 1)
    assert session.counters.skipped == 40  # counted at once
    assert told() == []
    now[0] += 200 * MS
    session.check_silence(now[0])
    assert told() == ["40 samples skipped within 0.39 s: too many were waiting"]
    session.check_silence(now[0] + 600 * MS)
    session.skip(1)
    assert len(told()) == 1  # nothing is told twice, and the next one is gathered anew
    session.end()
    assert told()[1:] == ["1 sample skipped: too many were waiting"]
