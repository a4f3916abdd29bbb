"""What moving the tool takes: motion by cubics at uneven stamps, readings held back, none lost."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from presses_from_air import presses

from hc_estimator import create_estimator
from hc_estimator.stream.local_cubic import (
    HALF_NS,
    LEAST,
    LONGEST_NS,
    SHOW_SPIKE,
    LocalCubic,
    less_spikes,
)
from hc_estimator.stream.tool_motion import DAMPING, MOVING_MASS, Reading, ToolMotion

STEPS_NS = st.lists(st.integers(200_000, 30_000_000), min_size=12, max_size=80)


def plain(stamps_ns, places, stamp_ns):
    """Velocity and acceleration by numpy's polynomial of the same readings; None of too few."""
    now = int(np.sum(stamps_ns <= stamp_ns))
    first = min(int(np.sum(stamps_ns <= stamp_ns - HALF_NS)), now - LEAST)
    end = max(int(np.sum(stamps_ns <= stamp_ns + HALF_NS)), now + LEAST)
    if first < 0 or end > len(stamps_ns) or stamps_ns[end - 1] - stamps_ns[first] > LONGEST_NS:
        return None
    time_s = (stamps_ns[first:end] - stamp_ns) * 1e-9
    fit = np.polynomial.Polynomial.fit(time_s, places[first:end], 3)
    return fit.deriv(1)(0.0), fit.deriv(2)(0.0)


@given(STEPS_NS, st.integers(0, 10**6), st.floats(0.0, 1.0))
@settings(max_examples=150, deadline=None)
def test_it_is_the_polynomial_of_the_readings_around(steps, seed, share):
    stamps = 1_700_000_000_000_000_000 + np.cumsum(steps)
    # A sawtooth: each reading is far off the line between its neighbours, so that none is a spike.
    places = np.random.default_rng(seed).uniform(2.0, 8.0, len(stamps))
    places[::2] *= -1.0
    stamp = int(stamps[0] + share * (stamps[-1] - stamps[0]))
    cubic = LocalCubic()
    for at, place in zip(stamps.tolist(), places.tolist(), strict=True):
        cubic.add(at, place)
    found, expected = cubic.motion_at(stamp), plain(stamps, places, stamp)
    if expected is None:
        assert all(map(math.isnan, found))
    else:
        assert found[0] == pytest.approx(expected[0], rel=1e-6, abs=1e-3)
        assert found[1] == pytest.approx(expected[1], rel=1e-6, abs=1e-1)


def test_a_long_stream_is_as_a_short_one():
    """Memory is used again; 20,000 readings at 2 kHz are more than it holds."""
    stamps = 500_000 * np.arange(20_000)
    places = np.sin(12.0 * stamps * 1e-9)
    cubic = LocalCubic()
    for stamp, place in zip(stamps.tolist(), places.tolist(), strict=True):
        cubic.add(stamp, place)
        cubic.add(stamp, 99.0)  # the same stamp again says nothing new
        at = stamp - HALF_NS - SHOW_SPIKE * 500_000
        if stamp > 5 * HALF_NS:
            assert cubic.reaches(at)
            velocity, acceleration = cubic.motion_at(at)
            assert velocity == pytest.approx(12.0 * math.cos(12e-9 * at), abs=0.002)
            assert acceleration == pytest.approx(-144.0 * math.sin(12e-9 * at), abs=1.0)


ROWS = st.lists(
    st.tuples(st.integers(-3_000_000, 60_000_000), st.booleans(), st.booleans()),
    min_size=1,
    max_size=120,
)


@given(ROWS, st.sampled_from([(0.0, 0.0), (0.2, 0.0), (0.0, 0.01), (0.3, 0.02)]))
@settings(max_examples=150, deadline=None)
def test_none_is_lost_and_their_order_stays(rows, what):
    motion, stamp, given_on, read = ToolMotion(*what), 0, [], []
    for number, (step, has_place, has_force) in enumerate(rows):
        stamp += step
        place = 0.1 * number if has_place else math.nan
        reading = Reading(stamp, number, place, 1.0 if has_force else math.nan)
        read.append(reading)
        given_on += motion.take(reading)
        waiting = [r.stamp_ns for r in read[len(given_on) :]]
        assert not waiting or stamp - min(waiting) <= LONGEST_NS or max(waiting) > stamp
    given_on += motion.rest()
    assert [r.sequence for r in given_on] == list(range(len(rows)))
    assert motion.rest() == []
    for before, after in zip(read, given_on, strict=True):
        np.testing.assert_equal(after.displacement_mm, before.displacement_mm)
        lost = math.isnan(after.force_n) and not math.isnan(before.force_n)
        assert after.nothing == (lost and math.isnan(before.displacement_mm))
    lost = sum(math.isnan(r.force_n) for r in given_on) - sum(math.isnan(r.force_n) for r in read)
    assert motion.unknown == lost
    assert what != (0.0, 0.0) or lost == 0


