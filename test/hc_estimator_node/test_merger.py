"""Two sensors with rates of their own become one stream, reading by reading."""

import math
import random

from hypothesis import given
from hypothesis import strategies as st

from hc_estimator.stream.merger import LONGEST_QUEUE, Merger

MS = 1_000_000


class Fed:
    """A merger whose readings arrive at once, or when they are said to; times in ms."""

    def __init__(self, wait=50, window=0, gap=100):
        self.merger = Merger(
            maximum_wait_ns=wait * MS, reorder_window_ns=window * MS, maximum_gap_ns=gap * MS
        )
        self.counters = self.merger.counters

    def displacement(self, stamp, value=0.0, arrival=None, complete=None):
        complete_ns = None if complete is None else complete * MS
        return self.merger.add_displacement(*_times(stamp, value, arrival), complete_ns)

    def force(self, stamp, value=0.0, arrival=None, complete=None):
        complete_ns = None if complete is None else complete * MS
        return self.merger.add_force(*_times(stamp, value, arrival), complete_ns)


def _times(stamp, value, arrival):
    return round(stamp * MS), value, round((stamp if arrival is None else arrival) * MS)


def told(samples):
    """Stamps in ms and readings, None for one that is missing."""
    return [
        (
            s.stamp_ns / MS,
            s.displacement,
            s.force,
        )
        for s in samples
    ]


def test_a_force_waits_until_no_older_displacement_can_come():
    fed = Fed()
    assert fed.displacement(0, 7.0) == []
    assert told(fed.force(4, 1.5)) == [(0, 7.0, None)]
    assert told(fed.displacement(8, 8.0)) == [(4, None, 1.5)]
    assert told(fed.merger.flush()) == [(8, 8.0, None)]


def test_equal_stamps_make_one_sample_and_so_do_stamps_that_were_rounded():
    fed = Fed()
    assert fed.displacement(5, 7.0) == []
    assert told(fed.force(5, 1.0)) == [(5, 7.0, 1.0)]
    fed.force(6, 2.0)
    (sample,) = fed.displacement(6.0009, 8.0)
    assert (sample.displacement, sample.force) == (8.0, 2.0)
    fed.force(7, 2.0)
    assert len(fed.displacement(7.0011, 8.0)) == 1  # the force; the displacement waits


def test_late_poses_make_it_and_the_numbers_have_no_gap():
    """125 Hz, 20 ms late, beside a wrench at 500 Hz."""
    fed = Fed()
    events = [(2.0 * i, fed.force, 2.0 * i) for i in range(500)]
    events += [(8.0 * i + 0.3 + 20.0, fed.displacement, 8.0 * i + 0.3) for i in range(125)]
    samples, waits = [], []
    for arrival, add, stamp in sorted(events, key=lambda e: e[0]):
        for sample in add(stamp, stamp, arrival):
            samples.append(sample)
            waits.append(arrival - sample.stamp_ns / MS)
    samples += fed.merger.flush()
    assert [s.stamp_ns for s in samples] == sorted(round(e[2] * MS) for e in events)[1:]
    assert [s.sequence for s in samples] == list(range(1, 625))
    assert max(waits) <= 28.5  # the pose's delay and its period
    assert fed.counters.late == 0
    assert fed.counters.unpaired == 1  # the force before the first pose


def test_a_wait_is_over_by_stamps_and_by_arrivals():
    fed = Fed(wait=50, gap=1000)
    fed.displacement(0)
    fed.force(0)
    for stamp in range(10, 60, 10):
        assert fed.force(stamp) == []
    assert told(fed.force(60)) == [(10, None, 0.0)]
    # A recording that is played ten times slower: the other reading is not late by its stamps.
    fed = Fed(wait=50)
    fed.displacement(0)
    fed.force(0)
    for stamp in range(2, 42, 2):
        assert fed.force(stamp, arrival=10 * stamp) == []
    assert len(fed.displacement(40, arrival=430)) == 20


