"""Two sensors with clocks of their own become one stream."""

import math
import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hc_estimator.input.pairing import LONGEST_QUEUE, Pairer

MS = 1_000_000


def make(wait=50, window=0, gap=100):
    return Pairer(maximum_wait_ns=wait * MS, reorder_window_ns=window * MS, maximum_gap_ns=gap * MS)


def line(stamp_ns):
    """A displacement that grows by 1 mm a second: linear interpolation of it is exact."""
    return stamp_ns * 1e-9


def test_a_force_waits_for_the_position_after_it():
    pairer = make()
    assert pairer.add_position(0, 0.0) == []
    assert pairer.add_force(4 * MS, 1.5) == []
    (sample,) = pairer.add_position(10 * MS, 10.0)
    assert sample == (4 * MS, 0, pytest.approx(4.0), 1.5)


def test_a_position_at_the_very_stamp_is_taken_as_it_is():
    pairer = make()
    pairer.add_position(5 * MS, 7.0)
    assert pairer.add_force(5 * MS, 1.0) == [(5 * MS, 0, 7.0, 1.0)]


def test_waiting_is_bounded_and_what_waited_in_vain_leaves_a_gap():
    pairer = make(wait=50)
    pairer.add_position(0, 0.0)
    for i in range(1, 200):
        pairer.add_force(i * MS, 1.0)
    assert pairer.counters.unpaired == 148  # all but those of the last 50 ms
    # The positions are now 199.5 ms apart: no interpolation across that.
    assert pairer.add_position(199 * MS + MS // 2, 0.0) == []
    pairer.add_position(200 * MS, 1.0)
    (sample,) = pairer.add_force(200 * MS, 2.0)
    assert sample.sequence == 199  # one number for each force, paired or not
    assert pairer.counters.unpaired == 199


def test_messages_out_of_order_are_sorted_within_the_window():
    pairer = make(window=10)
    stamps = [0, 1, 2, 5, 3, 4, 6, 8, 7, *range(9, 40)]
    released = []
    for stamp in stamps:
        released += pairer.add_position(stamp * MS, line(stamp * MS))
        released += pairer.add_force(stamp * MS, float(stamp))
    times = [s.stamp_ns for s in released]
    assert times == [i * MS for i in range(30)]
    assert [s.force_n for s in released] == [float(i) for i in range(30)]
    assert pairer.counters.late == 0


def test_a_message_later_than_the_window_is_dropped_and_counted():
    pairer = make(window=2)
    for stamp in range(20):
        pairer.add_position(stamp * MS, 0.0)
        pairer.add_force(stamp * MS, 0.0)
    assert pairer.add_force(5 * MS, 9.0) == []
    assert pairer.counters.late == 1


def test_a_clock_set_back_starts_over():
    pairer = make()
    for stamp in (5000, 5001, 5002):
        pairer.add_position(stamp * MS, 0.0)
        pairer.add_force(stamp * MS, 0.0)
    pairer.add_position(0, 0.0)
    released = pairer.add_force(0, 3.0)
    assert [s.force_n for s in released] == [3.0]
    assert pairer.counters.resets == 1


def test_a_reading_that_is_not_a_number_goes_on_for_the_estimator_to_reject():
    pairer = make()
    pairer.add_position(0, math.nan)
    (sample,) = pairer.add_force(0, 1.0)
    assert math.isnan(sample.displacement_mm)


@given(
    force_period=st.integers(1, 40),
    position_period=st.integers(1, 40),
    jitter=st.integers(0, 5),
    seed=st.integers(0, 1000),
)
def test_any_two_rates_with_jitter_give_exact_displacements_in_order(
    force_period, position_period, jitter, seed
):
    generator = random.Random(seed)
    events = []
    for kind, period in (("force", force_period), ("position", position_period)):
        for i in range(2000 // period):
            stamp = i * period * MS
            events.append((stamp + generator.randint(0, jitter) * MS, kind, stamp))
    pairer = make(wait=100, window=jitter + 1, gap=50)
    released = []
    for _arrival, kind, stamp in sorted(events):
        add = pairer.add_force if kind == "force" else pairer.add_position
        released += add(stamp, line(stamp))
    assert all(s.displacement_mm == pytest.approx(line(s.stamp_ns), abs=1e-12) for s in released)
    assert [s.sequence for s in released] == list(range(len(released)))
    stamps = [s.stamp_ns for s in released]
    assert stamps == sorted(set(stamps))
    waiting = (100 + jitter + 50) // force_period + 2
    assert len(released) >= 2000 // force_period - waiting
    assert pairer.counters.unpaired == pairer.counters.late == 0


def test_a_burst_of_one_sensor_does_not_hurry_the_other():
    """The node was held up for 300 ms: all positions come first, then all forces, swapped."""
    pairer = make(wait=50, window=5)
    for stamp in range(0, 300, 4):
        pairer.add_position(stamp * MS, line(stamp * MS))
    stamps = list(range(300))
    for i in range(0, 300, 3):
        stamps[i : i + 3] = reversed(stamps[i : i + 3])
    released = []
    for stamp in stamps:
        released += pairer.add_force(stamp * MS, float(stamp))
    assert [s.force_n for s in released] == [float(i) for i in range(len(released))]
    assert len(released) >= 290
    assert pairer.counters.late == pairer.counters.unpaired == 0


@given(st.lists(st.tuples(st.booleans(), st.integers(0, 10**12)), max_size=300))
def test_memory_stays_bounded_and_nothing_raises_whatever_comes(readings):
    pairer = make()
    for is_force, stamp in readings:
        (pairer.add_force if is_force else pairer.add_position)(stamp, 1.0)
    assert len(pairer._positions) + len(pairer._forces) <= len(readings)


def test_memory_stays_bounded_when_one_sensor_is_silent():
    pairer = make(wait=50, gap=100)
    for i in range(5000):
        pairer.add_position(i * MS, 0.0)
    assert len(pairer._positions) == 5000  # forces may yet come for them
    for i in range(5000, 20000):
        pairer.add_position(i * MS, 0.0)
    assert len(pairer._positions) == LONGEST_QUEUE
    pairer = make(wait=50)
    for i in range(5000):
        pairer.add_force(i * MS, 0.0)
    assert len(pairer._forces) <= 52
