"""Samples that wait together give what they give one by one: numbers, events, contacts, counts."""

import dataclasses

import numpy as np
import pytest

from hc_estimator import available_filters, create_estimator
from hc_estimator.stream.session import EstimationSession
from hc_estimator.stream.vocabulary import Batch, EventKind

START = 1_700_000_000_000_000_000


def columns(plant, count, start=0):
    times, displacements, forces = np.array(list(plant.samples(count, start))).T
    stamps = START + np.round(times * 1e9).astype(np.int64)
    return stamps, np.arange(start, start + count, dtype=np.uint64), displacements, forces


def damaged(plant):
    """A stream with everything in it that a guard, a filter or a watch has an opinion of."""
    stamps, sequences, depths, forces = columns(plant, 1500)
    depths[100:130] -= 100.0  # free of contact
    forces[100:130] = 0.0
    depths[300], forces[301] = np.nan, np.inf
    forces[400:460] = 1e9  # out of range: a burst
    forces[500:760] = forces[500]  # frozen
    stamps[800] = stamps[799]  # repeated
    stamps[900], stamps[901] = stamps[901], stamps[900]  # out of order
    sequences[1000:] += 7  # lost
    sequences[1100:] -= 1100  # the source numbers anew
    stamps[1300:] += 3600 * 10**9  # a jump of the clock
    return stamps, sequences, depths, forces


def one_by_one(session, data):
    for sample in zip(*(column.tolist() for column in data), strict=True):
        session.process(*sample)


def together(session, data, sizes):
    batch, begin = Batch(*data), 0
    while begin < len(data[0]):
        end = begin + next(sizes)
        session.process_many(batch.part(begin, end))
        begin = end


def sizes(seed):
    random = np.random.default_rng(seed)
    while True:
        yield int(random.choice([1, 2, 3, 7, 64, 256]))


def told(session, recorder):
    session.end()
    counters = dataclasses.asdict(session.counters)
    return {
        "estimates": [(stamp, number) for stamp, number, _ in recorder.estimates],
        "events": recorder.events,
        "revisions": recorder.revisions,
        "counters": {k: v for k, v in counters.items() if k != "nis_sum"},
        "contacts": [
            (c.number, c.start_ns, c.end_ns, c.samples, c.energy_in, c.peak_force, c.force_rmse)
            for c in recorder.contacts
        ],
        "lost": session.guard.lost,
        "strays": session.guard.strays,
        "computation": session.computation.count,
    }


@pytest.mark.parametrize(
    "filter_name",
    [
        "ukf",
        "rls",
        *(
            pytest.param(n, marks=pytest.mark.slow)
            for n in available_filters()
            if n not in ("ukf", "rls")
        ),
    ],
)
def test_batches_of_any_size_are_samples_one_by_one(filter_name, make_plant, recorder):
    plant, other = make_plant(), type(recorder)()
    data = damaged(plant)
    single = EstimationSession(create_estimator(filter_name), recorder)
    several = EstimationSession(create_estimator(filter_name), other)
    for session in (single, several):
        session.start()
    one_by_one(single, data)
    together(several, data, sizes(3))
    a = np.array([e._rows for _, _, e in recorder.estimates])
    b = np.array([e._rows for _, _, e in other.estimates])
    np.testing.assert_array_equal(a, b)
    expected, found = told(single, recorder), told(several, other)
    assert EventKind.REJECTION_BURST in other.kinds() or EventKind.INPUT_SATURATED in other.kinds()
    assert {EventKind.TIME_JUMP, EventKind.INPUT_FROZEN} <= set(other.kinds())
    for name, value in expected.items():
        assert found[name] == value, name
    assert several.counters.nis_sum == single.counters.nis_sum


def test_events_carry_the_sample_at_which_they_happened(plant, recorder):
    session = EstimationSession(create_estimator("ukf"), recorder)
    session.start()
    data = columns(plant, 600)
    data[3][200:260] = 1e9
    session.process_many(Batch(*data))
    [saturated] = [e for e in recorder.events if e.kind is EventKind.INPUT_SATURATED]
    assert saturated.sequence == 200 + session.settings.rejection_burst - 1
    assert saturated.stamp_ns == int(data[0][saturated.sequence])


def test_an_empty_batch_is_nothing(plant, recorder):
    session = EstimationSession(create_estimator("ukf"), recorder)
    session.start()
    session.process_many(Batch(*columns(plant, 5)).part(0, 0))
    assert recorder.estimates == []
    assert session.counters.received == 0
