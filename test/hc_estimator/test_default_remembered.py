"""What the default filter remembers, through rewinds, gaps, restarts and moved zeros.

Each is a regression of 2026-11-26, found by reading: something was kept that no longer held, or
used before anybody had set it.
"""

import math

import numpy as np
import pytest

import hc_estimator as hc
from hc_estimator.adaptation import difference_noise
from hc_estimator.multiple_model import (
    beginning,
    change,
    levels,
    maneuver,
    plausible,
)
from hc_estimator.multiple_model.hypotheses import FRESH, OWN, STEADY_SURFACE_ROW
from hc_estimator.multiple_model.model_error import LARGEST_MODEL_ERROR
from hc_estimator.multiple_model.rows import let_surface_move
from hc_evaluation.accuracy.drawn_contact import drawn_contact

FILTER = "self_tuning_ukf"


@pytest.fixture
def running(records_of, recording):
    """Settings and bank of a default filter after two seconds of contact."""
    estimator = hc.create_estimator(FILTER)
    estimator.run(*recording(2.0))
    return records_of(estimator)


def in_pieces(contact):
    """Time, displacement and force of a drawn contact, in 400 parts."""
    channels = (contact.time_s, contact.displacement_mm, contact.force_n)
    return zip(*(np.array_split(channel, 400) for channel in channels), strict=True)


# Rewinds


def test_a_surface_that_was_let_go_is_held_again_after_going_back(running):
    """Else its speed had no variance and nobody let it go a second time: it stood for good."""
    _, bank = running
    row = bank.rows[STEADY_SURFACE_ROW]
    row.position_deviation = 0.3
    row.covariance[OWN + 1, :] = 0.0
    row.covariance[:, OWN + 1] = 0.0
    time = float(bank.clock.state_time)
    bank.maneuver.count = bank.maneuver.waited = 0
    for _ in range(maneuver.PERIOD):
        maneuver.keep(bank, time)
    assert bank.maneuver.count == 1
    let_surface_move(row)
    assert row.covariance[OWN + 1, OWN + 1] > 0.0
    maneuver._go_back(bank, 0, time)
    assert row.covariance[OWN + 1, OWN + 1] == 0.0
    assert row.position_deviation == 0.3


# Tests of a change


def test_a_row_under_test_says_nothing_before_it_has_used_a_sample(records_of, recording):
    """Its evidence of the test before, or of none, was half of the lead that is called clear."""
    estimator = hc.create_estimator(FILTER)
    time, d, force = recording(8.0)
    force[4000:] *= 1.6
    _, bank = records_of(estimator)
    before = False
    for k in range(time.size):
        if k == 3990:
            bank.rows[FRESH].evidence = 1e6  # of long ago
        estimator.step(time[k], d[k], force[k])
        begins = bank.change.testing != 0 and not before
        before = bank.change.testing != 0
        if begins and k > 3990:
            assert bank.change.time <= 2e-3
            assert max(row.change_lead for row in bank.rows[:FRESH]) < change.LEAD
            return
    raise AssertionError("no test began")


# Restarts


def test_a_filter_that_starts_anew_looks_for_zeros_as_soon_as_it_did_at_first(running):
    """Its time in contact begins anew; zeros were looked for once that was as long as before."""
    settings, bank = running
    bank.tool.contact_clock = 100.0
    bank.zeros.looked_at = 99.5
    bank.zeros.since, bank.zeros.waiting, bank.zeros.candidate = 99.0, 1, 1
    bank.zeros.unknown, bank.zeros.moved[0] = 1, 0.2
    beginning.start(settings, bank)
    assert bank.tool.contact_clock == 0.0
    assert bank.zeros.looked_at == -math.inf
    assert (bank.zeros.waiting, bank.zeros.candidate) == (0, 0)
    assert (bank.zeros.unknown, bank.zeros.moved[0]) == (1, 0.2)  # what is in use stays in use


def test_one_sample_that_goes_back_after_a_clock_that_did_is_a_single_one(recording):
    """Fifty that were refused as backward counted on where the first one used was no estimate."""
    time, d, force = recording(2.0)
    estimator = hc.create_estimator(FILTER, outlier_gate=3.0)
    estimator.run(time, d, force)
    back = time - 10.0
    series = estimator.run(back[:60], d[:60], force[:60])
    assert (series.rejected[:49] == hc.Rejection.TIME_BACKWARD).all()
    assert estimator._memory["clock"]["backward_count"][0] == 0


# Points