def test_a_burst_of_one_sensor_does_not_hurry_the_other():
    """The program was held up: first all of one sensor comes, then all of the other."""
    for first, second in (("displacement", "force"), ("force", "displacement")):
        fed = Fed(wait=50)
        released = []
        for what, period in ((first, 4), (second, 1)):
            for stamp in range(0, 300, period):
                released += getattr(fed, what)(stamp, float(stamp), arrival=300)
        released += fed.merger.flush()
        assert [s.stamp_ns for s in released] == [i * MS for i in range(300)]
        assert fed.counters.late == fed.counters.unpaired == 0


def test_a_second_reading_within_the_rounding_of_a_stamp_does_not_repeat_it():
    fed = Fed()
    fed.displacement(0)
    fed.displacement(1e-6, 1.0)
    assert told(fed.force(1e-6, 2.0)) == [(1e-6, 0.0, 2.0)]
    assert fed.counters.late == 1


def test_what_comes_out_does_not_depend_on_how_far_a_busy_program_has_got():
    """Under load all of one sensor was taken in before messages of the other that had come."""
    events = [(stamp + 20.5, "displacement", stamp) for stamp in range(0, 1000, 8)]
    events += [(stamp, "force", stamp) for stamp in range(1000)]
    events = [
        (569.9 + 1e-3 * (a - 500) if 500 < a < 570 else a, w, s) for a, w, s in events
    ]  # a stall
    events.sort(key=lambda e: e[0])
    results = []
    for order in (lambda e: e[0], lambda e: e[1], lambda e: (e[1] == "displacement", e[0])):
        fed = Fed(wait=50)
        todo = sorted(events, key=order)
        released = []
        while todo:
            arrival, what, stamp = todo.pop(0)
            waits = min((a for a, _, _ in todo), default=None)
            released += getattr(fed, what)(stamp, float(stamp), arrival, waits)
        released += fed.merger.flush()
        assert fed.counters.late == 0
        results.append(told(released))
    assert results[0] == results[1] == results[2]
    assert len(results[0]) == 1000


def test_what_is_later_than_its_place_or_repeats_a_stamp_is_dropped_and_counted():
    fed = Fed()
    for stamp in range(20):
        fed.displacement(stamp)
        fed.force(stamp)
    assert fed.force(5, 9.0) == []
    assert fed.displacement(5, 9.0) == []
    assert fed.counters.late == 2
    fed.force(30, 1.0)
    assert fed.force(30, 2.0) == []
    assert fed.counters.late == 3
    assert told(fed.displacement(30, 3.0)) == [(30, 3.0, 1.0)]


def test_messages_out_of_order_are_sorted_within_the_window():
    fed = Fed(window=10)
    released = []
    for stamp in [0, 1, 2, 5, 3, 4, 6, 8, 7, *range(9, 40)]:
        released += fed.displacement(stamp, float(stamp))
        released += fed.force(stamp, float(stamp))
    assert told(released) == [(i, float(i), float(i)) for i in range(30)]
    assert fed.counters.late == 0


def test_a_sensor_that_is_alone_gives_no_samples_and_leaves_a_gap_in_the_numbers():
    fed = Fed(wait=20, gap=100)
    released = fed.displacement(0) + fed.force(0)
    for stamp in range(1, 500):
        released += fed.force(stamp)
    assert [s.stamp_ns for s in released] == [i * MS for i in range(101)]
    assert fed.counters.unpaired == 379  # the last 20 still wait
    released = fed.displacement(499.5) + fed.force(500)
    assert released[0].sequence > 300


def test_a_clock_set_back_starts_over():
    fed = Fed()
    for stamp in (5000, 5001, 5002):
        fed.displacement(stamp)
        fed.force(stamp)
    fed.displacement(0, 4.0)
    assert told(fed.force(0, 3.0)) == [(0, 4.0, 3.0)]
    assert fed.counters.resets == 1


def test_a_reading_that_is_not_a_number_goes_on_for_the_estimator_to_reject():
    fed = Fed()
    fed.displacement(0, math.nan)
    (sample,) = fed.force(1, 1.0)
    assert math.isnan(sample.displacement)
    assert sample.force is None


