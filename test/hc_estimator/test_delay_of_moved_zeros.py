"""Channels out of step where the surface sinks or the zeros are off: one law with zeros of its own.

Regression of 2026-11-27 (sixteen drawn contacts each, seeds from 9000): of slow palpation on a
surface that sinks the delay was 20 ms off in one of ten and K told wrong in 19 % of the samples, of
presses 33 and 17 %, of presses with zeros off 32 ms. One law at the zeros as given left far more
than noise, and passed for tissue that varies, of which half seconds along one way say no delay.
"""

import numpy as np
import pytest

import hc_estimator as hc
from hc_evaluation.accuracy import together
from hc_evaluation.accuracy.scenarios import simulate

MOTIONS = {"presses": together._pressed, "slow": together._slow}
SINKS, ZEROS_OFF = together._sinking, together._zeros_off


def contact_of(motion, trouble, seed):
    """The delay, and a contact with that trouble."""
    scenario, draw = MOTIONS[motion](motion, seed)
    for change in (trouble, together._out_of_step) if trouble else (together._out_of_step,):
        scenario = change(scenario, draw)
    return scenario.force_delay_s, simulate(scenario, seed)


def estimated(contact):
    """What the default makes of a contact."""
    readings = contact.time_s, contact.displacement_mm, contact.force_n
    return hc.create_estimator("self_tuning_ukf").run(*readings)


@pytest.mark.parametrize(
    ("motion", "trouble", "seed"),
    [
        *(("slow", SINKS, seed) for seed in (9006, 9007, 9010, 9011, 9012)),
        *(("presses", SINKS, seed) for seed in (9002, 9008, 9012)),
        *(("presses", ZEROS_OFF, seed) for seed in (7004, 9001, 9004, 9005, 9010)),
    ],
)
def test_a_delay_is_found_where_the_surface_sinks_or_the_zeros_are_off(motion, trouble, seed):
    delay, contact = contact_of(motion, trouble, seed)
    series = estimated(contact)
    assert series.channel_delay[-1] == pytest.approx(delay, abs=0.001)
    late = contact.time_s > 16.0
    error = np.abs(np.log(series.parameters[late, 0] / contact.parameters[late, 0]))
    deviation = series.parameters_std[late, 0] / series.parameters[late, 0]
    assert np.median(error) < 0.05
    assert np.mean(error < 3.0 * deviation) > 0.9


@pytest.mark.parametrize(("motion", "trouble"), [("slow", SINKS), ("presses", ZEROS_OFF)])
def test_in_step_none_is_found(motion, trouble):
    for seed in (9000, 9001, 9002):
        scenario, draw = MOTIONS[motion](motion, seed)
        series = estimated(simulate(trouble(scenario, draw), seed))
        assert not series.channel_delay.any()


def test_two_ways_say_a_delay_of_presses_with_zeros_that_are_right():
    """The first press and its way back are enough as long as one law fits them."""
    delay, contact = contact_of("presses", None, 7000)
    series = estimated(contact)
    begun = contact.time_s[np.flatnonzero(series.channel_delay)[0]]
    assert begun < 6.0
    assert series.channel_delay[-1] == pytest.approx(delay, abs=0.001)


def test_a_zero_that_moves_takes_all_of_the_grid_along():
    """What the delay is looked for in was left in the old zeros for half a second."""
    draw = np.random.default_rng(5)
    time = np.arange(0.0, 8.0, 0.005)
    place = 1.4 + 2.2 * np.sin(2.0 * np.pi * 1.5 * time)
    force = np.maximum(place, 0.0) ** 1.4 + 0.05 + 0.006 * draw.standard_normal(time.size)
    place = place + 0.0025 * draw.standard_normal(time.size)
    estimator, moves, before = hc.create_estimator("self_tuning_ukf"), 0, 0.0
    for k, stamp in enumerate(time):
        estimate = estimator.step(stamp, place[k], force[k])
        if estimate.force_zero == before:
            continue
        before, moves = estimate.force_zero, moves + 1
        finder = estimator._memory.view(np.recarray)[0].delay
        count = min(int(finder.grid_count), finder.grid.shape[0])
        rows = finder.grid[[int(finder.grid_count - 1 - i) % 80 for i in range(count)]]
        assert np.max(np.abs(rows["displacement"] - rows["displacement_by_parabola"])) < 0.01
        assert np.max(np.abs(rows["force"] - rows["force_by_parabola"])) < 0.02
    assert moves > 0