@pytest.mark.parametrize("seed", [50, 53, 56, 58, 61])
def test_after_a_gap_the_grid_has_the_step_of_before(seed):
    """The gap itself was taken for a slow sensor.

    Points that are kept for the delay stand a step apart, and those of two steps were fitted
    together (delays of other sizes, and NaN).
    """
    contact = drawn_contact(("gaps", "delay"), seed)
    estimator = hc.create_estimator(FILTER)
    steps = set()
    for piece in in_pieces(contact):
        estimator.run(*piece)
        steps.add(float(estimator._memory["delay"]["grid_step"][0]))
    period = float(np.median(np.diff(contact.time_s)))
    assert len(steps - {0.0}) == 1
    assert max(steps) == pytest.approx(max(0.01, period), rel=0.01)


def test_points_of_another_rate_are_not_kept(records_of, recording):
    estimator = hc.create_estimator(FILTER)
    _, bank = records_of(estimator)
    estimator.run(*(channel[::2] for channel in recording(4.0)))
    assert bank.delay.kept > 20
    assert bank.delay.grid_step == 0.01
    time, d, force = (channel[::25] for channel in recording(8.0))
    estimator.run(time + 10.0, d, force)  # 40 a second from now on, after a pause
    assert bank.delay.grid_step == pytest.approx(0.025)
    assert bank.delay.kept <= 8.0 / 0.05  # as many as eight seconds have


# Moved zeros, another delay, gaps


def test_stiffness_found_at_most_is_no_force_below_zero(running):
    _, bank = running
    bank.tool.largest_force = 0.2
    plausible.move(bank.tool, 0.0, 0.5)
    assert bank.tool.largest_force == 0.0


def test_a_reading_placed_before_the_last_one_makes_no_negative_step():
    estimator = hc.create_estimator(FILTER)
    channel = estimator._memory["noise"][0, 0:1].view(np.recarray)[0]
    settings = estimator._settings.view(np.recarray)[0]
    for time in (1.0, 0.99):
        difference_noise.learn(settings, channel, time, 0.0, time == 1.0, 1e-5)
        assert channel.step >= 0.0


def test_time_does_not_run_backward_where_another_delay_is_used_from_now_on():
    contact = drawn_contact(("delay",), 84)
    estimator = hc.create_estimator(FILTER)
    times = []
    for piece in in_pieces(contact):
        estimator.run(*piece)
        memory = estimator._memory[0]
        times.append(min(memory["rows"]["contact_time"].min(), memory["judge"]["waited"]))
    assert min(times) >= 0.0


def test_a_gap_is_no_time_in_which_the_law_has_fitted(records_of, recording):
    """A row that had fitted for three seconds is believed at once: a gap of three made it so."""
    estimator = hc.create_estimator(FILTER, longest_gap=0.1)
    _, bank = records_of(estimator)
    time, d, force = recording(2.4)
    estimator.run(time[:2000], d[:2000], force[:2000])
    before = float(bank.change.fitting_time)
    estimator.run(time[2000:2100] + 30.0, d[2000:2100], force[2000:2100])
    assert bank.change.fitting_time < before + 0.2


def test_the_usual_velocity_is_between_those_that_there_were(running):
    _, bank = running
    bank.tool.contact_clock, bank.tool.usual_velocity, bank.tool.retreated = 100.0, 1.0, 1
    row = bank.rows[0]
    row.state[1] = 5.0
    levels.learn(bank.tool, bank.rows, row, 7.0)
    assert bank.tool.usual_velocity == pytest.approx(5.0)


# Refused displacements


def test_what_was_expected_of_a_refused_displacement_is_told(recording):
    """Its NIS was that of the sample before, and its innovation none."""
    time, d, force = recording(3.0)
    d[2500] += 5.0
    series = hc.create_estimator(FILTER).run(time, d, force)
    assert series.rejected[2500] == hc.Rejection.OUTLIER
    assert series.innovation[2500, 0] == pytest.approx(5.0, abs=0.02)
    assert np.isnan(series.innovation[2500, 1])
    assert series.nis[2500] > 12.0**2


def test_a_model_error_does_not_grow_beyond_all_numbers():
    """It follows both channels: where no motion explains the displacement it became 1e190 N^2."""
    contact = drawn_contact(("lumps", "delay"), 103)
    estimator = hc.create_estimator(
        FILTER, jerk_density=1e-6, motion_adaptation=False, noise_adaptation="fixed"
    )
    channels = contact.time_s, contact.displacement_mm, contact.force_n
    estimator.run(*(channel[:5000] for channel in channels))  # 1e44 by then
    assert estimator._memory["rows"]["model_error"].max() <= LARGEST_MODEL_ERROR