@given(
    force_period=st.integers(1, 40),
    displacement_period=st.integers(1, 40),
    jitter=st.integers(0, 5),
    delays=st.tuples(st.integers(0, 40), st.integers(0, 40)),
    offset=st.integers(0, 30),
    seed=st.integers(0, 1000),
)
def test_whatever_the_rates_nothing_is_lost_within_the_wait_and_all_is_in_order(
    force_period, displacement_period, jitter, delays, offset, seed
):
    generator = random.Random(seed)
    fed = Fed(wait=100, window=jitter + 1, gap=200)
    events = []
    for add, period, delay in (
        (fed.force, force_period, delays[0]),
        (fed.displacement, displacement_period, delays[1]),
    ):
        for i in range(2000 // period):
            stamp = i * period + (offset if add == fed.displacement else 0)
            events.append((stamp + delay + generator.uniform(0, jitter), len(events), add, stamp))
    released = []
    for arrival, value, add, stamp in sorted(events, key=lambda e: e[:2]):
        released += add(stamp, float(value), arrival)
    released += fed.merger.flush()
    stamps = [s.stamp_ns for s in released]
    assert stamps == sorted(set(stamps))
    numbers = [s.sequence for s in released]
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))
    first = min(stamp for _, _, add, stamp in events if add == fed.displacement)
    expected = [(s, v) for _, v, add, s in events if add == fed.displacement or s >= first]
    readings = [
        (s.stamp_ns / MS, v) for s in released for v in (s.displacement, s.force) if v is not None
    ]
    assert sorted(readings) == sorted(expected)
    assert fed.counters.late == 0
    assert fed.counters.unpaired == len(events) - len(expected)


@given(
    st.lists(st.tuples(st.booleans(), st.integers(0, 10**10), st.integers(0, 10**8)), max_size=300)
)
def test_whatever_comes_every_reading_is_told_or_counted(readings):
    merger = Merger(maximum_wait_ns=50 * MS, reorder_window_ns=0, maximum_gap_ns=100 * MS)
    released, now = [], 0
    for is_force, stamp, step in readings:
        now += step
        add = merger.add_force if is_force else merger.add_displacement
        samples = add(stamp, 1.0, now)
        assert [s.stamp_ns for s in samples] == sorted({s.stamp_ns for s in samples})
        released += samples
    released += merger.flush()
    told_readings = sum(s.displacement == 1.0 for s in released)
    told_readings += sum(s.force == 1.0 for s in released)
    assert told_readings + merger.counters.late + merger.counters.unpaired == len(readings)


def test_memory_stays_bounded_when_no_wait_is_ever_over():
    fed = Fed(wait=50)
    for i in range(LONGEST_QUEUE + 500):
        fed.displacement(i, arrival=0)
    assert fed.counters.unpaired == 500


def test_a_sensor_that_dies_while_its_last_reading_waits_holds_nothing_up():
    fed = Fed(wait=20, window=5)
    released = []
    for stamp in range(500):
        if stamp <= 100:
            released += fed.displacement(stamp)
        released += fed.force(stamp)
    assert [s.stamp_ns for s in released] == [i * MS for i in range(201)]
    assert fed.counters.unpaired == 279  # the last 20 still wait


def test_sensors_whose_clocks_differ_give_no_samples():
    fed = Fed(wait=20)
    released = []
    for stamp in range(300):
        released += fed.force(stamp + 5000, arrival=stamp)
        released += fed.displacement(stamp, arrival=stamp)
    assert released + fed.merger.flush() == []
    assert fed.counters.unpaired == 600


def test_a_stream_begins_with_a_displacement_and_goes_on_with_one_after_a_pause():
    """Two forces before the first pose made the default filter call a misfit for a second."""
    fed = Fed(wait=10, gap=100)
    released = []
    for stamp in (0, 2, 4, 6, 8, 300, 302, 304, 306):
        if stamp in (4, 304):
            released += fed.displacement(stamp + 1)
        released += fed.force(stamp)
    released += fed.displacement(309)
    assert [s.stamp_ns // MS for s in released] == [5, 6, 8, 305, 306]
    assert [s.sequence for s in released] == [3, 4, 5, 9, 10]
