"""Contacts cut out of a stream, with what they cost and gave."""

from types import SimpleNamespace

import numpy as np
import pytest

from hc_estimator import create_estimator
from hc_estimator.stream.contacts import ContactTracker
from hc_estimator.stream.session import EstimationSession
from hc_estimator.stream.vocabulary import EventKind

MS = 1_000_000


def estimate(displacement, velocity=0.0, predicted=0.0, rejected=0):
    """An estimate that follows the reading exactly."""
    return SimpleNamespace(
        contact=displacement > 0.0,
        displacement=displacement,
        velocity=velocity,
        force_predicted=predicted,
        parameters=np.array([1.0, 2.0, 3.0, 4.0]),
        covariance=np.eye(4),
        identifiability=np.ones(4),
        change_detected=False,
        model_mismatch=False,
        rejected=rejected,
    )


def run(tracker, readings, step_ms=1):
    """Feed (displacement, force); return contacts that began and ended."""
    made, over = [], []
    for i, (displacement, force) in enumerate(readings):
        now, end = tracker.update(i * step_ms * MS, i, displacement, force, estimate(displacement))
        if now is not None:
            made.append(i)
        if end is not None:
            over.append(end)
    return made, over


def press(peak_mm=2.0, count=1000, loading=2.0, unloading=1.0):
    """In and out along a triangle; force proportional to depth, less on the way out."""
    for i in range(count):
        x = peak_mm * (1 - abs(2 * i / (count - 1) - 1)) + 1e-9
        yield x, (loading if 2 * i < count else unloading) * x


def test_energy_of_a_triangle_is_the_area_of_its_loop():
    tracker = ContactTracker()
    _made, (summary,) = run(tracker, [*press(), *[(-1.0, 0.0)] * 50])
    assert summary.energy_in == pytest.approx(0.5 * 2.0 * 2.0 * 2.0, rel=1e-2)
    assert summary.energy_loss == pytest.approx(0.5 * 2.0 * 2.0 * (2.0 - 1.0), rel=1e-2)
    assert summary.peak_force == pytest.approx(4.0, rel=1e-2)
    assert summary.peak_displacement == pytest.approx(2.0, rel=1e-2)
    assert summary.duration_s == pytest.approx(0.999)
    assert (summary.first_sequence, summary.last_sequence) == (0, 999)
    assert summary.samples == 1000


def test_an_elastic_contact_loses_nothing():
    tracker = ContactTracker()
    readings = [*press(loading=2.0, unloading=2.0), *[(-1.0, 0.0)] * 50]
    _made, (summary,) = run(tracker, readings)
    assert summary.energy_loss == pytest.approx(0.0, abs=1e-6)


def test_touches_too_short_and_gaps_too_short_do_not_count():
    tracker = ContactTracker(minimum_duration_ns=50 * MS, release_ns=20 * MS)
    touch = [(1.0, 1.0)] * 10 + [(-1.0, 0.0)] * 100
    assert run(tracker, touch) == ([], [])
    tracker = ContactTracker(minimum_duration_ns=50 * MS, release_ns=20 * MS)
    flicker = ([(1.0, 1.0)] * 30 + [(-1.0, 0.0)] * 10) * 5 + [(-1.0, 0.0)] * 50
    made, over = run(tracker, flicker)
    assert made == [50]  # 30 ms in contact, 10 ms away, and again in contact
    assert len(over) == 1
    assert over[0].last_sequence == 189


def test_rejected_samples_are_counted_and_do_not_enter():
    tracker = ContactTracker()
    for i in range(100):
        tracker.update(i * MS, i, 1.0, 1.0, estimate(1.0, predicted=0.5))
        tracker.update(i * MS, i, 99.0, 99.0, estimate(1.0, rejected=4))
    summary = tracker.finish()
    assert (summary.samples, summary.rejected) == (100, 100)
    assert summary.peak_force == 1.0
    assert summary.force_rmse == pytest.approx(0.5)


def test_a_contact_that_goes_on_is_reported_at_the_end():
    tracker = ContactTracker()
    run(tracker, [(1.0, 1.0)] * 100)
    assert tracker.finish().samples == 100
    assert tracker.finish() is None


def test_palpation_of_two_places_gives_two_summaries_with_the_tissue(recorder, make_plant):
    plant = make_plant()
    session = EstimationSession(create_estimator("ukf"), recorder)
    w = 2 * np.pi * 0.5
    for i in range(4000):
        time_s = i * 1e-3
        displacement = 3.0 * np.sin(w * time_s) + 0.4 * np.sin(9 * w * time_s)
        velocity = 3.0 * w * np.cos(w * time_s) + 3.6 * w * np.cos(9 * w * time_s)
        force = max(plant.force(displacement, velocity), 0.0) + plant._random.normal(0, 0.01)
        session.process(i * MS + 10**18, i, displacement + plant._random.normal(0, 0.002), force)
    session.end()
    assert [c.number for c in recorder.contacts] == list(range(1, len(recorder.contacts) + 1))
    long = [c for c in recorder.contacts if c.duration_s > 0.5]
    assert len(long) == 2
    assert recorder.kinds().count(EventKind.CONTACT_MADE) == len(recorder.contacts)
    assert recorder.kinds().count(EventKind.CONTACT_LOST) == len(recorder.contacts)
    for summary in long:
        assert summary.parameters[0] == pytest.approx(plant.parameters[0], rel=0.1)
        assert 0.0 < summary.energy_loss < summary.energy_in
        assert summary.peak_displacement == pytest.approx(3.2, abs=0.3)


def test_a_sample_that_comes_late_does_not_end_the_contact_before_its_last_one():
    tracker = ContactTracker()
    run(tracker, [(1.0, 1.0)] * 100)
    tracker.update(60 * MS + 1, 1000, 1.0, 1.0, estimate(1.0))
    assert tracker.current.samples == 101
    assert (tracker.current.end_ns, tracker.current.last_sequence) == (99 * MS, 99)
