"""What lies between tissue and readings changes what it should, and nothing else."""

import numpy as np
import pytest

from hc_evaluation.accuracy.drawn_contact import drawn_contact
from hc_evaluation.accuracy.mechanics import MECHANICS, TAKEN_OFF

SEEDS = (1000, 1003, 1007)


def pair(name, seed):
    """The same contact without and with it."""
    return drawn_contact((), seed), drawn_contact((), seed, MECHANICS[name])


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("name", MECHANICS)
def test_one_channel_differs_and_the_truth_stays(name, seed):
    plain, other = pair(name, seed)
    np.testing.assert_array_equal(plain.time_s, other.time_s)
    np.testing.assert_array_equal(plain.parameters, other.parameters)
    of_place = name in ("play", "compliance")
    assert np.array_equal(plain.displacement_mm, other.displacement_mm) is not of_place
    assert np.array_equal(plain.force_n, other.force_n) is of_place
    again = drawn_contact((), seed, MECHANICS[name])
    np.testing.assert_array_equal(other.force_n, again.force_n)
    np.testing.assert_array_equal(other.displacement_mm, again.displacement_mm)


@pytest.mark.parametrize("seed", SEEDS)
def test_play_and_memory_are_never_off_by_more_than_half_their_width(seed):
    plain, other = pair("play", seed)
    off = np.abs(other.displacement_mm - plain.displacement_mm)
    assert 0.01 <= np.max(off) <= 0.1
    plain, other = pair("hysteresis", seed)
    off = np.abs(other.force_n - plain.force_n) / np.max(plain.force_n)
    assert 0.001 < np.max(off) < 0.021


def test_a_mass_adds_its_share_of_the_acceleration():
    time = np.linspace(0.0, 2.0, 4001)
    place = 3.0 + 1.5 * np.sin(6.0 * time)
    read, force = MECHANICS["inertia"](np.random.default_rng(1), time, place, np.zeros(time.size))
    acceleration_m_s2 = -1.5e-3 * 36.0 * np.sin(6.0 * time)
    mass = force[5:-5] @ acceleration_m_s2[5:-5] / (acceleration_m_s2[5:-5] ** 2).sum()
    assert 0.02 <= mass <= 0.5
    np.testing.assert_allclose(force[5:-5], mass * acceleration_m_s2[5:-5], atol=1e-4)
    np.testing.assert_array_equal(read, place)


def test_friction_is_against_the_motion_and_gone_at_rest():
    time = np.linspace(0.0, 3.0, 3001)
    place = np.interp(time, [0.0, 1.0, 2.0, 3.0], [0.0, 4.0, 4.0, 0.0])
    _read, force = MECHANICS["friction"](np.random.default_rng(1), time, place, np.ones(time.size))
    largest = force[500] - 1.0
    assert 0.005 <= largest <= 0.05
    np.testing.assert_allclose(force[[1500, 2500]], [1.0, 1.0 - largest])


@pytest.mark.parametrize("seed", SEEDS)
def test_a_compliance_that_is_taken_off_leaves_the_contact_and_a_little_noise(seed):
    plain, soft = pair("compliance", seed)
    off = np.abs(soft.displacement_mm - plain.displacement_mm)
    for name, left in (("taken off", 0.05), ("known to 5 %", 0.25)):
        less, deviation = TAKEN_OFF[f"compliance, {name}"]
        other = less(deviation, seed)
        np.testing.assert_array_equal(other.force_n, soft.force_n)
        rest = np.abs(other.displacement_mm - plain.displacement_mm)
        assert 0.0 < np.max(rest) < left * np.max(off)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("name", ["taken off", "known to 5 %"])
def test_a_friction_that_is_taken_off_leaves_little_of_it_and_not_the_turns(seed, name):
    plain, held_back = pair("friction", seed)
    less, deviation = TAKEN_OFF[f"friction, {name}"]
    other = less(deviation, seed)
    np.testing.assert_array_equal(other.displacement_mm, held_back.displacement_mm)
    known = np.isfinite(other.force_n) & np.isfinite(plain.force_n)
    assert np.mean(known) > 0.4
    before, after = (c.force_n[known] - plain.force_n[known] for c in (held_back, other))
    assert np.sqrt(np.mean(after**2)) < 0.7 * np.sqrt(np.mean(before**2))


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("name", ["inertia", "drag"])
def test_what_moving_the_tool_takes_is_gone_and_the_forces_are_not(seed, name):
    plain, moved = pair(name, seed)
    less, deviation = TAKEN_OFF[f"{name}, taken off"]
    other = less(deviation, seed)
    np.testing.assert_array_equal(other.displacement_mm, moved.displacement_mm)
    known = np.isfinite(other.force_n)
    assert np.mean(known) > 0.9
    before, after = (np.std(c.force_n[known] - plain.force_n[known]) for c in (moved, other))
    assert after < 0.7 * before  # of 66 Hz, whose taps are short beside six readings
    less, deviation = TAKEN_OFF[f"{name}, known to 5 %"]
    assert 0.0 < np.std(less(deviation, seed).force_n[known] - other.force_n[known]) < 0.3 * before


def test_a_drag_is_the_speeds():
    time = np.linspace(0.0, 2.0, 4001)
    place = 3.0 + 1.5 * np.sin(6.0 * time)
    _read, force = MECHANICS["drag"](np.random.default_rng(1), time, place, np.ones(time.size))
    quotient = (force[5:-5] - 1.0) / np.gradient(place, time)[5:-5]
    assert 0.005 / 9.0 <= quotient[0] <= 0.05 / 8.9
    np.testing.assert_allclose(quotient, quotient[0], rtol=1e-6)
