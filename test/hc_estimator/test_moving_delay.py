"""A hand that palpates hardly more quickly than the organ breathes, channels in step and not.

Regression of 2026-11-27: of twenty such contacts out of step by 8 to 50 ms the delay was 17 ms off
in the median and K 3.9 % (130 % at 90 % of the samples in nine of ten); of twenty in step one was
told a delay of 17 ms, and two had a contact position or a force zero moved that were right, and K
twice too large from then on.
"""

from dataclasses import replace

import numpy as np
import pytest

import hc_estimator as hc
from hc_estimator.estimate import Hypothesis
from hc_evaluation.accuracy.possible import arm_readings
from hc_evaluation.accuracy.scenarios import simulate
from hc_evaluation.accuracy.together import contact_of

FILTER = "self_tuning_ukf"
OUT_OF_STEP = "slow, breathing, out of step"


def palpated(name, seed):
    """Contact, and what the default makes of it."""
    contact = simulate(contact_of(name, seed), seed)
    return contact, estimated(contact)


def estimated(contact):
    """What the default makes of a contact."""
    readings = contact.time_s, contact.displacement_mm, contact.force_n
    return hc.create_estimator(FILTER).run(*readings)


def errors(contact, series, begin_s):
    """Relative errors of K from a time on, and over what was claimed."""
    late = contact.time_s > begin_s
    error = np.abs(np.log(series.parameters[late, 0] / contact.parameters[late, 0]))
    return error, error / (series.parameters_std[late, 0] / series.parameters[late, 0])


def assert_delay_and_stiffness_are_found(name, seed, begin_s, most=0.03):
    """The delay in the end; K from a time on, and within what is said of it; its median error."""
    delay = contact_of(name, seed).force_delay_s
    contact, series = palpated(name, seed)
    assert series.channel_delay[-1] == pytest.approx(delay, abs=0.002)
    error, score = errors(contact, series, begin_s)
    assert np.median(error) < most
    assert np.mean(score < 3.0) > 0.9
    return np.median(error)


def test_a_delay_is_found_beneath_a_surface_that_breathes():
    """One of them shows K to 4 % only, and says so; of all of them it is known to one."""
    seeds = (5001, 5004, 5006, 5007, 5014, 5016, 5019)
    median = [assert_delay_and_stiffness_are_found(OUT_OF_STEP, s, 16.0, 0.05) for s in seeds]
    assert np.mean(median) < 0.01
    assert np.median(median) < 0.005


@pytest.mark.parametrize("seed", [1010, 1012, 1017, 1023, 1037, 1039, 5012])
def test_a_hand_that_is_quicker_than_the_organ(seed):
    """Regression of the same day: K was 12 to 93 % off in the median of these.

    Points of two delays were fitted as one, points whose force is later than their neighbours reach
    had no velocity, half of 20 ms was bridged by a Taylor series, and a delay that was 3 ms off was
    never mended.
    """
    assert_delay_and_stiffness_are_found("breathing, out of step", seed, 12.0)


@pytest.mark.parametrize("late", [0.005, -0.006, 0.008])
@pytest.mark.parametrize(("name", "seed"), [("breathing, out of step", 5006), (OUT_OF_STEP, 5006)])
def test_a_small_delay_is_found_as_well(name, seed, late):
    """Regression: one of up to 8 ms had to be likelier than itself within the fits in step."""
    contact = simulate(replace(contact_of(name, seed), force_delay_s=late), seed)
    series = estimated(contact)
    assert series.channel_delay[-1] == pytest.approx(late, abs=0.001)


@pytest.mark.parametrize("seed", [7000, 7001, 7003, 7004, 7007])
def test_a_force_zero_that_is_off_beneath_a_surface_that_breathes(seed):
    """Regression: within three deviations were 28 % of the samples, K 7 % off in the median."""
    contact, series = palpated("breathing, zeros off", seed)
    error, score = errors(contact, series, 14.0)
    assert np.median(error) < 0.04
    assert np.mean(score < 3.0) > 0.9


@pytest.mark.parametrize("seed", [5010, 5014, 5018])
def test_in_step_neither_a_delay_nor_a_zero_is_read_into_a_surface_that_breathes(seed):
    contact, series = palpated("slow, breathing", seed)
    assert not series.channel_delay.any()
    assert not series.force_zero.any()
    error, score = errors(contact, series, 8.0)
    assert np.median(error) < 0.03
    assert np.mean(score < 3.0) > 0.9
    moves = series.hypothesis[contact.time_s > 8.0] == Hypothesis.SURFACE_MOVES
    assert np.mean(moves) > 0.9


def test_a_delay_is_the_same_step_by_step_and_after_restore():
    contact = simulate(contact_of(OUT_OF_STEP, 5001), 5001)
    readings = (contact.time_s, contact.displacement_mm, contact.force_n)
    whole = hc.create_estimator(FILTER).run(*readings)
    found = int(np.flatnonzero(whole.channel_delay)[0])
    stepped = hc.create_estimator(FILTER)
    for sample in zip(*(values[: found - 10] for values in readings), strict=True):
        stepped.step(*sample)
    restored = hc.create_estimator(FILTER)
    restored.restore(stepped.state())
    rest = restored.run(*(values[found - 10 :] for values in readings))
    np.testing.assert_array_equal(rest.parameters, whole.parameters[found - 10 :])
    np.testing.assert_array_equal(rest.channel_delay, whole.channel_delay[found - 10 :])


@pytest.mark.parametrize("seed", [1014, 1029])
def test_a_force_where_the_row_in_charge_says_there_is_no_contact_refutes_it(seed):
    """A zero that is millimetres too deep: the choice slept for seconds beside half a newton.

    For two taps of forty or so it may, until what is remembered says otherwise.
    """
    time, _, force = readings = arm_readings(seed)
    series = hc.create_estimator(FILTER).run(*readings)
    pressed = (force > 0.2 * np.quantile(force, 0.95)) & (time > 4.0)
    asleep = pressed & (series.force_predicted <= 0.0)
    assert np.mean(asleep[pressed]) < 0.04