def test_of_a_parabola_it_takes_off_what_is_there():
    """Positions at 125 Hz, forces at 1 kHz, at stamps of their own."""
    stamps = np.sort(np.concatenate([1_000_000 * np.arange(800), 8_000_000 * np.arange(100) + 7]))
    time_s, of_place = stamps * 1e-9, stamps % 1_000_000 == 7
    place = np.where(of_place, 2.0 - 9.0 * time_s + 60.0 * time_s**2, np.nan)
    taken = 1e-3 * 0.25 * 120.0 + 0.02 * (120.0 * time_s - 9.0)
    force = np.where(of_place, np.nan, 3.0 + taken)
    motion = ToolMotion(0.25, 0.02)
    less = motion.of_many(stamps, place, force)
    known = np.isfinite(less)
    np.testing.assert_allclose(less[known], 3.0, atol=1e-9)
    assert np.count_nonzero(known) >= 740
    assert motion.unknown == 800 - np.count_nonzero(known)
    assert np.isnan(less[:10]).all()  # nobody knows how it moved before


def test_a_gap_of_the_positions_holds_nothing_up():
    stamps = 1_000_000 * np.arange(3000)
    place = np.sin(5e-9 * stamps)
    place[1000:2000] = np.nan
    motion = ToolMotion(0.2)
    longest = 0
    for number, (stamp, where) in enumerate(zip(stamps.tolist(), place.tolist(), strict=True)):
        for given_on in motion.take(Reading(stamp, number, where, 1.0)):
            longest = max(longest, stamp - given_on.stamp_ns)
            if 20 < given_on.sequence < 970 or given_on.sequence > 2020:
                assert not math.isnan(given_on.force_n)
            if 1000 < given_on.sequence < 2000:
                assert math.isnan(given_on.force_n)
    assert longest <= LONGEST_NS + 1_000_000


def test_a_clock_that_is_set_back_begins_anew():
    motion = ToolMotion(0.2)
    given_on = []
    for number in range(400):
        stamp = 10**12 + 10**6 * number - (5 * 10**9 if number >= 200 else 0)
        given_on += motion.take(Reading(stamp, number, 0.01 * number, 1.0))
    assert [r.sequence for r in given_on] == list(range(len(given_on)))
    assert len(given_on) == 400 - HALF_NS // 10**6 - SHOW_SPIKE
    unknown = [r.sequence for r in given_on if math.isnan(r.force_n)]
    assert unknown == [*range(LEAST - 1), *range(178, 199 + LEAST)]


@pytest.mark.parametrize("size_mm", [3.0, 1e5])
def test_a_spike_of_the_position_is_no_acceleration(size_mm):
    """Regression: its jerk made thousands of newtons for 40 ms; and 0.7 N of a place 20 ms on."""
    time_s, place, force = presses()
    stamps = np.round(1e9 * time_s).astype(np.int64)
    spiked = place.copy()
    rows = np.random.default_rng(2).choice(np.arange(50, len(place) - 50, 10), 40, replace=False)
    spiked[rows] += size_mm * np.where(rows % 20 < 10, 1.0, -1.0)
    without, with_them = (ToolMotion(0.3, 0.01).of_many(stamps, d, force) for d in (place, spiked))
    known = np.isfinite(without)
    np.testing.assert_array_equal(known, np.isfinite(with_them))
    assert np.max(np.abs(with_them - without)[known]) < 0.02
    kept_s, _ = less_spikes(time_s, spiked)
    np.testing.assert_array_equal(np.setdiff1d(time_s, kept_s), np.sort(time_s[rows]))


def test_a_step_of_the_position_is_followed_within_some_readings():
    cubic = LocalCubic()
    random = np.random.default_rng(3)
    for number in range(400):
        cubic.add(
            10**6 * number, (5.0 if number >= 200 else 0.0) + 0.003 * random.standard_normal()
        )
    velocity, acceleration = cubic.motion_at(250 * 10**6)
    assert abs(velocity) < 1.0
    assert abs(acceleration) < 50.0


def test_off_it_gives_on_at_once_and_what_is_held_when_it_is_put_off():
    motion = ToolMotion(0.2)
    assert motion.take(Reading(0, 0, 1.0, 1.0)) == []
    motion.configure({MOVING_MASS.name: 0.0})
    first, second = motion.take(Reading(1_000_000, 1, 1.0, 1.0))
    assert math.isnan(first.force_n)
    assert second == Reading(1_000_000, 1, 1.0, 1.0)
    motion.configure({DAMPING.name: 0.02})
    assert (motion.mass_kg, motion.damping) == (0.0, 0.02)


@pytest.mark.parametrize(("damping", "mass_kg"), [(0.01, 0.0), (0.0, 0.3), (0.01, 0.3)])
def test_with_it_taken_off_the_tissue_is_found(damping, mass_kg):
    """Presses at 1 and 3.4 Hz from the air: K was 6 to 25 times too small, or 3 % off and sure."""
    time_s, place, force = presses(damping, mass_kg)
    stamps = np.round(1e9 * time_s).astype(np.int64)
    less = ToolMotion(mass_kg, damping).of_many(stamps, place, force)

    def last(forces):
        estimator = create_estimator("self_tuning_ukf", missing_readings=True)
        series = estimator.run(time_s, place, forces)
        late = time_s > 3.0
        return series.parameters[-1, 0], np.mean(series.model_mismatch[late])

    with_it, misfit_with = last(force)
    without, misfit = last(less)
    assert without == pytest.approx(0.4, rel=0.01)
    assert misfit < 0.02
    assert abs(with_it / 0.4 - 1.0) > 0.02 or misfit_with > 0.3
